"""A repr that fits on a line: shapes instead of numbers, counts instead of lists."""

from __future__ import annotations

from collections.abc import Mapping, Sized
from dataclasses import fields
from enum import Enum
from typing import Any

from torch import Tensor

_LONGEST = 60  # of a value that is shown as it is


def short_repr(self: Any) -> str:
    """The ``__repr__`` of a dataclass whose fields may be large."""
    parts = (f"{field.name}={_short(getattr(self, field.name))}" for field in fields(self) if field.repr)
    return f"{type(self).__name__}({', '.join(parts)})"


def _short(value: object) -> str:
    if isinstance(value, Tensor):
        kind = str(value.dtype).removeprefix("torch.")
        return f"{value.item():.6g}" if not value.dim() else f"<{kind} {tuple(value.shape)}>"
    if isinstance(value, Enum):
        return value.name
    words = repr(value) if not isinstance(value, Sized) or len(value) < _LONGEST else ""
    words = "" if "tensor(" in words else words
    if words and len(words) <= _LONGEST:
        return words
    if isinstance(value, Mapping):
        return f"<{len(value)} entr{'y' if len(value) == 1 else 'ies'}>"
    if isinstance(value, str):
        return repr(f"{value[: _LONGEST - 3]}...")
    kinds = {type(item).__name__ for item in value} if isinstance(value, list | tuple | set) else set()
    if kinds:
        return f"<{len(value)} {' or '.join(sorted(kinds))}>"  # type: ignore[arg-type]
    return words if len(words) <= 2 * _LONGEST and words else f"<{type(value).__name__}>"
