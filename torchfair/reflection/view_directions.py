"""Sets of view directions, from the eye into the scene."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ..cameras.fitting import look_axes
from ..errors import ShapeError, TorchfairError


def axis_directions(rotation: Tensor | None = None) -> Tensor:
    """The six directions ``+x, +y, +z, -x, -y, -z`` as rows (6, 3), float64, turned by ``rotation`` (3, 3) if given.

    The mean of a quadratic form over them is its mean over the whole sphere: they are a spherical 2-design.
    """
    axes = torch.eye(3, dtype=torch.float64) if rotation is None else rotation.T
    return torch.cat([axes, -axes])


def cone_directions(axis: Tensor, angle: float, count: int) -> Tensor:
    """``count`` unit directions ``(count, 3)`` spread evenly over the cone about ``axis`` (3,), the first one along it.

    They lie on a spiral with equal areas between them, the same at every call.

    Args:
        axis: (3,) of any length but zero.
        angle: half the opening of the cone in degrees, 0 to 180 (the sphere).
        count: number of directions, at least 1.

    Raises:
        ShapeError: if ``axis`` is not (3,) or ``count`` below 1.
        TorchfairError: if ``axis`` is zero or ``angle`` not within 0 to 180.
    """
    right, up, forward = _frame(axis, count)
    if not 0 <= angle <= 180:
        raise TorchfairError(f"angle must be within 0 to 180 degrees, got {angle}")
    number = torch.arange(count, dtype=torch.float64)
    height = 1 - (1 - math.cos(math.radians(angle))) * number / max(count - 1, 1)
    turn = number * (math.pi * (3 - math.sqrt(5)))  # the golden angle
    reach = (1 - height**2).clamp(min=0).sqrt()
    across = reach * torch.cos(turn), reach * torch.sin(turn)
    return torch.nn.functional.normalize(
        across[0][:, None] * right + across[1][:, None] * up + height[:, None] * forward, dim=-1
    )


def ring_directions(axis: Tensor, elevation: float, count: int) -> Tensor:
    """``count`` unit directions ``(count, 3)`` evenly round an upward ``axis``, as a turntable shows an object.

    Args:
        axis: (3,) the axis of the turntable, upwards, of any length but zero.
        elevation: of the eye above the horizon in degrees, -90 to 90; the directions point down by as much.
        count: number of directions, at least 1.

    Raises:
        ShapeError: if ``axis`` is not (3,) or ``count`` below 1.
        TorchfairError: if ``axis`` is zero or ``elevation`` not within -90 to 90.
    """
    right, up, forward = _frame(axis, count)
    if not -90 <= elevation <= 90:
        raise TorchfairError(f"elevation must be within -90 to 90 degrees, got {elevation}")
    turn = torch.arange(count, dtype=torch.float64)[:, None] * (2 * math.pi / count)
    level = torch.cos(turn) * right + torch.sin(turn) * up
    return math.cos(math.radians(elevation)) * level - math.sin(math.radians(elevation)) * forward


def _frame(axis: Tensor, count: int) -> tuple[Tensor, Tensor, Tensor]:
    axis = torch.as_tensor(axis).detach().to(torch.float64)
    if axis.shape != (3,):
        raise ShapeError("axis", "(3,)", tuple(axis.shape))
    if count < 1:
        raise ShapeError("count", "at least 1", count)
    if not bool(torch.linalg.vector_norm(axis) > 0):
        raise TorchfairError("axis must be a finite direction that is not zero")
    right, up, forward = look_axes(axis[None], torch.zeros(1, 3, dtype=torch.float64))[0].unbind(0)
    return right, up, forward
