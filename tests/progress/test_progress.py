from __future__ import annotations

import io
import math
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field
from types import SimpleNamespace

import pytest
from rich.console import Console

from torchfair.progress import ProgressDisplay, TimeLeft, duration, listening, phase
from torchfair.progress import display as progress


@dataclass
class Step:
    iteration: int
    merit: float = 2.5
    damping: float = 0.01
    accepted: bool = True
    elapsed: float = 0.0
    quantities: dict[str, float] = field(default_factory=lambda: {"normal_variation": 121.3})


def run(display: ProgressDisplay, last: int) -> None:
    with display:
        for iteration in range(last + 1):
            assert display(Step(iteration, elapsed=0.5 * iteration)) is None


class Flushing(io.StringIO):
    """A pipe that remembers what had been written at every flush."""

    def __init__(self) -> None:
        super().__init__()
        self.flushed = ""

    def flush(self) -> None:
        self.flushed = self.getvalue()


def test_plain_lines_come_every_kth_iteration_and_at_the_end() -> None:
    stream = Flushing()
    run(ProgressDisplay(60, stream=stream, every=4), 10)
    lines = stream.flushed.splitlines()
    assert [line.split()[1] for line in lines] == ["0/60", "4/60", "8/60", "10/60"]
    assert stream.flushed == stream.getvalue()
    assert "\x1b" not in stream.getvalue()


def test_the_last_line_is_not_repeated() -> None:
    stream = Flushing()
    run(ProgressDisplay(60, stream=stream, every=5), 10)
    assert [line.split()[1] for line in stream.flushed.splitlines()] == ["0/60", "5/60", "10/60"]


class Closed(io.StringIO):
    """A terminal that is gone."""

    def __init__(self, *, terminal: bool) -> None:
        super().__init__()
        self.terminal, self.open = terminal, True

    def isatty(self) -> bool:
        return self.terminal

    def write(self, text: str) -> int:
        if not self.open:
            raise OSError(5, "Input/output error")
        return super().write(text)


@pytest.mark.parametrize("terminal", [False, True])
def test_work_goes_on_where_nobody_can_look_any_more(terminal: bool) -> None:
    stream = Closed(terminal=terminal)
    with ProgressDisplay(3, stream=stream, every=1) as display:
        display(Step(0))
        stream.open = False
        display._repainted = -math.inf
        display(Step(1, elapsed=1.0))
        display(Step(2, elapsed=2.0))
    assert "1/3" not in stream.getvalue()


def test_about_twenty_plain_lines_by_default() -> None:
    for iterations in (20, 60, 1000):
        stream = Flushing()
        run(ProgressDisplay(iterations, stream=stream), iterations)
        assert 15 <= len(stream.getvalue().splitlines()) <= 25


def test_plain_line_says_all() -> None:
    stream = Flushing()
    with ProgressDisplay(60, stream=stream, every=1) as display:
        display(Step(10, elapsed=1.0))
        display(Step(11, elapsed=1.5, accepted=False))
    expected = "iteration 11/60  E 121.3  merit 2.5  damping 1.0e-02 (step rejected)  1.5 s, at most 24 s left"
    assert stream.flushed.splitlines()[1] == expected


def test_the_start_has_no_damping() -> None:
    stream = Flushing()
    with ProgressDisplay(60, stream=stream, every=1) as display:
        display(Step(0, damping=math.nan))
    assert stream.flushed == "iteration 0/60  E 121.3  merit 2.5  0.0 s\n"


def test_nothing_happens_without_records() -> None:
    stream = Flushing()
    run(ProgressDisplay(5, stream=stream), -1)
    assert stream.getvalue() == ""


def text_of(console: Console) -> str:
    assert isinstance(console.file, io.StringIO)
    return console.file.getvalue()


def terminal(width: int = 120) -> Console:
    return Console(force_terminal=True, file=io.StringIO(), width=width, color_system=None, legacy_windows=False)


def test_terminal_redraws_one_line_in_place(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "_REFRESH", 0.0)
    console = terminal()
    run(ProgressDisplay(60, console=console), 3)
    written = text_of(console)
    for iteration in range(4):
        assert f"iteration {iteration}/60" in written
    assert "E 121.3" in written
    assert "at most 28 s left" in written
    assert written.count("\n") == 1  # only when it is over
    assert written.count("\x1b[2K") >= 3  # the line was erased and written again
    assert written.rstrip().endswith("\x1b[?25h")  # the cursor is back


def test_terminal_is_repainted_seldom_but_shows_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress.time, "monotonic", lambda: 1000.0)
    console = terminal()
    run(ProgressDisplay(60, console=console), 50)
    written = text_of(console)
    assert "iteration 0/60" in written
    assert "iteration 25/60" not in written
    assert "iteration 50/60" in written


