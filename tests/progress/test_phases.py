"""What a command is at, said on a terminal once it takes long."""

from __future__ import annotations

import contextlib
import io
import threading
import time

import pytest

from torchfair import TorchfairError
from torchfair.cli import main
from torchfair.progress import ProgressDisplay, phase, shown_phases


class Terminal(io.StringIO):
    """A stream that passes for a terminal."""

    def isatty(self) -> bool:
        return True


def wait_for(stream: io.StringIO, words: str) -> None:
    wait_for_more(stream, "", words)


def wait_for_more(stream: io.StringIO, before: str, words: str) -> None:
    deadline = time.monotonic() + 20.0
    while words not in stream.getvalue().removeprefix(before):
        assert time.monotonic() < deadline, stream.getvalue()
        time.sleep(0.01)


def test_long_work_is_named_with_its_time_and_the_line_is_cleared() -> None:
    terminal = Terminal()
    with shown_phases(patience=0.01, stream=terminal), phase("judging stars"):
        wait_for(terminal, "judging stars  0.")
    assert terminal.getvalue().endswith("\r\x1b[K")


def test_short_work_says_nothing() -> None:
    terminal = Terminal()
    with shown_phases(patience=60.0, stream=terminal), phase("reading"):
        pass
    assert terminal.getvalue() == ""


def test_logs_are_left_alone() -> None:
    stream = io.StringIO()
    with shown_phases(patience=0.0, stream=stream), phase("reading"):
        time.sleep(0.05)
    assert stream.getvalue() == ""


def test_an_interrupt_clears_the_line_and_goes_on() -> None:
    """And no thread is left behind."""
    terminal, before = Terminal(), threading.active_count()

    def interrupted() -> None:
        with shown_phases(patience=0.01, stream=terminal), phase("reading"):
            wait_for(terminal, "reading")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert terminal.getvalue().endswith("\r\x1b[K")
    assert threading.active_count() == before


def test_a_closed_terminal_does_not_end_the_work() -> None:
    terminal = Terminal()
    done = False
    with shown_phases(patience=0.0, stream=terminal), phase("reading"):
        terminal.close()
        time.sleep(0.05)
        done = True
    assert done


def test_a_display_within_shows_phases_in_its_place() -> None:
    """And the line comes back after it."""
    terminal, log = Terminal(), io.StringIO()
    with shown_phases(patience=0.01, stream=terminal), phase("judging stars"):
        wait_for(terminal, "judging stars")
        with ProgressDisplay(60, stream=log):
            drawn = terminal.getvalue()
            assert drawn.endswith("\r\x1b[K")
            with phase("checking"):
                time.sleep(0.05)
            assert terminal.getvalue() == drawn
        wait_for_more(terminal, drawn, "judging stars")
    assert terminal.getvalue().endswith("\r\x1b[K")


def test_commands_show_what_they_are_at(monkeypatch: pytest.MonkeyPatch) -> None:
    terminal = Terminal()

    def read(name: str, arguments: object) -> object:
        with phase(f"reading {name}"):
            wait_for(terminal, "reading roof.obj  2.")
        raise TorchfairError("read enough")

    monkeypatch.setattr("sys.stderr", terminal)
    monkeypatch.setattr("torchfair.cli.measure.read_input", read)
    assert main(["measure", "roof.obj"]) == 2
    assert terminal.getvalue().endswith("\r\x1b[Ktorchfair measure: error: read enough\n")


def test_commands_run_without_a_stderr() -> None:
    with contextlib.redirect_stderr(None), shown_phases(), phase("reading"):
        pass
