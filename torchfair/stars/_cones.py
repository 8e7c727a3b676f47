"""Directions that lie strictly inside finitely many half-spaces."""

from __future__ import annotations

import torch
from torch import Tensor

from ..geometry._ops import cross

_FEASIBLE = 1e-9  # rays may leave the cone by this: the sum of all rays is what is judged
_PARALLEL = 1e-12
_ROOM = 1 << 22  # numbers held at a time


def interior_directions(walls: Tensor) -> tuple[Tensor, Tensor]:
    """A direction well inside the cone ``{n: w.n > 0 for all walls w}``, for many cones at once.

    The closed cone is spanned by its extreme rays, each of which lies on two walls, so among the cross products
    of all pairs of walls are all of them. Their sum lies inside all half-spaces if and only if the open cone is
    not empty: this is exact, however the walls lie. It costs ``m^3`` for ``m`` walls.

    Args:
        walls: (N, m, 3) unit vectors. The cone must not contain a line.

    Returns:
        (N, 3) unit vectors, and (N,) the least of their products with the walls: the sine of the angle
        between direction and nearest wall, positive if the cone is not empty; -1 where no ray was found.
    """
    first, second = torch.triu_indices(walls.shape[1], walls.shape[1], 1, device=walls.device)
    total = torch.zeros_like(walls[:, 0])
    step = max(1, _ROOM // max(1, walls.shape[0] * walls.shape[1]))
    for start in range(0, first.shape[0], step):
        i, j = first[start : start + step], second[start : start + step]
        rays = cross(walls[:, i], walls[:, j])
        size = torch.linalg.vector_norm(rays, dim=-1)
        rays = rays / torch.where(size > _PARALLEL, size, 1.0)[..., None]
        heights = rays @ walls.transpose(1, 2)
        inside = (heights.amin(-1) > -_FEASIBLE) & (size > _PARALLEL)
        opposite = (heights.amax(-1) < _FEASIBLE) & (size > _PARALLEL)
        total = total + ((inside.to(rays) - opposite.to(rays))[..., None] * rays).sum(1)
    size = torch.linalg.vector_norm(total, dim=-1)
    found = size > _PARALLEL
    directions = total / torch.where(found, size, 1.0)[:, None]
    margins = (walls @ directions[..., None]).squeeze(-1).amin(-1)
    return directions, torch.where(found, margins, -1.0)
