"""The frame of the command line: parsing, exit codes, one line for every error."""

from __future__ import annotations

import argparse
import difflib
import io
import os
import sys
from collections.abc import Callable, Sequence
from typing import TextIO

from .._interrupts import ended_like_ctrl_c
from .._memory import keep_freed_memory
from ..progress import shown_phases
from . import denoise, design, diagnose, fair, form, measure, mesh, reflect, subdivide, symmetric
from .errors import CommandError
from .exit_codes import EXIT_BROKEN_PIPE, EXIT_INTERRUPTED, EXIT_OK, EXIT_SIGNAL, IN_WORDS
from .outcomes import outcome_of
from .parser import CommandParser
from .several import run_inputs
from .tellers import json_or_plain

_JOBS = (fair.COMMAND, form.COMMAND, symmetric.COMMAND, denoise.COMMAND)
_COMMANDS = (measure, diagnose, reflect, *_JOBS, mesh, subdivide, design)
_DESCRIPTION = "Visual smoothness of polyhedral surfaces: measure it, improve it."


def build_parser() -> CommandParser:
    """The parser of ``torchfair`` with all subcommands."""
    parser = CommandParser(prog="torchfair", description=_DESCRIPTION, epilog=IN_WORDS, allow_abbrev=False)
    parser.add_argument("--version", action="store_true", help="print the version and exit")
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND")
    for command in _COMMANDS:
        command.add_parser(subparsers)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Runs ``torchfair`` with the given arguments (by default those of the process) and returns the exit code.

    Errors that the user can mend (wrong options, :class:`~torchfair.TorchfairError`, files that cannot be read
    or written) end as exactly one line on stderr and exit code 2. Ctrl-C gives 130, SIGTERM and SIGHUP, which do the
    same, 143 and 129; a reader that goes away, as in ``torchfair measure x.obj | head -1``, gives 141 without any
    message.
    """
    parsed: list[argparse.Namespace] = []
    code = guarded(lambda: _parse(argv, parsed), "torchfair")
    if argv is None and parsed and getattr(parsed[0], "keeps_memory", False):  # the process is for this command alone
        keep_freed_memory()
    return guarded(lambda: _run(parsed[0]), parsed[0].name) if parsed else code


def guarded(run: Callable[[], int], name: str) -> int:
    """Runs a command; its exit code, with one line on stderr if something went wrong."""

    def flushed() -> int:
        code = run()
        sys.stdout.flush()
        return code

    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # file names may hold anything
    try:
        with ended_like_ctrl_c() as handler:
            outcome = outcome_of(flushed, name)
    except BrokenPipeError:
        _abandon_broken(sys.stdout)
        _abandon_broken(sys.stderr)
        return EXIT_BROKEN_PIPE
    try:
        print(outcome.line, end="\n" * bool(outcome.line), file=sys.stderr, flush=True)
    except OSError:
        _abandon_broken(sys.stderr)
    if outcome.code == EXIT_INTERRUPTED and handler.number is not None:
        return EXIT_SIGNAL + handler.number
    return outcome.code


def _parse(argv: Sequence[str] | None, parsed: list[argparse.Namespace]) -> int:
    """Adds arguments of a command that is to be run, if there is one, to ``parsed``."""
    parser = build_parser()
    arguments, unknown = parser.parse_known_args(argv)
    if isinstance(getattr(arguments, "input", None), list) and not any(word.startswith("-") for word in unknown):
        arguments.input, unknown = arguments.input + unknown, []  # inputs may stand on both sides of options
    if unknown:  # argparse would name the parser of all commands here
        name = getattr(arguments, "name", "torchfair")
        wrong = next((word.partition("=")[0] for word in unknown if word.startswith("--")), "")
        near = difflib.get_close_matches(wrong, arguments.options, 1, 0.75)
        hint = f", did you mean {near[0]}?" if near else ""
        raise CommandError(f"unrecognized arguments: {' '.join(unknown)}{hint} ({name} --help lists the options)", name)
    del arguments.options
    if arguments.version:
        from .. import __version__

        print(f"torchfair {__version__}")
        return EXIT_OK
    if not hasattr(arguments, "run"):
        parser.error("a command is needed")
    parsed.append(arguments)
    return EXIT_OK


def _run(arguments: argparse.Namespace) -> int:
    with shown_phases():
        if isinstance(getattr(arguments, "input", None), list):
            return run_inputs(arguments, getattr(arguments, "teller", json_or_plain))
        return int(arguments.run(arguments))


def _abandon_broken(stream: TextIO) -> None:
    """Lets what a stream without a reader still holds go nowhere, so that closing it at exit cannot fail."""
    try:
        stream.flush()
        return
    except OSError:
        pass
    try:
        descriptor = stream.fileno()
    except (OSError, ValueError):
        return
    devnull = os.open(os.devnull, os.O_WRONLY)
    os.dup2(devnull, descriptor)
    os.close(devnull)
