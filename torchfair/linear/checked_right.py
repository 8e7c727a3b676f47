"""Right-hand sides as they must be."""

from __future__ import annotations

from torch import Tensor

from .._shown import shown
from ..errors import ShapeError


def check_right(right: object, size: int) -> None:
    """Raises ShapeError unless ``right`` is a dense tensor of floating numbers, (N,) or (N, k), for N unknowns."""
    fits = isinstance(right, Tensor) and right.ndim in (1, 2) and right.shape[0] == size
    if not fits or not isinstance(right, Tensor) or not right.is_floating_point() or right.is_sparse:
        what = f"a tensor of floating numbers ({size},) or ({size}, k), as the matrix is ({size}, {size})"
        raise ShapeError("right-hand side", what, shown(right))
