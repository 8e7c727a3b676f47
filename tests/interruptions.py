"""Interrupts at the n-th call of a function: raised in it, or by the signal of Ctrl-C."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable
from typing import Any

import pytest


def stop() -> None:
    """An interrupt that a function raises."""
    raise KeyboardInterrupt


def press() -> None:
    """Ctrl-C; the handler has run when this returns."""
    os.kill(os.getpid(), signal.SIGINT)


WAYS = pytest.mark.parametrize("act", [stop, press])


def nth(function: Callable[..., Any], n: int, act: Callable[[], None], *, after: bool = False) -> Callable[..., Any]:
    """The function, with ``act()`` before or after its n-th call."""
    calls: list[int] = []

    def wrapped(*arguments: Any, **named: Any) -> Any:
        calls.append(1)
        if len(calls) == n and not after:
            act()
        value = function(*arguments, **named)
        if len(calls) == n and after:
            act()
        return value

    return wrapped
