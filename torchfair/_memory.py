"""How much memory is left."""

from __future__ import annotations

import os
from pathlib import Path

_SYSTEM = Path("/proc/meminfo")
_GROUP = (Path("/sys/fs/cgroup/memory.max"), Path("/sys/fs/cgroup/memory.current"))  # of a container


def available_memory() -> int | None:
    """Bytes that can still be taken without swapping, within the limits of a container; None where nothing tells."""
    found = [value for value in (_of_system(), _of_group()) if value is not None]
    return min(found) if found else None


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
