"""How far polygons are from planar."""

from __future__ import annotations

import torch
from torch import Tensor

from .._precision import in_single_at_least
from .._remembered import remembered
from ..topology import Topology
from ._ops import cross, dot, map_faces, norm
from .normals import DEGENERACY


@remembered
@in_single_at_least
def planarity(vertices: Tensor, topology: Topology) -> Tensor:
    r"""Relative deviation of every face from planarity: diagonal distance divided by the mean edge of the face.

    For a quad it is the distance between the lines of its two diagonals, ``|det(d1, d2, c)| / |d1 x d2|``::

        p3 ------- p2     d1 = p2 - p0
          \ d2  d1 |      d2 = p3 - p1
           \  X    |      c  = p1 - p0
        p0 ------ p1

    over the mean of its four edge lengths. For larger polygons it is the largest such distance over all runs of
    four consecutive corners, over the mean edge length of the polygon; zero for all runs means planar unless
    three consecutive corners are collinear. Triangles are planar.

    Where diagonals are parallel (to ``4 eps`` of the squared lengths around) the four corners are coplanar or
    coincide, and the distance is 0 with zero derivative.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch, F), dimensionless, >= 0; rotation- and scale-invariant. Derivatives are 0 where the deviation is
        0 (a kink), and shared between runs of equal deviation.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> import torch
        >>> from torchfair import Topology
        >>> from torchfair.geometry import planarity
        >>> vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [2, 2, 1], [0, 2, 1], [0, 4, 0], [2, 4, 0]])
        >>> topology = Topology.from_faces([[0, 1, 2, 3], [3, 2, 5, 4]])  # a ridge
        >>> planarity(vertices, topology)
        tensor([0., 0.])
        >>> vertices[0, 2] += 0.1
        >>> planarity(vertices, topology)  # distances of the diagonals
        tensor([0.0214, 0.0000])
    """
    topology.check_vertices(vertices)
    return map_faces(vertices, topology, _relative_deviation).squeeze(-1)


def _relative_deviation(corners: Tensor) -> Tensor:
    """Of polygons with corners (*batch, n, k, 3): (*batch, n, 1)."""
    size = corners.shape[-2]
    lengths = norm(corners.roll(-1, -2) - corners)
    if size == 3:
        return torch.zeros_like(lengths[..., :1])
    runs = 1 if size == 4 else size
    p0, p1, p2, p3 = (corners.roll(-shift, -2)[..., :runs, :] for shift in range(4))
    first, second = p2 - p0, p3 - p1
    normal = cross(first, second)
    area = norm(normal)
    threshold = DEGENERACY * torch.finfo(corners.dtype).eps * (lengths**2).sum(-1, keepdim=True)
    proper = area > threshold
    distance = dot(normal, p1 - p0).abs() / torch.where(proper, area, 1.0)
    deviation = torch.where(proper, distance, 0.0).amax(-1, keepdim=True)
    mean = lengths.mean(-1, keepdim=True)
    return torch.where(mean > 0, deviation / torch.where(mean > 0, mean, 1.0), 0.0)
