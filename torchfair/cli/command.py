"""The frame of the command line: parsing, exit codes, one line for every error."""

from __future__ import annotations

import argparse
import io
import os
import sys
from collections.abc import Sequence
from typing import TextIO

from ..errors import TorchfairError
from . import denoise, design, diagnose, fair, form, measure, mesh, reflect, subdivide, symmetric
from .errors import CommandError
from .exit_codes import EXIT_BROKEN_PIPE, EXIT_ERROR, EXIT_INTERRUPTED, EXIT_OK, IN_WORDS
from .parser import CommandParser

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
    or written) end as exactly one line on stderr and exit code 2. Interruption gives 130; a reader that goes
    away, as in ``torchfair measure x.obj | head -1``, gives 141 without any message.
    """
    name = "torchfair"
    if isinstance(sys.stdout, io.TextIOWrapper):
        sys.stdout.reconfigure(errors="backslashreplace")  # file names may hold anything
    try:
        parser = build_parser()
        arguments, unknown = parser.parse_known_args(argv)
        name = getattr(arguments, "name", name)
        code = _run(parser, arguments, unknown, name)
        sys.stdout.flush()
        return code
    except BrokenPipeError:
        _abandon_broken(sys.stdout)
        _abandon_broken(sys.stderr)
        return EXIT_BROKEN_PIPE
    except KeyboardInterrupt:
        return _fail(f"{name}: interrupted", EXIT_INTERRUPTED)
    except SystemExit as stop:  # argparse, after printing help
        return stop.code if isinstance(stop.code, int) else EXIT_OK
    except CommandError as error:
        return _fail(f"{error.name or name}: error: {error}", EXIT_ERROR)
    except TorchfairError as error:
        return _fail(f"{name}: error: {error}", EXIT_ERROR)
    except OSError as error:
        place = f"{error.filename}: " if error.filename is not None else ""
        return _fail(f"{name}: error: {place}{error.strerror or error}", EXIT_ERROR)


def _run(parser: CommandParser, arguments: argparse.Namespace, unknown: list[str], name: str) -> int:
    if unknown:  # argparse would name the parser of all commands here
        raise CommandError(f"unrecognized arguments: {' '.join(unknown)} ({name} --help lists the options)", name)
    if arguments.version:
        from .. import __version__

        print(f"torchfair {__version__}")
        return EXIT_OK
    if not hasattr(arguments, "run"):
        parser.error("a command is needed")
    return int(arguments.run(arguments))


def _fail(message: str, code: int) -> int:
    """Prints ``message`` as one line on stderr, as far as anyone listens."""
    try:
        print(" ".join(message.split()), file=sys.stderr, flush=True)
    except OSError:
        _abandon_broken(sys.stderr)
    return code


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
