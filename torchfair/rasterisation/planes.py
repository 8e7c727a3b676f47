"""Depth of the planes of projected triangles beside pixel centres."""

from __future__ import annotations

import torch
from torch import Tensor


def plane_depths(points: Tensor, triangles: Tensor, chosen: Tensor, places: Tensor) -> tuple[Tensor, Tensor]:
    """Depth of the planes of some triangles at places on the screen, and how fast it changes per pixel.

    Depths stay within those of the corners, slopes within their difference, so that steep planes do not run away.

    Args:
        points: ``(V, 3)`` as for :func:`~torchfair.rasterisation.rasterise`.
        triangles: ``(T, 3)`` point numbers.
        chosen: ``(n,)`` numbers of triangles.
        places: ``(n, 2)`` x and y in pixels.

    Returns:
        Depths ``(n,)`` and slopes ``(n,)`` >= 0, float64, constant for autograd.
    """
    corners = points.detach()[triangles[chosen]].to(torch.float64)
    origin, a, b = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = torch.linalg.cross(a, b)
    across = normal[:, :2] / torch.where(normal[:, 2:] == 0, 1, -normal[:, 2:])
    depth = origin[:, 2] + ((places - origin[:, :2]) * across).sum(-1)
    nearest, farthest = corners[..., 2].amin(1), corners[..., 2].amax(1)
    slope = torch.minimum(torch.linalg.vector_norm(across, dim=-1), farthest - nearest)
    return torch.clamp(depth, nearest, farthest), slope
