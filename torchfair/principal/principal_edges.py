"""Which edges of a triangle mesh are principal, and what follows from it: stars, polylines, finer meshes."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import torch
from torch import Tensor

from .._graph import edge_numbers
from .._names import PlacedError, few
from ..errors import MeshError, ShapeError
from ..polylines import join_triples
from ..subdivision import Refinement
from ..topology import Topology
from ._families import differences, sides_of

REGULAR = 6  # the valence of a regular vertex


class PrincipalStars(NamedTuple):
    r"""Regular vertices with their neighbours (paper section 2.3, Fig. 6).

    ::

            w3    w2          w1, ..., w6 counterclockwise; v w1 and v w4 are principal,
              \  /            w2, w3, w5, w6 are to lie on a sphere through v
        w4 --- v --- w1
              /  \
            w5    w6

    Attributes:
        vertices: (R,) regular vertices, ascending.
        principal: (R, 2) the principal neighbours w1, w4.
        cospherical: (R, 4) the cospherical neighbours w2, w3, w5, w6.
    """

    vertices: Tensor
    principal: Tensor
    cospherical: Tensor


@dataclass(frozen=True, eq=False)
class PrincipalEdges:
    """A choice of principal edges on a triangle mesh.

    A vertex is *regular* if it lies inside and has valence 6. There two opposite edges should be principal and the
    four others not; regular vertices where it is otherwise are :attr:`exceptions`. Nothing is asked of vertices on
    the boundary and of :attr:`singular` ones.

    Attributes:
        topology: a triangle mesh.
        mask: (E,) bool, whether an edge is principal, in the order of ``topology.edges``.
    """

    topology: Topology
    mask: Tensor

    def __post_init__(self) -> None:
        self.topology.require_triangles()
        count, mask = self.topology.num_edges, self.mask
        if not isinstance(mask, Tensor) or mask.shape != (count,) or mask.dtype != torch.bool:
            actual = f"{tuple(mask.shape)} {mask.dtype}" if isinstance(mask, Tensor) else type(mask).__name__
            raise ShapeError("mask", f"a bool tensor ({count},), one entry for each edge", actual)

    @cached_property
    def singular(self) -> Tensor:
        """Interior vertices of a valence other than 6, ascending. No condition is imposed there."""
        inside = ~self.topology.is_boundary_vertex & (self.topology.valences > 0)
        return torch.nonzero(inside & (self.topology.valences != REGULAR)).squeeze(1)

    @cached_property
    def exceptions(self) -> Tensor:
        """Regular vertices without exactly two principal edges, opposite to each other; ascending."""
        vertices, _ = self._regular_rings
        return vertices[~self._is_star]

    def check(self) -> PrincipalEdges:
        """These edges, unless there are exceptions.

        Raises:
            MeshError: naming the first exceptions.
        """
        if self.exceptions.numel():
            wrong = self.exceptions.tolist()
            raise PlacedError(
                f"{len(wrong)} regular vertex(es) do not have exactly two principal edges, opposite to each other: "
                "vertices ", few("vertex", wrong), ". Mark other edges, or go without conditions there."
            )  # fmt: skip
        return self

    def stars(self) -> PrincipalStars:
        """The regular vertices that are no exceptions, with their principal and their cospherical neighbours."""
        vertices, rings = self._regular_rings
        rows = torch.nonzero(self._is_star).squeeze(1)
        first = self._ring_mask[rows].int().argmax(1, keepdim=True)
        turned = rings[rows].gather(1, (first + torch.arange(REGULAR, device=rings.device)) % REGULAR)
        return PrincipalStars(vertices[rows], turned[:, [0, 3]], turned[:, [1, 2, 4, 5]])

    def polylines(self) -> list[Tensor]:
        """Vertices along every principal polyline; each principal edge belongs to exactly one.

        A polyline runs straight on through the vertices of :meth:`stars`; and through boundary vertices of valence
        4 to 6 with just two principal edges that enclose three triangles, as along the edge of a lattice. It ends
        at all other vertices. Open polylines come first; a closed one repeats its first vertex at the end. Order
        and direction depend on topology and mask only.

        Returns:
            Vertex numbers, one int64 tensor of two or more for each polyline.
        """
        stars = self.stars()
        triples = [torch.stack([stars.principal[:, 0], stars.vertices, stars.principal[:, 1]], dim=1)]
        for valence in (4, 5, 6):
            triples.append(self._boundary_triples(valence))
        return join_triples(self.topology.edges[self.mask], torch.cat(triples), self.topology.num_vertices)

    def refine(self, refinement: Refinement) -> PrincipalEdges:
        """The principal edges of a finer mesh: parts of principal edges, and inner edges parallel to them.

        If there are exceptions, every triangle is asked for its own principal edge first, so that the seams between
        triangles that disagree do not become broader.

        Raises:
            MeshError: if the refinement starts from another mesh, or leads to faces that are not triangles.
        """
        if refinement.coarse.num_vertices != self.topology.num_vertices or not torch.equal(
            refinement.coarse.corners, self.topology.corners
        ):
            raise MeshError(f"{refinement!r} does not start from the mesh of the principal edges, {self.topology!r}")
        if not self.exceptions.numel():
            return PrincipalEdges(refinement.topology, refinement.carry_edge_labels(self.mask, parallel=True))
        rule = differences(self.topology)
        sides = torch.from_numpy(sides_of(rule, self.mask.cpu().numpy())).to(self.mask.device)
        edges = self.topology.corner_edges.view(-1, 3).gather(1, sides.clamp(min=0)[:, None]).squeeze(1)
        wanted = torch.where(sides >= 0, edges, -1)[refinement.face_parents]
        refinement.topology.require_triangles()
        fine = refinement.topology.corner_edges.view(-1, 3)
        mask = torch.zeros(refinement.topology.num_edges, dtype=torch.bool, device=self.mask.device)
        mask[fine[refinement.edge_parallels[fine, 0] == wanted[:, None]]] = True
        return PrincipalEdges(refinement.topology, mask)

    def to(self, device: torch.device | str) -> PrincipalEdges:
        """The same edges with all tensors on ``device``."""
        return PrincipalEdges(self.topology.to(device), self.mask.to(device))

    def __repr__(self) -> str:
        return (
            f"PrincipalEdges({int(self.mask.sum())} of {self.topology.num_edges} edges, "
            f"{self.singular.numel()} singular vertices, {self.exceptions.numel()} exceptions)"
        )

    @cached_property
    def _regular_rings(self) -> tuple[Tensor, Tensor]:
        """Regular vertices (R,) and their rings (R, 6)."""
        none = self.mask.new_zeros(0, dtype=torch.int64)
        return self.topology.rings_by_valence.get(REGULAR, (none, none.reshape(0, REGULAR)))

    @cached_property
    def _ring_mask(self) -> Tensor:
        """(R, 6) whether the edges to the ring are principal."""
        vertices, rings = self._regular_rings
        return self._is_principal(vertices, rings)

    @cached_property
    def _is_star(self) -> Tensor:
        """(R,) whether two opposite edges are principal and no others."""
        marked = self._ring_mask
        return (marked.sum(1) == 2) & (marked[:, :3] & marked[:, 3:]).any(1)

    def _is_principal(self, vertices: Tensor, neighbours: Tensor) -> Tensor:
        numbers = edge_numbers(self.topology, torch.stack([vertices[:, None].expand_as(neighbours), neighbours], -1))
        return self.mask[numbers]

    def _boundary_triples(self, valence: int) -> Tensor:
        chosen = self.topology.is_boundary_vertex & (self.topology.valences == valence)
        vertices = torch.nonzero(chosen).squeeze(1)
        columns = torch.arange(valence, device=vertices.device)
        rings = self.topology.ring_vertices[self.topology.ring_offsets[vertices, None] + columns]
        marked = self._is_principal(vertices, rings)
        opposite = marked[:, :-3] & marked[:, 3:]
        rows = torch.nonzero((marked.sum(1) == 2) & opposite.any(1)).squeeze(1)
        first = opposite[rows].int().argmax(1, keepdim=True)
        ends = rings[rows].gather(1, torch.cat([first, first + 3], dim=1))
        return torch.stack([ends[:, 0], vertices[rows], ends[:, 1]], dim=1)
