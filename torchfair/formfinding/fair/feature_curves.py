"""The curves on which the job that lowers E lets vertices glide: along the boundary and along creases."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import torch
from torch import Tensor

from ..._graph import edge_numbers
from ...boundary import boundary_corners
from ...constraints.fairness_residuals import second_difference
from ...creases import crease_chains, crease_corners, crease_edges
from ...projection import ElementTerm
from ...settings.fair_settings import FairSettings
from ...subdivision import Refinement
from ...topology import Topology
from ..boundary_curves import BoundaryCurves


class FeatureCurves(NamedTuple):
    """Smooth curves along the boundary and the creases of a mesh, which its refinements share.

    Attributes:
        rim: Curves along the boundary, which end where creases arrive, too.
        points: For every stretch of a crease the (n, 3) points that its curve passes through.
        closed: Whether it is closed.
        edges: (E,) number of the stretch that an edge is part of; -1 for edges that are no creases.
        corners: (V,) bool, where creases end.
        owners: (V,) number of the stretch of a vertex between corners; -1 at other vertices.
    """

    rim: BoundaryCurves
    points: list[Tensor]
    closed: list[bool]
    edges: Tensor
    corners: Tensor
    owners: Tensor

    @classmethod
    def through(
        cls, vertices: Tensor, topology: Topology, *, corner_angle: float, crease_angle: float
    ) -> FeatureCurves:
        """Through the vertices (V, 3) of a mesh itself; both angles in radians, a crease angle of 0 for no creases."""
        found = crease_edges(vertices, topology, crease_angle)
        corners = crease_corners(vertices, topology, found, corner_angle)
        chains = crease_chains(topology, found, corners)
        points = [vertices[chain.vertices] for chain in chains]
        closed = [chain.closed for chain in chains]
        turns = boundary_corners(vertices, topology, corner_angle) | (corners & topology.is_boundary_vertex)
        edges = torch.full((topology.num_edges,), -1)
        walks = [torch.cat([walk, walk[:1]]) if ring else walk for walk, ring in chains]
        if walks:
            ends = [walk.unfold(0, 2, 1) for walk in walks]
            numbers = torch.arange(len(ends)).repeat_interleave(torch.tensor([len(pairs) for pairs in ends]))
            edges[edge_numbers(topology, torch.cat(ends))] = numbers
        rim = BoundaryCurves.through(vertices, topology, turns)
        return cls(rim, points, closed, edges, corners, _owners(topology, edges, corners))

    @property
    def stay(self) -> Tensor:
        """(V,) bool, corners of creases inside the mesh."""
        return self.corners & ~self.rim.corners

    @property
    def on_creases(self) -> Tensor:
        """(V,) bool, vertices of creases, corners included."""
        return self.corners | (self.owners >= 0)

    def fairness_terms(self, topology: Topology, *, weight: float) -> list[ElementTerm]:
        """Second differences along creases: keeps vertices apart that glide on them.

        The weight multiplies an eighth of ``|v_- - 2 v + v_+|^2``.
        """
        ends = topology.edges[self.edges >= 0]
        ends = torch.cat([ends, ends.flip(1)])
        ends = ends[self.owners[ends[:, 0]] >= 0]
        if not ends.numel():
            return []
        ends = ends[torch.argsort(ends[:, 0], stable=True)]  # those between corners have two neighbours
        triples = torch.stack([ends[::2, 1], ends[::2, 0], ends[1::2, 1]], 1)
        return [ElementTerm("crease fairness", second_difference, [("vertices", triples)], weight=weight, linear=True)]

    def curves(self, *, boundary: bool) -> BoundaryCurves:
        """All of them, or those of creases only."""
        if not self.points:
            return self.rim if boundary else self.rim._replace(points=[], closed=[], owners=self.owners)
        first, rim = (len(self.rim.points), self.rim) if boundary else (0, self.rim._replace(points=[], closed=[]))
        owners = torch.where(self.owners >= 0, self.owners + first, self.rim.owners if boundary else -1)
        return BoundaryCurves(rim.points + self.points, rim.closed + self.closed, owners, rim.corners | self.corners)

    def mapped(self, function: Callable[[Tensor], Tensor]) -> FeatureCurves:
        """In another unit."""
        return self._replace(rim=self.rim.mapped(function), points=[function(points) for points in self.points])

    def refined(self, step: Refinement) -> FeatureCurves:
        """The same curves for a finer mesh; corners are no more than before."""
        edges, corners = step.carry_edge_labels(self.edges, fill=-1), step.carry_vertex_labels(self.corners)
        owners = _owners(step.topology, edges, corners)
        return self._replace(rim=self.rim.refined(step), edges=edges, corners=corners, owners=owners)


def _owners(topology: Topology, edges: Tensor, corners: Tensor) -> Tensor:
    owners = torch.full((topology.num_vertices,), -1)
    found = torch.nonzero(edges >= 0).squeeze(1)
    for ends in topology.edges[found].unbind(1):
        owners[ends] = edges[found]
    owners[corners] = -1  # they belong to several, but do not glide
    return owners


def feature_curves(vertices: Tensor, topology: Topology, settings: FairSettings) -> FeatureCurves:
    """Along boundary and creases of a mesh (V, 3), with creases and corners where the settings see them."""
    return FeatureCurves.through(
        vertices, topology, corner_angle=settings.corner_angle, crease_angle=settings.crease_angle
    )
