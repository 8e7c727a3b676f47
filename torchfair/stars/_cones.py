"""Directions that lie strictly inside finitely many half-spaces."""

from __future__ import annotations

import torch
from torch import Tensor

_FEASIBLE = 1e-9  # rays may leave the cone by this: the sum of all rays is what is judged
_PARALLEL = 1e-12
_ROOM = 1 << 16  # rays looked at together: few enough for the cache


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
    count = walls.shape[1]
    first, second = torch.triu_indices(count, count, 1, device=walls.device)
    step = max(1, _ROOM // max(1, first.shape[0]))
    total = torch.cat([_sums_of_rays(part, first, second) for part in torch.split(walls, step)])
    size = torch.linalg.vector_norm(total, dim=-1)
    found = size > _PARALLEL
    directions = total / torch.where(found, size, 1.0)[:, None]
    margins = (walls @ directions[..., None]).squeeze(-1).amin(-1)
    return directions, torch.where(found, margins, -1.0)


def _sums_of_rays(walls: Tensor, first: Tensor, second: Tensor) -> Tensor:
    """(N, 3) sum of the extreme rays, among those on two walls ``first`` and ``second`` (p,) at once.

    Coordinates are held apart, (m, N) or (p, N) each: sums over three or a few numbers beside each other are slow.
    """
    x, y, z = (axis.contiguous() for axis in walls.permute(2, 1, 0))
    (ax, ay, az), (bx, by, bz) = ([axis.index_select(0, side) for axis in (x, y, z)] for side in (first, second))
    rays = [ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx]
    size = (rays[0] * rays[0] + rays[1] * rays[1] + rays[2] * rays[2]).sqrt()
    proper = size > _PARALLEL
    rays = [axis / torch.where(proper, size, 1.0) for axis in rays]
    low, high = torch.full_like(size, torch.inf), torch.full_like(size, -torch.inf)
    for wall in zip(x, y, z, strict=True):
        height = torch.addcmul(torch.addcmul(rays[0] * wall[0], rays[1], wall[1]), rays[2], wall[2])
        low, high = torch.minimum(low, height), torch.maximum(high, height)
    sides = ((low > -_FEASIBLE) & proper).to(walls) - ((high < _FEASIBLE) & proper).to(walls)
    return torch.stack([(sides * axis).sum(0) for axis in rays], dim=1)
