"""Which arcs of a closed polygon on the unit sphere cross."""

from __future__ import annotations

import torch
from torch import Tensor

from ..geometry._ops import cross


def arc_crossings(points: Tensor, noise: Tensor | float = 0.0) -> Tensor:
    """Which pairs of arcs of closed spherical polygons cross in inner points of both.

    Arc ``i`` is the shorter great-circle arc from point ``i`` to point ``i + 1``. Arcs ``ab`` and ``cd`` cross if
    and only if ``-det(a, b, c)``, ``det(a, b, d)``, ``det(c, d, a)`` and ``-det(c, d, b)`` all have one sign: the
    ends of each lie on different sides of the other, and not on the far side of the sphere.

    A determinant that rounding could have made is taken for zero, and then the arcs touch at most: this is the
    answer for arcs with a common end, coincident points (arcs without length), three points on a great circle,
    arcs that overlap, and opposite points, which no shorter arc joins. Zero points (normals of degenerate faces)
    take part in no crossing.

    Args:
        points: (..., k, 3) unit vectors.
        noise: (...,) or a number, angle by which each point may be wrong. Rounding of the points
            themselves is allowed for anyway.

    Returns:
        (..., k, k) bool, symmetric, false on the diagonal: arc ``i`` crosses arc ``j``.
    """
    signs = side_signs(points, noise)
    ahead = signs.roll(-1, -1)  # side of the end of arc j, seen from arc i
    back, back_ahead = signs.transpose(-1, -2), ahead.transpose(-1, -2)
    crossing: Tensor = (signs != 0) & (ahead == -signs) & (back == ahead) & (back_ahead == -back)
    return crossing


def side_signs(points: Tensor, noise: Tensor | float) -> Tensor:
    """(..., k, k) sign of ``det(p_i, p_(i+1), p_j)``: the side of arc ``i`` where point ``j`` is, 0 if in doubt."""
    determinants, doubt = side_determinants(points, noise)
    return torch.where(determinants.abs() > doubt, determinants.sign(), 0.0).to(torch.int8)


def side_determinants(points: Tensor, noise: Tensor | float) -> tuple[Tensor, Tensor]:
    """(..., k, k) ``det(p_i, p_(i+1), p_j)``, exactly 0 for ``j`` in (i, i+1), and bounds of their errors.

    Computed from differences of points: the polygons of fine meshes are tiny, and products of the points
    themselves would lose all digits.
    """
    steps = points.roll(-1, -2) - points
    # Coordinates are held apart: sums over three numbers beside each other are slow.
    offsets = [axis[..., None, :] - axis[..., :, None] for axis in points.unbind(-1)]
    products = [side[..., None] * offset for side, offset in zip(cross(points, steps).unbind(-1), offsets, strict=True)]
    determinants = products[0] + products[1] + products[2]
    size = points.shape[-2]
    index = torch.arange(size, device=points.device)
    own = (index[:, None] == index) | ((index[:, None] + 1) % size == index)
    determinants = torch.where(own, 0.0, determinants)
    if isinstance(noise, Tensor):  # a number is not made a tensor, which would have to be copied to the device
        noise = noise.to(points)[..., None, None]
    noise = noise + 8 * torch.finfo(points.dtype).eps
    lengths = torch.linalg.vector_norm(steps.detach(), dim=-1)[..., :, None]
    squares = [offset.detach().square() for offset in offsets]
    distances = (squares[0] + squares[1] + squares[2]).sqrt()
    # A point that moves changes the determinant by the distance of the two others, to first order.
    return determinants, noise * (lengths + distances + distances.roll(-1, -2) + 4 * noise)
