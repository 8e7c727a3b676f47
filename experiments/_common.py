"""What the experiments share: settings from the command line, an output folder, and results as JSON.

An experiment is a frozen dataclass of settings and a function of those settings::

    @dataclass(frozen=True)
    class Config(ExperimentConfig):
        rows: int = setting(24, "cells along the surface", least=2)

    def experiment(config: Config, results: Results) -> Report: ...

    if __name__ == "__main__":
        sys.exit(run_experiment("fig00_name", __doc__, Config, experiment, FILES))
"""

from __future__ import annotations

import argparse
import dataclasses
import io
import sys
import tempfile
import time
import types
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import torch
from _processes import rank
from torch import Tensor

from torchfair import Topology, TorchfairError
from torchfair.io import atomic_write_bytes, atomic_write_text, save_mesh, to_json, versions

Report = dict[str, Any]
T = TypeVar("T")
C = TypeVar("C", bound="ExperimentConfig")

RESULT = "result.json"
EXIT_OK, EXIT_ERROR, EXIT_INTERRUPTED = 0, 2, 130


# ---- settings ------------------------------------------------------------------------------------------


def setting(default: T, explanation: str, *, least: float | None = None, choices: Sequence[str] | None = None) -> T:
    """A field of a configuration: its default, its help text, and bounds that are checked.

    ``least`` and ``choices`` hold for every member of a tuple.
    """
    metadata = {"help": explanation, "least": least, "choices": choices}
    made: T = dataclasses.field(default=default, metadata=metadata)
    return made


@dataclass(frozen=True)
class ExperimentConfig:
    """Settings of every experiment. Subclasses add their own with :func:`setting`.

    Raises:
        ValueError: from the constructor, if a setting is out of bounds.
    """

    output: str = setting("", "folder for the results; by default results/NAME")
    force: bool = setting(False, "replace results that are there already")
    seed: int = setting(0, "start of all random generators", least=0)
    threads: int = setting(1, "threads that torch may use", least=1)
    width: int = setting(1700, "columns of pixels of rendered pictures", least=300)

    @property
    def replaces(self) -> bool:
        """Whether results that are there already may be replaced."""
        return self.force

    def __post_init__(self) -> None:
        for field in dataclasses.fields(self):
            value, least, choices = getattr(self, field.name), field.metadata["least"], field.metadata["choices"]
            members = value if isinstance(value, tuple) else (value,)
            if not members:
                raise ValueError(f"{field.name} needs at least one value")
            for member in members:
                if least is not None and not member >= least:
                    raise ValueError(f"{field.name} must be at least {least}, got {member}")
                if choices is not None and member not in choices:
                    raise ValueError(f"{field.name} must be one of {', '.join(choices)}, got {member!r}")


def parse_config(kind: type[C], arguments: Sequence[str] | None, *, name: str, description: str) -> C:
    """The configuration from command-line arguments: one option ``--field-name`` per field.

    Booleans become flags, tuples take several values. Wrong values end the program with exit code 2.
    """
    parser = argparse.ArgumentParser(prog=f"{name}.py", description=description.partition("\n\n")[0])
    own, common = parser.add_argument_group("this experiment"), parser.add_argument_group("every experiment")
    shared = {field.name for field in dataclasses.fields(ExperimentConfig)}
    hints = get_type_hints(kind)
    for field in dataclasses.fields(kind):
        _add_option(common if field.name in shared else own, field, hints[field.name])
    values: dict[str, Any] = vars(parser.parse_args(arguments))
    values = {name: tuple(value) if isinstance(value, list) else value for name, value in values.items()}
    try:
        return kind(**values)
    except ValueError as error:
        parser.error(str(error))


def _add_option(group: argparse._ArgumentGroup, field: dataclasses.Field[Any], hint: Any) -> None:
    option, default, choices = "--" + field.name.replace("_", "-"), field.default, field.metadata["choices"]
    shown = " ".join(map(str, default)) if isinstance(default, tuple) else default
    text = field.metadata["help"] + (f"; one of {', '.join(choices)}" if choices else "")
    text = (text if default in ("", False) else f"{text} [{shown}]").replace("%", "%%")
    if hint is bool:
        action = argparse.BooleanOptionalAction if default else "store_true"
        group.add_argument(option, action=action, default=default, help=text)
        return
    if get_origin(hint) in (Union, types.UnionType):  # T | None
        hint = next(kind for kind in get_args(hint) if kind is not type(None))
    several = get_origin(hint) is tuple
    group.add_argument(
        option,
        type=get_args(hint)[0] if several else hint,
        nargs="+" if several else None,
        default=default,
        metavar=field.name.upper(),
        help=text,
    )


