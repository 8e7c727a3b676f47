"""Between tensors of points (N, 3) and the float64 columns (3, N) in which the search works."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from .._connectivity import first_few
from ..errors import MeshError, ShapeError
from ._closest_boxes import Floats, Ints

_LARGEST = 1e70  # beyond it squared areas leave the range of float64


def check_points(points: Tensor, what: str) -> None:
    """Raises ShapeError unless ``points`` is a floating tensor (N, 3). Values are not read."""
    if not isinstance(points, Tensor):
        raise ShapeError(what, "a floating tensor (N, 3)", type(points).__name__)
    if points.dim() != 2 or points.shape[1] != 3 or not points.is_floating_point():
        raise ShapeError(what, "a floating tensor (N, 3)", f"{tuple(points.shape)} {points.dtype}")


def to_columns(points: Tensor, what: str) -> Floats:
    """Checked coordinates (3, N) in float64.

    Raises:
        ShapeError: if ``points`` is not a floating tensor (N, 3).
        MeshError: if a coordinate is not finite or beyond 1e70.
    """
    check_points(points, what)
    columns: Floats = np.ascontiguousarray(points.detach().cpu().double().numpy().T)
    usable = (np.abs(columns) <= _LARGEST).all(0)  # false for NaN
    if not usable.all():
        rows = np.flatnonzero(~usable)
        named = (f"row {row} is {columns[:, row].tolist()}" for row in rows)
        raise MeshError(
            f"{what}: {rows.size} point(s) are not finite or beyond {_LARGEST:g}: {first_few(named, rows.size)}. "
            "Remove or mend them; a solver that produced them has diverged."
        )
    return columns


def to_tensor(values: Floats | Ints, like: Tensor) -> Tensor:
    """``values`` on the device of ``like``, floating ones with its dtype."""
    tensor = torch.from_numpy(np.ascontiguousarray(values))
    return tensor.to(device=like.device, dtype=like.dtype if tensor.is_floating_point() else None)
