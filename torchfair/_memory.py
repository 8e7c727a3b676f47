"""How much memory is left, and what becomes of memory that is freed."""

from __future__ import annotations

import ctypes
import os
import sys
from contextlib import suppress
from pathlib import Path

_LARGE = 300_000  # unknowns
_MMAP_THRESHOLD, _TRIM_THRESHOLD, _ARENA_MAX = -3, -1, -8  # numbers of parameters in malloc.h of the GNU C library
_KEPT = 1 << 26  # bytes: larger pieces are given back, or holes that nothing fits into would double the peak
_SYSTEM = Path("/proc/meminfo")
_GROUP = (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory.current"))  # of a container


def available_memory() -> int | None:
    """Bytes that can still be taken without swapping, within the limits of a container; None where nothing tells."""
    found = [value for value in (_of_system(), _of_group()) if value is not None]
    return min(found) if found else None


def hand_back_free_memory(unknowns: int) -> None:
    """Hands memory that is free back to the system, where a problem is large and the C library can do that.

    The allocator keeps freed blocks up to 32 MB for itself, gaps between large tensors; after a phase of work on a
    large mesh these are a third of all memory. Takes some hundredths of a second for each gigabyte.
    """
    if unknowns >= _LARGE:
        _of_c_library("malloc_trim", 0)


def keep_freed_memory() -> bool:
    """Lets this process keep the memory that it frees; whether that is possible here.

    The GNU C library takes large tensors from the system one by one and gives them back when they are freed, and the
    system fills every page with zeros when it is taken again: a third of the time of a command that makes hundreds of
    tensors of a million rows. Memory is then given back at the end only, so this is for processes that do one thing
    and end. Nothing happens on other systems.
    """
    kept = _of_c_library("mallopt", _MMAP_THRESHOLD, _KEPT)
    _of_c_library("mallopt", _ARENA_MAX, 1)  # else each thread keeps memory of its own
    return bool(kept) and bool(_of_c_library("mallopt", _TRIM_THRESHOLD, -1))


def _of_c_library(function: str, *arguments: int) -> int:
    """What a function of the GNU C library gives; 0 where there is another library."""
    if sys.platform == "linux":
        with suppress(OSError, AttributeError):
            return int(getattr(ctypes.CDLL(None), function)(*arguments))
    return 0


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
