"""What cameras are made of, checked."""

from __future__ import annotations

import math
from dataclasses import fields

import torch
from torch import Tensor

from ..errors import ShapeError, TorchfairError
from .camera import Camera


def camera_rows(name: str, given: Tensor, views: int | None = None) -> Tensor:
    """``given`` as a finite float64 tensor (views, 3)."""
    rows = torch.as_tensor(given).detach().to(torch.float64)
    rows = rows[None] if rows.ndim == 1 else rows
    wanted = "(views, 3)" if views is None else f"({views}, 3)"
    if rows.ndim != 2 or rows.shape[1] != 3 or rows.shape[0] < 1 or rows.shape[0] not in (views or rows.shape[0], 1):
        raise ShapeError(name, f"{wanted} or (3,)", tuple(rows.shape))
    if not bool(torch.isfinite(rows).all()):
        raise TorchfairError(f"{name} must be finite")
    return rows.expand(views or rows.shape[0], 3)


def unit_directions(directions: Tensor) -> Tensor:
    """``directions`` (views, 3) made unit vectors, which they must be long enough for."""
    lengths = torch.linalg.vector_norm(directions, dim=-1, keepdim=True)
    if not bool((lengths > 0).all()):
        raise TorchfairError("a view needs a direction that is not zero: the eye must not be at its target")
    units: Tensor = directions / lengths
    return units


def positive_numbers(name: str, given: Tensor | float, views: int) -> Tensor:
    """``given`` as float64 numbers (views,), all of them positive and finite."""
    numbers = torch.as_tensor(given, dtype=torch.float64).detach()
    if numbers.shape not in ((), (1,), (views,)):
        raise ShapeError(name, f"one number or ({views},)", tuple(numbers.shape))
    if not bool(((numbers > 0) & (numbers < math.inf)).all()):
        raise TorchfairError(f"{name} must be positive and finite")
    return numbers.expand(views)


def fill_attributes(camera: Camera, **values: Tensor) -> None:
    """Sets the attributes of a frozen camera."""
    for field in fields(camera):
        object.__setattr__(camera, field.name, values[field.name])
