"""A loss that is positive where normal pyramids intersect themselves."""

from __future__ import annotations

import torch
from torch import Tensor

from .._loading import safe_to_load
from .._precision import in_single_at_least
from ..energies.base import MeshModule
from ..geometry import face_normals
from ..geometry._ops import cross, gather, norm
from ..topology import Topology
from ._groups import StarGroup, star_groups
from .arcs import arc_crossings, side_determinants


def crossing_depths(normals: Tensor) -> Tensor:
    """Depth of every crossing of the arcs of closed spherical polygons: (..., k, 3) to (..., k, k), symmetric.

    The sine of the smallest angle by which an end of one of the two arcs has to move to be taken out of the
    other: the smallest of the four distances from the ends of each arc to the great circle of the other. Zero
    where arcs do not cross, and continuous there. Differentiable, with a kink where arcs begin to touch.
    """
    determinants, _ = side_determinants(normals, 0.0)
    steps = normals.roll(-1, -2) - normals
    lengths = norm(cross(normals, steps))[..., :, None]
    crossing = arc_crossings(normals.detach())
    safe = torch.where(lengths > 0, lengths, 1.0)
    distances = determinants.abs() / safe  # of point j from the circle of arc i
    ends = torch.minimum(distances, distances.roll(-1, -1))
    return torch.where(crossing, torch.minimum(ends, ends.transpose(-1, -2)), 0.0)


def pyramid_penalty_per_vertex(vertices: Tensor, topology: Topology) -> Tensor:
    """Terms (*batch, V) of :func:`pyramid_penalty`; zero at boundary vertices and isolated ones."""
    topology.check_vertices(vertices)
    return _per_vertex(vertices, topology, star_groups(topology))


def pyramid_penalty(vertices: Tensor, topology: Topology) -> Tensor:
    """Sum over all normal pyramids and all pairs of their arcs that cross of the squared depth of the crossing.

    Zero if and only if no normal pyramid intersects itself, positive otherwise: built on the predicate that
    :func:`~torchfair.stars.pyramid_self_intersections` counts with (without its allowance for rounding of
    the coordinates). For the depth see ``crossing_depths``.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.

    Returns:
        (*batch,), at least 0, dimensionless; does not change under similarity transformations. Continuously
        differentiable where crossings appear; the gradient has jumps where another end becomes the nearest.
        Degenerate faces take part in no crossing, with zero derivatives.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).
    """
    return topology.sum_per_mesh(pyramid_penalty_per_vertex(vertices, topology), "vertices")


@safe_to_load
class PyramidPenalty(MeshModule):
    """Module form of :func:`pyramid_penalty`: ``forward(vertices)`` (*batch, V, 3) -> (*batch,).

    Example:
        >>> from torchfair.shapes import Catenoid, principal_triangles
        >>> from torchfair.stars import PyramidPenalty
        >>> mesh = principal_triangles(Catenoid(), 8, 16)
        >>> PyramidPenalty(mesh.topology)(mesh.vertices)  # no pyramid of this funnel intersects itself
        tensor(0., dtype=torch.float64)
    """

    groups: list[StarGroup]

    def _set_topology(self, topology: Topology) -> None:
        super()._set_topology(topology)
        self.groups = star_groups(topology)

    def per_vertex(self, vertices: Tensor) -> Tensor:
        """Terms (*batch, V); see :func:`pyramid_penalty_per_vertex`."""
        self.topology.check_vertices(vertices)
        return _per_vertex(vertices, self.topology, self.groups)

    def per_mesh(self, vertices: Tensor) -> Tensor:
        """Penalty (*batch,) of ``vertices`` (*batch, V, 3)."""
        return self.topology.sum_per_mesh(self.per_vertex(vertices), "vertices")


@in_single_at_least
def _per_vertex(vertices: Tensor, topology: Topology, groups: list[StarGroup]) -> Tensor:
    normals = face_normals(vertices, topology)
    total = vertices.sum(-1) * 0.0  # NaN stays NaN
    for group in groups:
        depths = crossing_depths(gather(normals, topology.corner_faces[group.corners]))
        total = total.index_add(-1, group.centres, (depths**2).sum((-2, -1)) / 2)
    return total
