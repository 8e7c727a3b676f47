"""What a command is at, said on a terminal once it takes long."""

from __future__ import annotations

import io
import threading
import time

import pytest

from torchfair.progress import phase_progress


class Terminal(io.StringIO):
    """A stream that passes for a terminal."""

    def isatty(self) -> bool:
        return True


def wait_for(stream: io.StringIO, words: str) -> None:
    deadline = time.monotonic() + 20.0
    while words not in stream.getvalue():
        assert time.monotonic() < deadline, stream.getvalue()
        time.sleep(0.01)


def test_long_work_is_named_with_its_time_and_the_line_is_cleared() -> None:
    terminal = Terminal()
    with phase_progress("judging stars", patience=0.01, stream=terminal):
        wait_for(terminal, "judging stars  0.")
    assert terminal.getvalue().endswith("\r\x1b[K")


def test_short_work_says_nothing() -> None:
    terminal = Terminal()
    with phase_progress("reading", patience=60.0, stream=terminal):
        pass
    assert terminal.getvalue() == ""


def test_logs_are_left_alone() -> None:
    stream = io.StringIO()
    with phase_progress("reading", patience=0.0, stream=stream):
        time.sleep(0.05)
    assert stream.getvalue() == ""


def test_an_interrupt_clears_the_line_and_goes_on() -> None:
    """And no thread is left behind."""
    terminal, before = Terminal(), threading.active_count()

    def interrupted() -> None:
        with phase_progress("reading", patience=0.01, stream=terminal):
            wait_for(terminal, "reading")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        interrupted()
    assert terminal.getvalue().endswith("\r\x1b[K")
    assert threading.active_count() == before


def test_a_closed_terminal_does_not_end_the_work() -> None:
    terminal = Terminal()
    done = False
    with phase_progress("reading", patience=0.0, stream=terminal):
        terminal.close()
        time.sleep(0.05)
        done = True
    assert done
