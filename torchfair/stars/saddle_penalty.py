"""A loss that is positive where stars are not good saddles."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from .._loading import safe_to_load
from .._precision import in_single_at_least
from ..energies.base import MeshModule, Reduction
from ..errors import MeshError, ShapeError
from ..geometry._ops import dot, gather
from ..geometry._unit import in_their_units
from ..topology import Topology
from ._groups import star_groups
from ._saddle_targets import LEAST_EDGES, MOST_TARGET_EDGES, good_patterns, saddle_planes, saddle_sides, star_shape


@safe_to_load
class SaddleGroup(NamedTuple):
    """Stars with equally many edges that should be good saddles.

    Attributes:
        centres: (n,) vertex numbers.
        ring: (n, k) neighbours, counterclockwise.
        patterns: (P, k) sides that their edges may have.
    """

    centres: Tensor
    ring: Tensor
    patterns: Tensor


def saddle_defects(arms: Tensor, sides: Tensor, normals: Tensor, margin: float = 0.0) -> Tensor:
    """By how much stars miss being good saddles with given sides and plane: (..., k, 3) to (..., 3 k), at least 0.

    A star is a good saddle if every edge above the plane is convex, every edge below is concave, and the star
    projects 1-1. The residuals are the amounts (sines of angles) by which the bends of the edges, the sides of
    the edges and the sectors fall short of ``margin``. Differentiable in ``arms``.
    """
    shape = star_shape(arms)
    axis = normals[..., None, :]
    values = (sides * shape.bends, sides * dot(shape.arms, axis), dot(shape.sectors, axis))
    return (margin - torch.cat(values, dim=-1)).clamp_min(0.0)


def saddle_penalty_per_vertex(vertices: Tensor, topology: Topology, saddles: Tensor | None = None) -> Tensor:
    """Terms (*batch, V), zero at vertices that need not be saddles; see :func:`saddle_penalty`."""
    return _per_vertex(vertices, topology, saddle_groups(topology, saddles))


def saddle_penalty(vertices: Tensor, topology: Topology, saddles: Tensor | None = None) -> Tensor:
    """Sum over stars of the squared amounts by which they miss being good saddles.

    Zero if every chosen star is a good saddle as :func:`~torchfair.stars.classify_stars` defines it, positive if
    one is not; stars on the border between the two, such as flat ones, count zero. For each star the sides on
    which edges belong are chosen at every call, exactly for good saddles and by the least violation for others, and
    the plane is the one with the least penalty, so that it may be held constant for first derivatives; see
    ``saddle_defects`` for what is summed. Of stars that noise of a quarter of an edge has torn, about one in a thousand
    has another plane than that, and first derivatives that are some per cent off.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed (stars are made of the sectors between neighbouring edges).
        saddles: (V,) bool, the vertices that should be good saddles: inner ones with 4 to 16 edges. By default all
            of these; where the surface is not negatively curved that is hardly wanted.

    Returns:
        (*batch,), at least 0, dimensionless; does not change under similarity transformations. It jumps where
        another pattern of sides becomes the nearest. Sectors without area and edges without length
        contribute zero derivatives.

    Raises:
        ShapeError: if ``vertices`` or ``saddles`` has the wrong shape or dtype.
        MeshError: if a chosen vertex lies on the boundary or has fewer than 4 or more than 16 edges.
    """
    return topology.sum_per_mesh(saddle_penalty_per_vertex(vertices, topology, saddles), "vertices")


@safe_to_load
class SaddlePenalty(MeshModule):
    """Module form of :func:`saddle_penalty`: ``forward(vertices)`` (*batch, V, 3) -> (*batch,).

    Args:
        topology: connectivity of all meshes that the module is called with.
        saddles: (V,) bool, see :func:`saddle_penalty`.
        reduction: see :class:`~torchfair.energies.MeshModule`.

    Example:
        >>> from torchfair.shapes import Catenoid, principal_triangles
        >>> from torchfair.stars import SaddlePenalty
        >>> mesh = principal_triangles(Catenoid(), 8, 16)
        >>> SaddlePenalty(mesh.topology)(mesh.vertices)  # all stars of this funnel are good saddles
        tensor(0., dtype=torch.float64)
    """

    groups: list[SaddleGroup]

    def __init__(self, topology: Topology, saddles: Tensor | None = None, *, reduction: Reduction = "none") -> None:
        self.saddles = saddles
        super().__init__(topology, reduction=reduction)

    def _set_topology(self, topology: Topology) -> None:
        super()._set_topology(topology)
        if self.saddles is not None:
            self.saddles = self.saddles.to(topology.device)
        self.groups = saddle_groups(topology, self.saddles)

    def per_vertex(self, vertices: Tensor) -> Tensor:
        """Terms (*batch, V); see :func:`saddle_penalty_per_vertex`."""
        return _per_vertex(vertices, self.topology, self.groups)

    def per_mesh(self, vertices: Tensor) -> Tensor:
        """Penalty (*batch,) of ``vertices`` (*batch, V, 3)."""
        return self.topology.sum_per_mesh(self.per_vertex(vertices), "vertices")


@torch.inference_mode(False)
def saddle_groups(topology: Topology, saddles: Tensor | None) -> list[SaddleGroup]:
    """Groups of the chosen stars; see :func:`saddle_penalty`."""
    possible = ~topology.is_boundary_vertex & (topology.valences >= LEAST_EDGES)
    possible &= topology.valences <= MOST_TARGET_EDGES
    chosen = possible if saddles is None else saddles
    if chosen.shape != possible.shape or chosen.dtype != torch.bool:
        raise ShapeError(
            "saddles", f"a bool tensor ({topology.num_vertices},)", f"{tuple(chosen.shape)} {chosen.dtype}"
        )
    wrong = torch.nonzero(chosen & ~possible).squeeze(1).tolist()
    if wrong:
        raise MeshError(
            f"{len(wrong)} vertex(es) cannot be asked to be saddles: {wrong[:5]}. Choose vertices inside the mesh with "
            f"{LEAST_EDGES} to {MOST_TARGET_EDGES} edges."
        )
    groups = []
    for group in star_groups(topology):
        kept = chosen[group.centres]
        if bool(kept.any()):
            patterns = good_patterns(group.ring.shape[1]).to(topology.device)
            groups.append(SaddleGroup(group.centres[kept], group.ring[kept], patterns))
    return groups


@in_single_at_least
def _per_vertex(vertices: Tensor, topology: Topology, groups: list[SaddleGroup]) -> Tensor:
    topology.check_vertices(vertices)
    vertices, _ = in_their_units(vertices, topology, "vertices")
    total = vertices.sum(-1) * 0.0  # NaN stays NaN
    for centres, ring, patterns in groups:
        arms = gather(vertices, ring) - gather(vertices, centres)[..., None, :]
        size = ring.shape[1]
        flat = arms.reshape(-1, size, 3)
        sides = saddle_sides(flat, patterns)
        normals = saddle_planes(flat, sides).reshape(*arms.shape[:-2], 3)
        sides = sides.reshape(arms.shape[:-1])
        total = total.index_add(-1, centres, saddle_defects(arms, sides, normals).square().sum(-1))
    return total