def test_narrow_terminals_lose_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "_REFRESH", 0.0)
    console = terminal(width=40)
    run(ProgressDisplay(60, console=console), 3)
    words = text_of(console).split()
    assert "damping" in words
    assert "121.3" in words


def test_cursor_returns_after_an_interruption() -> None:
    console = terminal()

    def interrupted() -> None:
        with ProgressDisplay(60, console=console) as display:
            display(Step(0))
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert text_of(console).rstrip().endswith("\x1b[?25h")


def test_a_console_that_is_no_terminal_gets_plain_lines() -> None:
    console = Console(force_terminal=False, file=io.StringIO())
    run(ProgressDisplay(60, console=console, every=1), 2)
    lines = text_of(console).splitlines()
    assert [line.split()[1] for line in lines] == ["0/60", "1/60", "2/60"]


def test_time_left_is_the_recent_pace_times_what_is_left() -> None:
    estimate = TimeLeft(100)
    assert estimate.seconds() is None
    estimate.observe(0, 0.0)
    assert estimate.seconds() is None
    estimate.observe(1, 50.0)  # a slow start is forgotten after ten more iterations
    for iteration in range(2, 21):
        estimate.observe(iteration, 50.0 + 0.5 * (iteration - 1))
    assert estimate.seconds() == pytest.approx(0.5 * 80)
    estimate.observe(0, 0.0)  # a second solve
    assert estimate.seconds() is None
    estimate.observe(2, 3.0)
    assert estimate.seconds() == pytest.approx(1.5 * 98)


def test_time_left_ends_at_zero() -> None:
    estimate = TimeLeft(3)
    for iteration in range(6):
        estimate.observe(iteration, 1.0 * iteration)
    assert estimate.seconds() == 0.0


@pytest.mark.parametrize(
    ("seconds", "words"),
    [(0.04, "0.0 s"), (9.94, "9.9 s"), (9.96, "10 s"), (59.6, "1 min 00 s"), (185, "3 min 05 s"), (7620, "2 h 07 min")],
)
def test_durations_in_words(seconds: float, words: str) -> None:
    assert duration(seconds) == words


def test_a_phase_is_named_once_it_takes_long(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "PATIENCE", 0.05)
    stream = Flushing()
    with ProgressDisplay(60, stream=stream):
        with phase("short"):
            pass
        with phase("long"):
            until(lambda: "long" in stream.flushed)
            with phase("inner"):
                until(lambda: "inner" in stream.flushed)
            until(lambda: stream.flushed.count("long") == 2)
    assert stream.flushed.splitlines() == ["long ...", "inner ...", "long ..."]


def until(holds: Callable[[], bool]) -> None:
    """Waits, for so long that only a display that never writes fails."""
    end = time.monotonic() + 20.0
    while not holds() and time.monotonic() < end:
        time.sleep(0.01)
    assert holds()


def test_nothing_is_named_after_the_end(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(progress, "PATIENCE", 0.05)
    stream = Flushing()
    before = threading.active_count()
    with suppress(KeyboardInterrupt), ProgressDisplay(60, stream=stream), phase("interrupted"):
        raise KeyboardInterrupt
    until(lambda: threading.active_count() <= before)
    time.sleep(0.1)
    assert stream.getvalue() == ""


def test_phases_are_told_to_those_who_listen_inner_ones_first() -> None:
    told: list[str] = []
    with phase("unheard"), listening(told.append):
        with phase("one"), phase("two"):
            pass
        with suppress(ValueError), phase("three"):
            raise ValueError
    with phase("unheard"):
        pass
    assert told == ["one", "two", "one", "unheard", "three", "unheard"]


def test_other_threads_have_phases_of_their_own() -> None:
    told: list[str] = []

    def work() -> None:
        with phase("elsewhere"):
            pass

    with listening(told.append):
        thread = threading.Thread(target=work)
        thread.start()
        thread.join()
    assert not told


def test_a_log_is_not_silent_for_long(monkeypatch: pytest.MonkeyPatch) -> None:
    now = [0.0]
    monkeypatch.setattr(progress, "time", SimpleNamespace(monotonic=lambda: now[0]))
    stream = Flushing()
    with ProgressDisplay(60, stream=stream, every=30) as display:
        for iteration in range(12):
            now[0] += 4.0
            display(Step(iteration))
    assert [line.split()[1] for line in stream.flushed.splitlines()] == ["0/60", "3/60", "6/60", "9/60", "11/60"]
