"""Several inputs of one command: what becomes of each, one after the other or in processes of their own."""

from __future__ import annotations

import argparse
import contextlib
import copy
import glob
import io
import os
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Protocol

from .arguments import positive_count
from .element_tables import refuse_one_table
from .errors import CommandError
from .exit_codes import EXIT_INTERRUPTED, EXIT_NOT_REACHED, EXIT_OK
from .outcomes import Outcome, outcome_of
from .output_checks import MESH_FORMATS
from .output_names import input_stem
from .processes import run_in_processes

Finished = tuple[argparse.Namespace, Outcome, str]
"""A request, how it ended, and what it printed, as far as that was kept."""


class Teller(Protocol):
    """How it is told what came of several inputs.

    Attributes:
        keeps_json: Whether each is asked for one JSON object, which the teller prints in its own way.
    """

    keeps_json: bool

    def tell(self, arguments: argparse.Namespace, printed: str) -> None:
        """Called for every input in order, with what it printed."""

    def end(self) -> None:
        """Called at last."""


def add_inputs(parser: argparse.ArgumentParser, words: str, *, needed: bool = True) -> None:
    """Adds INPUT, of which there may be several, and ``--jobs``."""
    parser.add_argument("input", metavar="INPUT", nargs="+" if needed else "*", help=f"{words}; several are done one "
        "after the other, with a folder for OUTPUT")  # fmt: skip
    parser.add_argument("--jobs", type=positive_count, default=1, metavar="N", help="of several inputs do so many at "
        "a time, which share the processors (default 1)")  # fmt: skip


def run_inputs(arguments: argparse.Namespace, teller: Callable[[argparse.Namespace], Teller]) -> int:
    """Runs a command for all its inputs; the exit code.

    One input ends as the command does. Of several the failures are listed at the end on stderr; then the exit code is
    1, or 130 if the whole was interrupted.

    Args:
        arguments: With ``input`` a list.
        teller: Made for several inputs.
    """
    inputs = [name for word in arguments.input for name in _expanded(word)]
    requests = _requests(arguments, inputs)
    if len(requests) == 1 and not getattr(arguments, "csv", False):
        return int(requests[0].run(requests[0]))
    refuse_one_table(arguments)
    if hasattr(arguments, "check"):
        arguments.check(arguments)
    told = teller(arguments)
    if told.keeps_json:
        for request in requests:
            request.json = True
    run = _in_turn if arguments.jobs == 1 or len(requests) == 1 else run_in_processes
    outcomes = []
    for request, outcome, printed in run(requests, min(arguments.jobs, len(requests)), told.keeps_json):
        outcomes.append(outcome)
        if printed or not told.keeps_json:
            told.tell(request, printed)
    told.end()
    return _listed(arguments.name, requests, outcomes)


def _expanded(word: str) -> list[str]:
    """Files of a pattern, where the shell has left it to the program."""
    found = sorted(glob.glob(word)) if glob.has_magic(word) and not os.path.lexists(word) else []
    return found or [word]


def _requests(arguments: argparse.Namespace, inputs: Sequence[str]) -> list[argparse.Namespace]:
    """Arguments for each input alone."""
    if not inputs:
        return [_for(arguments, None)]
    output = getattr(arguments, "output", None)
    requests = [_for(arguments, name) for name in inputs]
    if output is None:
        return requests
    if not getattr(arguments, "output_is_folder", False) and _is_folder(output, len(inputs)):
        for request in requests:
            request.output = os.path.join(output, _output_name(request.input))
        _refuse_inputs_as_outputs(requests)
    _refuse_collisions(inputs)
    return requests


def _for(arguments: argparse.Namespace, name: str | None) -> argparse.Namespace:
    request = copy.copy(arguments)
    request.input = name
    del request.jobs
    return request


def _is_folder(output: str, count: int) -> bool:
    """Whether ``--output`` names the folder of meshes, rather than the mesh."""
    named = os.path.isdir(output) or output.endswith(("/", os.sep)) or not Path(output).suffix
    if count > 1 and not named and Path(output).suffix.lower() in MESH_FORMATS:
        raise CommandError(f"--output {output}: several inputs need a folder for what comes of them")
    return named or count > 1


def _output_name(name: str) -> str:
    suffix = Path(name).suffix if not name.startswith("example:") else ""
    return f"{input_stem(name)}{suffix if suffix.lower() in MESH_FORMATS else '.obj'}"


def _refuse_inputs_as_outputs(requests: Sequence[argparse.Namespace]) -> None:
    inputs = {os.path.realpath(request.input): request.input for request in requests}
    for request in requests:
        taken = inputs.get(os.path.realpath(request.output))
        if taken is not None:
            raise CommandError(f"{request.output} is an input: choose another folder")


def _refuse_collisions(inputs: Sequence[str]) -> None:
    """Refuses inputs whose files would have the same names, on systems that ignore case, too."""
    same = defaultdict(list)
    for name in inputs:
        same[input_stem(name).casefold()].append(name)
    doubled = [", ".join(names) for names in same.values() if len(names) > 1]
    if doubled:
        raise CommandError(f"files of these would have the same names: {'; '.join(doubled)}. Give them one by one")


def _in_turn(requests: Sequence[argparse.Namespace], jobs: int, kept: bool) -> Iterator[Finished]:
    """One after the other, in this process; nothing is begun once one was interrupted."""
    stopped = False
    for request in requests:
        if stopped:
            yield request, Outcome(EXIT_INTERRUPTED, "not begun", request.name), ""
            continue
        printed = io.StringIO()
        if not kept:
            print(f"== {request.input}", flush=True)
        with contextlib.redirect_stdout(printed) if kept else contextlib.nullcontext():
            outcome = outcome_of(lambda request=request: request.run(request), request.name)  # type: ignore[misc]
        stopped = outcome.code == EXIT_INTERRUPTED
        yield request, outcome, printed.getvalue()


def _listed(name: str, requests: Sequence[argparse.Namespace], outcomes: Sequence[Outcome]) -> int:
    """Says what was not done; the exit code of all."""
    bad = [(request, end) for request, end in zip(requests, outcomes, strict=True) if end.code != EXIT_OK]
    if not bad:
        return EXIT_OK
    lines = [f"{name}: {len(requests) - len(bad)} of {len(requests)} done"]
    lines += [f"  {end.told(request.input)}" for request, end in bad]
    print("\n".join(lines), file=sys.stderr, flush=True)
    interrupted = any(end.code == EXIT_INTERRUPTED for _, end in bad)
    return EXIT_INTERRUPTED if interrupted else EXIT_NOT_REACHED
