"""Principal directions from tangential operators that have them exchanged."""

from __future__ import annotations

import torch
from torch import Tensor

from ._ops import norm


def principal_frames(plane: Tensor, bases: Tensor, least: Tensor | float = 0.0) -> Tensor:
    """Unit directions ``d1, d2`` (..., 2, 3) from operators (..., 2, 2) in the ``bases`` (..., 2, 3).

    In the operators the eigenvector of the larger value is ``d2``, as in the normal cycle. With ``d1 = d2 x n`` the
    frame is right-handed. Where the eigenvalues agree up to rounding, or differ by no more than twice ``least``, it is
    the basis itself.
    """
    angle = _eigen_angle(plane, least)[..., None]
    cosine, sine = angle.cos(), angle.sin()
    first, second = bases.unbind(-2)
    return torch.stack([sine * first - cosine * second, cosine * first + sine * second], dim=-2)


def _eigen_angle(plane: Tensor, least: Tensor | float) -> Tensor:
    """Angle from the first basis vector to the eigenvector of the larger eigenvalue, pi/2 if they agree: (...)."""
    size = plane.detach().abs().amax((-2, -1))
    scaled = plane / torch.where(size > 0, size, 1.0)[..., None, None]  # squares of tiny entries would underflow
    x, y = (scaled[..., 0, 0] - scaled[..., 1, 1]) / 2, scaled[..., 0, 1]
    half = norm(torch.stack([x, y], dim=-1).detach())
    agree = (half <= 64 * torch.finfo(plane.dtype).eps) | (half * size <= least)
    return torch.atan2(torch.where(agree, 0.0, y), torch.where(agree, -1.0, x)) / 2
