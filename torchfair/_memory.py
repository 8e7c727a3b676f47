"""How much memory is left, and handing back what is free."""

from __future__ import annotations

import ctypes
import os
import sys
from contextlib import suppress
from pathlib import Path

_SYSTEM = Path("/proc/meminfo")
_GROUP = (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory.current"))  # of a container


def available_memory() -> int | None:
    """Bytes that can still be taken without swapping, within the limits of a container; None where nothing tells."""
    found = [value for value in (_of_system(), _of_group()) if value is not None]
    return min(found) if found else None


def hand_back_free_memory() -> None:
    """Hands memory that is free back to the system, where the C library can do that: gaps between large tensors.

    The allocator keeps freed blocks up to 32 MB for itself; after a phase of work on a large mesh these are a third of
    all memory. Takes some hundredths of a second for each gigabyte.
    """
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):  # another C library than glibc
            ctypes.CDLL(None).malloc_trim(0)


def _of_system() -> int | None:
    try:
        for line in _SYSTEM.read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return 1024 * int(line.split()[1])
    except (OSError, ValueError, IndexError):
        pass
    try:
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, ValueError, OSError):
        return None


def _of_group() -> int | None:
    try:
        most, taken = (int(path.read_text()) for path in _GROUP)
    except (OSError, ValueError):  # no container, or "max"
        return None
    return max(0, most - taken)
