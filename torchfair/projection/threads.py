"""Few threads for small problems."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import torch

_SMALL = 60_000  # unknowns below which handing work to threads costs more than it saves


@contextmanager
def threads_for(unknowns: int, device: torch.device) -> Iterator[None]:
    """Runs its body on one torch thread if the problem is small, then restores the number of threads.

    Element work on a few thousand elements is made of very short operations. On a machine that is busy with
    anything else, waking a second thread for each of them costs many times the operation itself.
    """
    before = torch.get_num_threads()
    small = device.type == "cpu" and unknowns < _SMALL and before > 1
    if small:
        torch.set_num_threads(1)
    try:
        yield
    finally:
        if small:
            torch.set_num_threads(before)
