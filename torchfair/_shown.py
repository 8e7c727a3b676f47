"""What was given, in the words of an error."""

from __future__ import annotations

from collections.abc import Sized
from numbers import Number

import numpy as np
from torch import Tensor


def shown(value: object) -> str:
    """Shape, dtype and, where it matters, device of a tensor; the type of most other things, with what mends it."""
    if isinstance(value, Tensor):
        place = "" if value.device.type == "cpu" else f" on {value.device}"
        return f"{tuple(value.shape)} {value.dtype}{place}"
    if isinstance(value, np.ndarray):
        return f"a NumPy array {value.shape} {value.dtype} (torch.as_tensor makes a tensor of it)"
    if value is None or isinstance(value, str | Number | type):
        return repr(value)
    if isinstance(value, Sized) and not len(value):
        return f"an empty {type(value).__name__}"
    name = type(value).__name__
    return f"{'an' if name[0] in 'AEIOU' else 'a'} {name}"
