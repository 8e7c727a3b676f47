"""Progress of an iterating solver: in place on a terminal, plain lines elsewhere."""

from __future__ import annotations

import math
import sys
import threading
import time
from collections.abc import Mapping
from contextlib import ExitStack, suppress
from types import TracebackType
from typing import TYPE_CHECKING, Protocol, TextIO

from .long_phases import PATIENCE, LongPhases
from .phases import listening
from .time_left import TimeLeft, duration

if TYPE_CHECKING:
    from rich.console import Console, RenderableType
    from rich.live import Live

_REFRESH = 0.1  # seconds between repaints of a terminal
_BAR = 20  # columns
_PLAIN_LINES = 20  # wanted number of plain lines
_SILENCE = 10.0  # seconds without a plain line after which the next record is shown
_SYMBOLS = {"normal_variation": "E", "angle_variation": "E'", "total_absolute_curvature": "C"}


class Record(Protocol):
    """What a solver tells after every iteration."""

    @property
    def iteration(self) -> int:
        """Number of the iteration; 0 is the start."""

    @property
    def merit(self) -> float:
        """What is minimised, after this iteration."""

    @property
    def damping(self) -> float:
        """Levenberg-Marquardt parameter of this step; NaN at the start."""

    @property
    def accepted(self) -> bool:
        """Whether the step was taken."""

    @property
    def elapsed(self) -> float:
        """Seconds since the start."""

    @property
    def quantities(self) -> Mapping[str, float]:
        """Energies and the like, by name."""


class ProgressDisplay:
    """Shows iteration, merit, energies, damping and time left; a callback to be used as a context manager.

    On a terminal one line is redrawn in place, at most ten times a second. Otherwise plain lines are printed and
    flushed: the first record, every ``every``-th, those ten seconds after the last one shown, and the last. What is
    done without iterations (:func:`~torchfair.progress.phase`) is named once it takes two seconds. The time left is
    that of :class:`~torchfair.progress.TimeLeft`, an upper estimate. Never asks the solver to stop, nor ends it where
    the stream is closed.

    Example::

        with ProgressDisplay(60) as display:
            minimise_normal_variation(vertices, topology, callback=display)

    Args:
        max_iterations: where the solver stops at the latest.
        stream: where to write, by default stderr.
        every: distance of plain lines in iterations; by default such that there are about twenty.
        console: a rich console to draw on, terminal or not, instead of ``stream``.
    """

    def __init__(
        self,
        max_iterations: int,
        *,
        stream: TextIO | None = None,
        every: int | None = None,
        console: Console | None = None,
    ) -> None:
        self._max_iterations = max_iterations
        self._stream = stream or sys.stderr
        self._every = max(1, every or max_iterations // _PLAIN_LINES)
        self._console = console
        self._time_left = TimeLeft(max_iterations)
        self._live: Live | None = None
        self._last: Record | None = None
        self._shown: Record | None = None
        self._repainted = 0.0
        self._phases = LongPhases(lambda words, _: self._write(f"{words} ...", None), patience=PATIENCE)
        self._listening = ExitStack()
        self._writing = threading.Lock()

    def __enter__(self) -> ProgressDisplay:
        if self._console is None and self._stream.isatty():
            from rich.console import Console

            self._console = Console(file=self._stream)
        if self._console is not None and self._console.is_terminal and not self._console.is_dumb_terminal:
            from rich.live import Live

            self._live = Live(console=self._console, auto_refresh=False, redirect_stdout=False)
            self._live.start()
        elif self._console is not None:
            self._stream = self._console.file
        self._repainted = 0.0 if self._live is not None else time.monotonic()
        self._listening.enter_context(listening(self._phases))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._listening.close()
        self._phases("")
        if self._last is not None and self._last is not self._shown:
            self._show(self._last)
        if self._live is not None:
            with suppress(OSError):
                self._live.stop()
            self._live = None

    def __call__(self, record: Record) -> None:
        """Takes note of one iteration."""
        self._time_left.observe(record.iteration, record.elapsed)
        self._last = record
        since = time.monotonic() - self._repainted
        due = record.iteration % self._every == 0 or since >= _SILENCE
        if self._live is not None:
            due = since >= _REFRESH
        if due:
            self._show(record)

    def _show(self, record: Record) -> None:
        self._shown = record
        self._write("  ".join(self._words(record)), None if self._live is None else self._renderable(record))

    def _write(self, line: str, drawn: RenderableType | None) -> None:
        """A plain line, or what is drawn in its place on a terminal."""
        with self._writing, suppress(OSError):  # the terminal is closed: nobody looks, but the work goes on
            if self._live is None:
                print(line, file=self._stream, flush=True)
            else:
                self._live.update(drawn or line, refresh=True)
            self._repainted = time.monotonic()

    def _words(self, record: Record) -> list[str]:
        left = self._time_left.seconds()
        energies = (f"{_SYMBOLS.get(name, name)} {value:.6g}" for name, value in record.quantities.items())
        time_left = "" if left is None else f", at most {duration(left)} left"
        words = [f"iteration {record.iteration}/{self._max_iterations}", *energies, f"merit {record.merit:.6g}"]
        if math.isfinite(record.damping):  # the start has none
            words.append(f"damping {record.damping:.1e}" + ("" if record.accepted else " (step rejected)"))
        return [*words, f"{duration(record.elapsed)}{time_left}"]

    def _renderable(self, record: Record) -> RenderableType:
        from rich.progress_bar import ProgressBar
        from rich.table import Table
        from rich.text import Text

        line = Text("  ".join(self._words(record)))
        if self._console is None or line.cell_len + _BAR + 2 > self._console.width:
            return line  # wraps where the terminal is narrow
        row = Table.grid(padding=(0, 2))
        done = min(record.iteration, self._max_iterations)
        row.add_row(ProgressBar(total=max(1, self._max_iterations), completed=done, width=_BAR), line)
        return row
