"""A subcommand for a job: parser, solve, files and what is said, from settings, inputs, a function and pictures."""

from __future__ import annotations

import argparse
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, ClassVar

from .._interrupts import deferred_interrupts
from .._names import FROM_ZERO
from .exit_codes import IN_WORDS, exit_code
from .options import SettingOptions
from .outputs import Outputs, add_outputs, asked_for
from .parser import CommandParser
from .reading import in_numbers_of, read_report
from .request import Request, Writer
from .summary import kept_lines, measures_table, missed_lines, note_lines, work_lines
from .views import view_of

if TYPE_CHECKING:
    from ..formfinding import JobResult


class JobCommand(ABC):
    """What a job has to say to become a command.

    Attributes:
        job: Its name.
        purpose: What it is for, in the list of commands.
        description: What it does, above its options.
        option_names: Options of settings that are not named after their fields, by field.
        pictures: Writers of pictures by name of the file.
    """

    job: ClassVar[str]
    purpose: ClassVar[str]
    description: ClassVar[str]
    option_names: ClassVar[Mapping[str, str]] = {}
    pictures: ClassVar[Mapping[str, Writer]] = {}

    # ---- what differs between jobs ---------------------------------------------------------------------

    @abstractmethod
    def settings(self) -> type[Any]:
        """The dataclass of settings."""

    @abstractmethod
    def function(self) -> Callable[..., JobResult[Any]]:
        """Does the job: takes what :meth:`read` gives, ``settings`` and ``callback``."""

    @abstractmethod
    def add_inputs(self, parser: argparse.ArgumentParser) -> None:
        """Adds what is read, beside the settings."""

    @abstractmethod
    def read(self, arguments: argparse.Namespace, settings: Any) -> Request:
        """Reads it."""

    def outputs(self, arguments: argparse.Namespace) -> Outputs:
        """The files to write."""
        return Outputs(arguments, self.pictures)

    def most_steps(self, settings: Any) -> int:
        """Where a run ends at the latest, for the display of progress."""
        return int(settings.projection.max_iterations)

    # ---- what all have in common -----------------------------------------------------------------------

    @property
    def name(self) -> str:
        """As it is typed."""
        return f"torchfair {self.job}"

    def add_parser(self, subparsers: Any) -> None:
        """Adds the command to the others."""
        parser: CommandParser = subparsers.add_parser(
            self.job,
            help=self.purpose,
            description=self.description,
            epilog=IN_WORDS,
            allow_abbrev=False,
            fill=self._fill,
        )
        parser.set_defaults(run=self.run, check=self.check, name=self.name)

    def _fill(self, parser: CommandParser) -> None:
        self.add_inputs(parser)
        add_outputs(parser)
        self.options().add_to(parser)

    def options(self) -> SettingOptions[Any]:
        """The options that are settings."""
        return SettingOptions(self.settings(), self.job, self.option_names)

    def check(self, arguments: argparse.Namespace) -> None:
        """Refuses settings that no input can have."""
        self.options().settings(arguments)

    def run(self, arguments: argparse.Namespace) -> int:
        """Checks everything that can be checked first, then solves, then writes; the exit code."""
        settings = self.options().settings(arguments)
        outputs = self.outputs(arguments)
        outputs.prepare()
        request = self.read(arguments, settings)
        request.view = view_of(arguments, request.mesh)
        settings = request.settings or settings
        outputs.make_folders(request.mesh, getattr(arguments, "levels", 0))
        for warning in request.warnings:
            print(f"{self.name}: warning: {warning}", file=sys.stderr, flush=True)
        mesh = request.mesh
        solve = self._solver(request, settings, quiet=getattr(arguments, "quiet", False))

        def report() -> dict[str, Any]:
            return self._report(arguments, request, result, settings)

        with deferred_interrupts() as interrupts:  # from the first step to the file nothing is lost
            with in_numbers_of(mesh, getattr(arguments, "input", None)):
                result = solve()
            outputs.save(request, result, report)
            request.interrupted = interrupts.pending
        outputs.save_more(request, result, report)
        levels = getattr(arguments, "levels", 0)
        names = mesh.names if len(result.levels) == 1 else FROM_ZERO  # finer meshes have their own numbers
        missed = [*missed_lines(result, levels, names), *request.missed]
        plain = [*missed_lines(result, levels), *request.missed]
        lines = [
            *note_lines(mesh.repairs, [*mesh.notes, *request.notes, *result.notes], plain),
            *measures_table(result.before, result.after),
            *kept_lines(result),
            *work_lines(result),
            *outputs.lines(),
        ]
        outputs.finish(request, result, lines, [self.options().in_options(line) for line in missed])
        return exit_code(result.projection.status, missed, interrupted=request.interrupted)

    def _solver(self, request: Request, settings: Any, *, quiet: bool) -> Callable[[], JobResult[Any]]:
        """Does the job; all that it needs is loaded."""
        from ..progress import ProgressDisplay

        job, start = self.function(), request.start or (request.mesh.vertices, request.mesh.topology)

        def solve() -> JobResult[Any]:
            with ProgressDisplay(self.most_steps(settings)) as display:
                return job(*start, **request.options, settings=settings, callback=None if quiet else display)

        return solve

    def _report(
        self, arguments: argparse.Namespace, request: Request, result: JobResult[Any], settings: Any
    ) -> dict[str, Any]:
        from ..formfinding import job_report

        own = {"job": self.job, "request": asked_for(arguments), **read_report(request.mesh), **request.report}
        return {**own, **job_report(result, settings)}
