"""Few threads for small problems."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar

import torch

_SMALL = 60_000  # unknowns below which handing work to threads costs more than it saves
_ALLOWED: ContextVar[int | None] = ContextVar("allowed_threads", default=None)


@contextmanager
def threads_for(unknowns: int, device: torch.device) -> Iterator[None]:
    """Runs its body on one torch thread if the problem is small, then restores the number of threads.

    Element work on a few thousand elements is made of very short operations. On a machine that is busy with
    anything else, waking a second thread for each of them costs many times the operation itself.
    """
    before = torch.get_num_threads()
    small = device.type == "cpu" and unknowns < _SMALL and before > 1
    token = _ALLOWED.set(allowed_threads())
    if small:
        torch.set_num_threads(1)
    try:
        yield
    finally:
        _ALLOWED.reset(token)
        if small:
            torch.set_num_threads(before)


def allowed_threads() -> int:
    """The number of threads that the user allows torch, also within :func:`threads_for`.

    That is ``torch.get_num_threads()``, which begins as ``OMP_NUM_THREADS`` or the number of processors.
    """
    return _ALLOWED.get() or torch.get_num_threads()
