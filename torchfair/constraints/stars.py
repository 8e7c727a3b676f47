"""Vertex stars become good saddles, normal pyramids free of self-intersections."""

from __future__ import annotations

from functools import partial

import torch
from torch import Tensor

from ..projection import ElementTerm
from ..projection.layout import State
from ..stars._saddle_targets import saddle_planes, saddle_sides, star_shape
from ..stars.pyramid_penalty import crossing_depths
from ..stars.saddle_penalty import saddle_defects, saddle_groups
from ..topology import Topology
from ._indexed import IndexedModule
from .base import Constraint
from .star_stencils import closed_star_stencils


def star_crossings(x: Tensor) -> Tensor:
    """Depths of the crossings in the normal pyramid of a star: ``x`` (k+1, 3), centre first, to (k (k-3) / 2,)."""
    depths = crossing_depths(star_shape(x[1:] - x[0]).sectors)
    size = depths.shape[0]
    rows = [depths[arc, arc + 2 :] for arc in range(1, size - 2)]  # neighbouring arcs do not cross
    return torch.cat([depths[0, 2:-1], *rows])  # the last arc is a neighbour of the first


def pyramid_terms(topology: Topology, *, weight: float, block: str = "vertices") -> list[ElementTerm]:
    """Depths of the self-intersections of all normal pyramids; zero, and silent, where there are none.

    The normals are those of the sectors between neighbouring edges: of the faces, where these are planar. The weight
    multiplies half the squares.
    """
    terms = []
    for stencil in closed_star_stencils(topology):
        if stencil.shape[1] > 4:  # three edges make a triangle, which does not cross itself
            terms.append(ElementTerm("pyramids", star_crossings, [(block, stencil)], weight=weight))
    return terms


def saddle_terms(
    vertices: Tensor,
    topology: Topology,
    saddles: Tensor,
    *,
    weight: float,
    margin: float = 0.0,
    block: str = "vertices",
) -> list[ElementTerm]:
    """Amounts by which the stars of ``saddles`` miss being good saddles; zero, and silent, for good ones.

    Which edges shall be above the plane and which below is decided for ``vertices`` and kept, so that the merit is
    continuous; make the terms anew to decide again. The planes follow the state.

    Args:
        vertices: (V, 3), the start.
        topology: Any polygon mesh.
        saddles: (V,) bool, inner vertices with 4 to 16 edges.
        weight: Of half the squares; dimensionless.
        margin: Sine of the angle by which bends and sides of edges have to be clear of zero. With 0 the solver
            stops at the border, where rounding decides.
        block: Name of the vertex block.

    Raises:
        MeshError: a chosen vertex cannot be a saddle.
    """
    terms, miss = [], partial(saddle_miss, margin=margin)
    for group in saddle_groups(topology, saddles):
        stencil = torch.cat([group.centres[:, None], group.ring], dim=1)
        sides = saddle_sides(_arms(vertices.detach(), stencil), group.patterns)
        refresh = _Planes(block, stencil, sides, margin)
        terms.append(ElementTerm("good saddles", miss, [(block, stencil)], weight=weight, refresh=refresh))
    return terms


def _arms(vertices: Tensor, stencil: Tensor) -> Tensor:
    """Arms (n, k, 3) of stars given as (n, k + 1) vertex numbers, centre first."""
    stars = vertices[stencil]
    return stars[:, 1:] - stars[:, :1]


def saddle_miss(x: Tensor, sides: Tensor, normal: Tensor, *, margin: float) -> Tensor:
    """By how much a star ``x`` (1 + k, 3) misses being a good saddle with a given plane."""
    return saddle_defects(x[1:] - x[0], sides, normal, margin)


class _Planes(IndexedModule):
    """Sides of the edges of stars, and planes that follow the state."""

    sides: Tensor

    def __init__(self, block: str, stencil: Tensor, sides: Tensor, margin: float) -> None:
        super().__init__(stencil)
        self.block, self.margin = block, margin
        self.register_buffer("sides", sides)

    def forward(self, state: State) -> tuple[Tensor, Tensor]:
        points = state[self.block]
        sides = self.sides.to(points.dtype)
        return sides, saddle_planes(_arms(points, self.indices[0]), sides, self.margin)


class NormalPyramids(Constraint):
    """Module form of :func:`pyramid_terms`: half the sum of squared depths of crossings, dimensionless.

    Half of :class:`~torchfair.stars.PyramidPenalty` where faces are planar.

    Args:
        topology: Any polygon mesh.

    Example:
        >>> import torch
        >>> from torchfair.constraints import NormalPyramids
        >>> from torchfair.shapes import Catenoid, principal_triangles
        >>> mesh = principal_triangles(Catenoid(), 8, 16)
        >>> constraint = NormalPyramids(mesh.topology)
        >>> constraint(mesh.vertices)
        tensor(0., dtype=torch.float64)
    """

    def __init__(self, topology: Topology) -> None:
        super().__init__(pyramid_terms(topology, weight=1.0))


class GoodSaddles(Constraint):
    """Module form of :func:`saddle_terms`: half the sum of squares by which stars miss it, dimensionless.

    Sides are decided at given vertices and kept. Planes follow the vertices of each member of a batch and are constant
    for derivatives.

    Args:
        vertices: (V, 3) where sides are decided.
        topology: Any polygon mesh.
        saddles: (V,) bool, inner vertices with 4 to 16 edges.
        margin: As of :func:`saddle_terms`.

    Example:
        >>> import torch
        >>> from torchfair.constraints import GoodSaddles
        >>> from torchfair.shapes import Catenoid, principal_triangles
        >>> mesh = principal_triangles(Catenoid(), 8, 16)
        >>> constraint = GoodSaddles(mesh.vertices, mesh.topology, ~mesh.topology.is_boundary_vertex)
        >>> constraint(mesh.vertices)
        tensor(0., dtype=torch.float64)
    """

    def __init__(self, vertices: Tensor, topology: Topology, saddles: Tensor, *, margin: float = 0.0) -> None:
        super().__init__(saddle_terms(vertices, topology, saddles, weight=1.0, margin=margin))
