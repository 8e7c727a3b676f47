"""Undo and redo without limit: what is frozen need not be copied, so going back is exact."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Generic, TypeVar

T = TypeVar("T")


class History(Generic[T]):
    """Frozen states one after the other, and which of them is now.

    Args:
        states: The states, oldest first; none for a history that has not begun.
        now: Which of them is now, by default the last.

    Example::

        history = History([a])
        history.push(b)
        assert history.undo() is a and history.redo() is b
    """

    def __init__(self, states: Sequence[T] = (), now: int | None = None) -> None:
        self._states = list(states)
        self._now = len(self._states) - 1 if now is None else now
        if states and not 0 <= self._now < len(states):
            raise ValueError(f"now: expected 0 to {len(states) - 1}, got {now}")

    @property
    def states(self) -> tuple[T, ...]:
        """All of them, oldest first."""
        return tuple(self._states)

    @property
    def position(self) -> int:
        """How many undos there are; -1 for a history that has not begun."""
        return self._now

    @property
    def ahead(self) -> int:
        """How many redos there are."""
        return len(self._states) - 1 - self._now

    @property
    def now(self) -> T:
        """The state that is now; LookupError before the first one."""
        if self._now < 0:
            raise LookupError("the history has not begun")
        return self._states[self._now]

    @property
    def next(self) -> T | None:
        """What redo would lead to."""
        return self._states[self._now + 1] if self.ahead else None

    def push(self, state: T) -> None:
        """Another state; what could have been redone is forgotten."""
        del self._states[self._now + 1 :]
        self._states.append(state)
        self._now += 1

    def undo(self) -> T | None:
        """One state back; None, and nothing happens, at the oldest."""
        if self._now <= 0:
            return None
        self._now -= 1
        return self.now

    def redo(self) -> T | None:
        """One state on; None, and nothing happens, at the newest."""
        if not self.ahead:
            return None
        self._now += 1
        return self.now
