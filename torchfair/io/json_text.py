"""Python values as JSON that every reader accepts."""

from __future__ import annotations

import dataclasses
import enum
import json
import math
import os
from collections.abc import Mapping
from typing import Any


def plain(value: Any) -> Any:
    """``value`` made of dicts, lists, strings, numbers, booleans and None only.

    Numbers that are not finite become None. Tensors and arrays become nested lists (numbers if they have no
    dimension), dataclasses and mappings dicts with string keys, enum members their name, paths strings.

    Raises:
        TypeError: for anything else.
    """
    if value is None or isinstance(value, bool | str):
        return value
    if isinstance(value, enum.Enum):
        return value.name.lower()
    if isinstance(value, int):
        return int(value)
    if isinstance(value, float):
        return float(value) if math.isfinite(value) else None
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {f.name: plain(getattr(value, f.name)) for f in dataclasses.fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # tensors, arrays and their scalars
        return plain(value.tolist())
    if isinstance(value, list | tuple | set | frozenset):
        return [plain(item) for item in value]
    raise TypeError(f"cannot be written as JSON: {type(value).__name__}")


def to_json(value: Any) -> str:
    """JSON text of ``plain(value)``: sorted keys, two spaces of indentation, a line end; never NaN or Infinity."""
    return json.dumps(plain(value), indent=2, sort_keys=True, allow_nan=False) + "\n"
