"""Memory that is freed and soon wanted again."""

from __future__ import annotations

import ctypes
import sys
from contextlib import suppress

_MMAP_THRESHOLD, _TRIM_THRESHOLD = -3, -1  # numbers of parameters in malloc.h of the GNU C library
_LARGEST = 1 << 26  # bytes: larger pieces are given back, or holes that nothing fits into would double the peak


def keep_freed_memory() -> bool:
    """Lets this process keep the memory that it frees; whether that is possible here.

    The GNU C library takes large tensors from the system one by one and gives them back when they are freed, and the
    system fills every page with zeros when it is taken again: a third of the time of a command that makes hundreds of
    tensors of a million rows. Memory is then given back at the end only, so this is for processes that do one thing
    and end. Nothing happens on other systems.
    """
    if not sys.platform.startswith("linux"):
        return False
    with suppress(OSError, AttributeError):  # another C library
        mallopt = ctypes.CDLL(None).mallopt
        return bool(mallopt(_MMAP_THRESHOLD, _LARGEST)) and bool(mallopt(_TRIM_THRESHOLD, -1))
    return False
