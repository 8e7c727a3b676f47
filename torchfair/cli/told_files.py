"""Report and pictures of an input, in a folder and named after it."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from .output_checks import make_folders, refuse_report_of_another, refuse_taken, remove
from .output_names import FILES, OutputNames, input_stem, listed, listed_in

_BYTES = 1_000_000  # of a report or a picture, about


def told_files(arguments: argparse.Namespace, ends: Sequence[str]) -> list[Path]:
    """The files of INPUT in the folder ``--output``, by ends of their names, the report first; none without a folder.

    Raises:
        CommandError: they exist and may not be replaced, or cannot be written.
    """
    if arguments.output is None:
        return []
    folder = Path(arguments.output)
    names = OutputNames(folder, input_stem(arguments.input), "", folder)
    files = [names.side(end) for end in ends]
    refuse_taken(files, force=arguments.force)
    refuse_report_of_another(files[0], Path(arguments.input))
    return files


@contextmanager
def written_with_report(
    files: Sequence[Path], report: Mapping[str, Any], arguments: argparse.Namespace, later: Sequence[Path] = ()
) -> Iterator[None]:
    """Writes a report and what its body writes, all or nothing; what is left of an earlier run is removed.

    Args:
        files: All files, the report first.
        report: Its entries.
        arguments: Of the command.
        later: Those of the files that are written after the body.
    """
    from ..io import atomic_write_text, to_json, written_together

    make_folders(files, _BYTES * len(files))
    old = listed_in(files[0], input_stem(arguments.input)) if arguments.force else []
    with written_together():
        entries = {**report, FILES: listed(files, files[0])}
        atomic_write_text(files[0], to_json(entries), overwrite=arguments.force)
        yield
    remove(path for path in old if path not in files or path in later)
