"""What is worked out from the index tensors of a topology, when it is first asked for."""

from __future__ import annotations

import itertools

import torch
from torch import Tensor

from . import _connectivity
from ._half_edges import HalfEdges, half_edges
from ._joined_tables import JoinedTables
from ._names import PlacedError, few
from ._tables import cached_table

CHEAP_TABLES = ("face_sizes", "is_triangular", "is_quadrangular", "faces_by_size", "next_corners", "valences",
                "is_boundary_vertex")  # fmt: skip
"""Filled in with the topology, so that ``torch.compile`` finds them."""

FANS = "_checked_fans"
"""Set where fans have been looked at."""


class MeshTables(JoinedTables):
    """Groups and rings of a mesh."""

    # ---- edges -----------------------------------------------------------------------------------------

    @property
    def interior_edges(self) -> Tensor:
        """(I, 2) vertices ``v, w``."""
        return self.edges[: self.num_interior_edges]

    @property
    def boundary_edges(self) -> Tensor:
        """(E-I, 2) vertices ``v, w``, the surface on the left."""
        return self.edges[self.num_interior_edges :]

    @cached_table
    def triangles(self) -> Tensor:
        """(F, 3) faces of a triangle mesh.

        Raises:
            MeshError: if a face is not a triangle.
        """
        self.require_triangles()
        return self.corners.view(-1, 3)

    @cached_table
    def edge_flaps(self) -> Tensor:
        """(I, 4) vertices ``v, w, a, b`` of each interior edge of a triangle mesh.

        ``v, w`` are the edge, ``a`` is opposite in the left face and ``b`` opposite in the right face.

        Raises:
            MeshError: if a face is not a triangle.
        """
        triangles = self.triangles
        v, w = self.interior_edges.unbind(1)
        opposite = triangles[self.interior_edge_faces].sum(-1) - (v + w)[:, None]
        return torch.stack([v, w, opposite[:, 0], opposite[:, 1]], dim=1)

    # ---- faces -----------------------------------------------------------------------------------------

    @cached_table
    def next_corners(self) -> Tensor:
        """(H,) the next corner of the same face, counterclockwise."""
        following = torch.arange(1, self.corners.shape[0] + 1, device=self.device)
        if len(self.faces_by_size) == 1:
            (size,) = self.faces_by_size
            following.view(-1, size)[:, -1].sub_(size)
            return following
        following[self.face_offsets[1:] - 1] = self.face_offsets[:-1]
        return following

    @cached_table
    def faces_by_size(self) -> dict[int, tuple[Tensor, Tensor]]:
        """Faces grouped by number of corners, ``{k: (face numbers (n,), corners (n, k))}``."""
        groups: dict[int, tuple[Tensor, Tensor]] = {}
        sizes = [self.corners.shape[0] // max(self.num_faces, 1)] if self.num_faces else []
        if sizes and bool((self.face_sizes == sizes[0]).all()):
            return {sizes[0]: (torch.arange(self.num_faces, device=self.device), self.corners.view(-1, sizes[0]))}
        for size in torch.unique(self.face_sizes).tolist():
            numbers = torch.nonzero(self.face_sizes == size).squeeze(1)
            columns = torch.arange(size, device=self.device)
            groups[size] = (numbers, self.corners[self.face_offsets[numbers, None] + columns])
        return groups

    def face_lists(self) -> list[list[int]]:
        """Faces as lists of vertex numbers, in order."""
        flat, offsets = self.corners.tolist(), self.face_offsets.tolist()
        return [flat[a:b] for a, b in itertools.pairwise(offsets)]

    @cached_table
    def twins(self) -> Tensor:
        """(H,) the corner whose edge is the same, in the face on its other side; -1 on the boundary."""
        own = torch.arange(self.corners.shape[0], device=self.device)
        both = torch.zeros(self.num_edges, dtype=torch.int64, device=self.device)
        both.index_add_(0, self.corner_edges, own)  # of the two corners
        return torch.where(self.corner_edges < self.num_interior_edges, both[self.corner_edges] - own, -1)

    # ---- vertices --------------------------------------------------------------------------------------

    @cached_table
    def valences(self) -> Tensor:
        """(V,) number of edges at each vertex; 0 for isolated vertices."""
        ends = self.edges.reshape(-1)
        return ends.new_zeros(self.num_vertices).index_add_(0, ends, ends.new_ones(()).expand_as(ends))

    @cached_table
    def is_boundary_vertex(self) -> Tensor:
        """(V,) bool."""
        mask = torch.zeros(self.num_vertices, dtype=torch.bool, device=self.device)
        mask[self.boundary_edges[:, 0]] = True  # along a boundary every vertex is the start of an edge
        return mask

    @cached_table
    def _rings(self) -> tuple[Tensor, Tensor]:
        return _as_tensors(_connectivity.build_rings(self._half_edges, self.twins.cpu().numpy()), self.device)

    @cached_table
    def _loops(self) -> tuple[Tensor, Tensor]:
        self.require_fans()
        return _as_tensors(_connectivity.build_boundary_loops(self.boundary_edges.cpu().numpy()), self.device)

    @property
    def _half_edges(self) -> HalfEdges:
        return half_edges(self.corners.cpu().numpy(), self.face_offsets.cpu().numpy(), self.num_vertices)

    @property
    def ring_vertices(self) -> Tensor:
        """(R,) neighbours of each vertex, counterclockwise, one vertex after another.

        Around a boundary vertex from the boundary edge with the surface on its left to the other one.
        """
        return self._rings[0]

    @property
    def ring_offsets(self) -> Tensor:
        """(V+1,) where the neighbours of each vertex begin in :attr:`ring_vertices`."""
        return self._rings[1]

    @property
    def loop_vertices(self) -> Tensor:
        """(B,) boundary loops, one after another, the surface on the left."""
        return self._loops[0]

    @property
    def loop_offsets(self) -> Tensor:
        """(L+1,) where each boundary loop begins in :attr:`loop_vertices`."""
        return self._loops[1]

    def require_triangles(self) -> None:
        """Raises MeshError naming the first faces that are not triangles."""
        if not self.is_triangular:
            others = torch.nonzero(self.face_sizes != 3).squeeze(1).tolist()
            raise PlacedError(
                f"a triangle mesh is needed, but {len(others)} face(s) are not triangles: faces ",
                few("face", others),
                ". Triangulate them first.",
            )

    def require_fans(self) -> None:
        """Raises MeshError naming the first vertices whose faces form more than one fan.

        There are none unless the topology was made with ``manifold="edges"``.
        """
        if not self.has_fans:
            self._rings  # noqa: B018

    @property
    def has_fans(self) -> bool:
        """Whether it is known that the faces around every vertex form one fan."""
        return "_rings" in self.__dict__ or bool(self.__dict__.get(FANS, False))

    @cached_table
    def rings_by_valence(self) -> dict[int, tuple[Tensor, Tensor]]:
        """Interior vertices grouped by valence, ``{k: (vertices (n,), ring (n, k))}``, rings counterclockwise."""
        interior = ~self.is_boundary_vertex & (self.valences > 0)
        groups: dict[int, tuple[Tensor, Tensor]] = {}
        for valence in torch.unique(self.valences[interior]).tolist():
            vertices = torch.nonzero(interior & (self.valences == valence)).squeeze(1)
            columns = torch.arange(valence, device=self.device)
            groups[valence] = (vertices, self.ring_vertices[self.ring_offsets[vertices, None] + columns])
        return groups

    @cached_table
    def ring_corners_by_valence(self) -> dict[int, Tensor]:
        """``{k: corners (n, k)}`` at the vertices of :attr:`rings_by_valence`: of the faces between i and i + 1."""
        size = max(self.num_vertices, 1)
        keys, order = (self.corners * size + self.corners[self.next_corners]).sort()
        # The face to the left of the edge from the vertex to neighbour i lies between neighbours i and i + 1.
        return {
            valence: order[torch.searchsorted(keys, vertices[:, None] * size + ring)]
            for valence, (vertices, ring) in self.rings_by_valence.items()
        }

    def boundary_loops(self) -> list[Tensor]:
        """Boundary loops as vertex tensors, the surface on the left, each starting at its smallest vertex."""
        return list(torch.split(self.loop_vertices, self.loop_offsets.diff().tolist()))


def _as_tensors(pair: tuple[_connectivity.Ints, _connectivity.Ints], device: torch.device) -> tuple[Tensor, Tensor]:
    return torch.from_numpy(pair[0]).to(device), torch.from_numpy(pair[1]).to(device)
