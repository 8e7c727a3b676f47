"""Ctrl-C that waits: where it acts, that two of them get through, and that handlers are put back."""

from __future__ import annotations

import os
import signal
import threading
from collections.abc import Iterator

import pytest

from torchfair._interrupts import deferred_interrupts


def press() -> None:
    """Ctrl-C; the handler has run when this returns."""
    os.kill(os.getpid(), signal.SIGINT)


@pytest.fixture(autouse=True)
def handler_is_put_back() -> Iterator[None]:
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    after = signal.signal(signal.SIGINT, before)
    assert after is signal.default_int_handler


def test_it_waits_for_the_next_interruptible_work_which_is_not_begun() -> None:
    begun: list[int] = []
    with deferred_interrupts() as interrupts:
        press()
        assert interrupts.pending
        with pytest.raises(KeyboardInterrupt):
            interrupts.interruptible(begun.append, 1)
        assert begun == []
        assert not interrupts.pending
        interrupts.interruptible(begun.append, 2)
    assert begun == [2]


def test_within_interruptible_work_it_acts_at_once_and_waits_again_afterwards() -> None:
    seen = []

    def work() -> None:
        press()
        seen.append("too far")

    with deferred_interrupts() as interrupts:
        with pytest.raises(KeyboardInterrupt):
            interrupts.interruptible(work)
        press()
        assert interrupts.pending
    assert seen == []


def test_a_second_one_gets_through() -> None:
    with deferred_interrupts():
        press()
        with pytest.raises(KeyboardInterrupt):
            press()


def test_one_that_comes_at_the_end_is_forgotten_and_the_next_body_begins_without() -> None:
    with deferred_interrupts():
        press()
    with deferred_interrupts() as interrupts:
        interrupts.check()


def test_a_body_within_a_body_is_the_same_and_does_not_put_the_handler_back() -> None:
    with deferred_interrupts() as outer:
        with deferred_interrupts() as inner:
            assert inner is outer
        press()
        assert outer.pending


def test_a_job_within_a_callback_has_interrupts_of_its_own() -> None:
    def job() -> bool:
        with deferred_interrupts() as inner:
            press()
            return inner is not outer and inner.pending

    with deferred_interrupts() as outer:
        assert outer.interruptible(job)
        assert not outer.pending
        press()
        assert outer.pending


def test_work_that_is_insisted_on_is_done_once_more_and_the_interrupt_waits() -> None:
    calls = []

    def work(times: int) -> int:
        calls.append(times)
        if len(calls) <= times:
            raise KeyboardInterrupt
        return 7

    with deferred_interrupts() as interrupts:
        assert interrupts.insist(work, 1) == 7
        assert interrupts.pending
        calls.clear()
        with pytest.raises(KeyboardInterrupt):  # one waits already
            interrupts.insist(work, 1)
        assert len(calls) == 1
        interrupts.pending = False
        calls.clear()
        with pytest.raises(KeyboardInterrupt):
            interrupts.insist(work, 2)
        assert len(calls) == 2


def test_work_that_can_be_left_is_left_when_interrupted_in_it_or_before() -> None:
    calls: list[int] = []

    def work(interrupted: bool) -> int:
        calls.append(1)
        if interrupted:
            raise KeyboardInterrupt
        return 7

    with deferred_interrupts() as interrupts:
        assert interrupts.attempt(work, False) == 7
        assert interrupts.attempt(work, True) is None
        press()
        assert interrupts.attempt(work, False) is None
        assert len(calls) == 2
        assert not interrupts.pending


@pytest.mark.parametrize(("at", "expected"), [(0, [0, 1, 2]), (2, [0, 1]), (9, [0, 1, 2])])
def test_what_was_collected_is_kept_and_at_least_one(at: int, expected: list[int]) -> None:
    raised = []

    def items() -> Iterator[int]:
        for item in range(3):
            if item == at and not raised:
                raised.append(1)
                raise KeyboardInterrupt
            yield item

    with deferred_interrupts() as interrupts:
        assert interrupts.collect(items) == (expected, at == 2)
        assert interrupts.pending == (at == 0)


def test_handlers_of_the_program_are_left_alone() -> None:
    heard: list[int] = []
    signal.signal(signal.SIGINT, lambda number, frame: heard.append(number))
    try:
        with deferred_interrupts() as interrupts:
            press()
            assert not interrupts.pending
        press()
        assert heard == [signal.SIGINT] * 2
    finally:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def test_a_handler_set_in_interruptible_work_stays() -> None:
    with deferred_interrupts() as interrupts:
        interrupts.interruptible(signal.signal, signal.SIGINT, signal.SIG_IGN)
    assert signal.signal(signal.SIGINT, signal.default_int_handler) is signal.SIG_IGN


def test_in_another_thread_signals_go_where_they_went_and_raised_interrupts_wait() -> None:
    answers = []

    def job() -> None:
        with deferred_interrupts() as interrupts:
            answers.append(interrupts is not main)
            answers.append(signal.getsignal(signal.SIGINT) == handler)
            interrupts.pending = True
            with pytest.raises(KeyboardInterrupt):
                interrupts.interruptible(answers.append, False)

    with deferred_interrupts() as main:
        handler = signal.getsignal(signal.SIGINT)
        thread = threading.Thread(target=job)
        thread.start()
        thread.join()
        assert not main.pending
    assert answers == [True, True]


def test_errors_put_the_handler_back() -> None:
    with pytest.raises(ZeroDivisionError), deferred_interrupts() as interrupts:
        interrupts.interruptible(divmod, 1, 0)
