"""Where a result is kept that cannot be written where it was to go."""

from __future__ import annotations

import contextlib
import itertools
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

from .output_names import OutputNames


def places(asked: OutputNames, paths: Callable[[OutputNames], Sequence[Path]]) -> Iterator[OutputNames]:
    """Names to try one after the other: as asked for, under a free name beside, then in new folders elsewhere.

    Those are in the working folder, at home and where temporary files go. The ones that were of no use are removed.

    Args:
        asked: Where the result was to go.
        paths: All files that belong to names.
    """
    yield asked
    yield _free(asked, paths)
    for folder in (Path.cwd, Path.home, lambda: Path(tempfile.gettempdir())):
        try:
            made = Path(tempfile.mkdtemp(prefix="torchfair-", dir=folder()))
        except (OSError, RuntimeError):  # there is no home, say
            continue
        try:
            yield replace(asked, folder=made, side_folder=made)
        finally:
            with contextlib.suppress(OSError):  # it is in use
                made.rmdir()


def _free(asked: OutputNames, paths: Callable[[OutputNames], Sequence[Path]]) -> OutputNames:
    for number in itertools.count(2):
        names = replace(asked, stem=f"{asked.stem}-{number}")
        if not any(os.path.lexists(path) for path in paths(names)):
            return names
    raise AssertionError