# ---- results -------------------------------------------------------------------------------------------


class Results:
    """The output folder of one run: every file appears whole or not at all, none is replaced without ``force``.

    Args:
        folder: made if it is missing.
        force: whether existing files may be replaced.
        files: names of all files the run writes, so that it is refused before it starts, not at its end.

    Raises:
        TorchfairError: if one of the files exists and ``force`` is false.
    """

    def __init__(self, folder: Path, *, force: bool, files: Sequence[str]) -> None:
        there = [name for name in files if (folder / name).exists()]
        if there and not force:
            raise TorchfairError(
                f"{folder} holds results already ({', '.join(there[:3])}{', ...' if len(there) > 3 else ''}). "
                "Choose another folder with --output, or replace them with --force."
            )
        folder.mkdir(parents=True, exist_ok=True)
        self.folder, self.force = folder, force
        self.written: list[str] = []

    def path(self, name: str) -> Path:
        """Where the file ``name`` goes; for those who write it themselves."""
        if name not in self.written:
            self.written.append(name)
        return self.folder / name

    def mesh(self, name: str, vertices: Tensor, topology: Topology) -> None:
        """Writes a mesh; the extension says in which format."""
        save_mesh(self.path(name), vertices, topology, overwrite=self.force)

    def text(self, name: str, text: str) -> None:
        """Writes plain text."""
        atomic_write_text(self.path(name), text, overwrite=self.force)

    def json(self, name: str, value: Any) -> None:
        """Writes JSON; numbers that are not finite become null."""
        atomic_write_text(self.path(name), to_json(value), overwrite=self.force)

    def state(self, name: str, value: Mapping[str, Any], *, overwrite: bool | None = None) -> None:
        """Writes tensors and plain values for ``torch.load``."""
        buffer = io.BytesIO()
        torch.save(dict(value), buffer)
        atomic_write_bytes(self.path(name), buffer.getvalue(), overwrite=self.force if overwrite is None else overwrite)


# ---- running -------------------------------------------------------------------------------------------


def run_experiment(
    name: str,
    description: str | None,
    kind: type[C],
    experiment: Callable[[C, Results], Report],
    files: Sequence[str],
    arguments: Sequence[str] | None = None,
) -> int:
    """Runs an experiment from the command line and returns its exit code.

    What ``experiment`` returns goes to ``result.json`` together with settings, versions and the time it took
    (``cpu_seconds`` does not count what else the machine was doing).
    Errors that the user can mend are one line on stderr and exit code 2; Ctrl-C gives 130, with all results if the
    experiment went on to write them and says so by an entry ``interrupted`` that is true.

    Args:
        name: of the script without ``.py``; also the name of the default folder in ``results/``.
        description: docstring of the script; its first paragraph is the help text.
        kind: class of the configuration.
        experiment: does the work and writes pictures and meshes.
        files: names of the files it writes besides ``result.json``.
        arguments: command-line arguments, by default those of the process.
    """
    config = parse_config(kind, arguments, name=name, description=description or "")
    if rank():  # of several processes only the first one's results are kept
        with tempfile.TemporaryDirectory() as folder:
            return _run(name, config, experiment, files, Path(folder))
    return _run(name, config, experiment, files, Path(config.output or Path("results") / name))


def _run(name: str, config: C, experiment: Callable[[C, Results], Report], files: Sequence[str], folder: Path) -> int:
    threads = torch.get_num_threads()
    torch.set_num_threads(config.threads)
    torch.manual_seed(config.seed)
    begin, cpu = time.perf_counter(), time.process_time()
    try:
        results = Results(folder, force=config.replaces, files=[*files, RESULT])
        report = experiment(config, results)
        times = {"seconds": time.perf_counter() - begin, "cpu_seconds": time.process_time() - cpu}
        results.json(RESULT, {"experiment": name, "settings": config, **times, "versions": versions(), **report})
    except KeyboardInterrupt:
        print(f"{name}: interrupted", file=sys.stderr)
        return EXIT_INTERRUPTED
    except (TorchfairError, OSError) as error:
        print(f"{name}: error: {' '.join(str(error).split())}", file=sys.stderr)
        return EXIT_ERROR
    finally:
        torch.set_num_threads(threads)
    spent = f"{times['seconds']:.1f} s ({times['cpu_seconds']:.1f} s of one core)"
    print(f"{spent}; results in {folder}/: {', '.join(results.written)}")
    return EXIT_INTERRUPTED if report.get("interrupted") else EXIT_OK
