"""What is worked out from the index tensors of a topology, when it is first asked for."""

from __future__ import annotations

import itertools
from typing import Literal

import torch
from torch import Tensor

from . import _connectivity
from ._half_edges import HalfEdges, half_edges
from ._mesh_sums import MeshSums
from ._names import PlacedError, few
from ._tables import cached_table

Elements = Literal["vertices", "faces", "interior_edges"]

CHEAP_TABLES = ("face_sizes", "is_triangular", "is_quadrangular", "faces_by_size", "next_corners", "valences",
                "is_boundary_vertex")  # fmt: skip
"""Filled in with the topology, so that ``torch.compile`` finds them."""

FANS = "_checked_fans"
"""Set where fans have been looked at."""

JOINED_TABLES = ("vertex_meshes", "edge_meshes", "face_meshes", "_vertex_sums", "_face_sums", "_interior_edge_sums")
"""Likewise, if it is joined."""


class MeshTables:
    """Sizes, groups and rings of a mesh, made of the index tensors that the subclass holds."""

    num_vertices: int
    corners: Tensor
    face_offsets: Tensor
    corner_faces: Tensor
    corner_edges: Tensor
    edges: Tensor
    interior_edge_faces: Tensor
    mesh_offsets: Tensor | None

    # ---- sizes -----------------------------------------------------------------------------------------

    @property
    def num_faces(self) -> int:
        """F."""
        return self.face_offsets.shape[0] - 1

    @property
    def num_edges(self) -> int:
        """E, boundary edges included."""
        return self.edges.shape[0]

    @property
    def num_interior_edges(self) -> int:
        """I, edges with a face on either side; they carry the numbers 0..I-1."""
        return self.interior_edge_faces.shape[0]

    @property
    def device(self) -> torch.device:
        """Where the index tensors live."""
        return self.edges.device

    @cached_table
    def face_sizes(self) -> Tensor:
        """(F,) number of corners."""
        return self.face_offsets.diff()

    @cached_table
    def is_triangular(self) -> bool:
        """Whether every face is a triangle."""
        return bool((self.face_sizes == 3).all())

    @cached_table
    def is_quadrangular(self) -> bool:
        """Whether every face has four corners."""
        return bool((self.face_sizes == 4).all())

    # ---- joined meshes ---------------------------------------------------------------------------------

    @property
    def is_joined(self) -> bool:
        """Whether it was made by ``join``, of any number of meshes: there is one value for each of them."""
        return self.mesh_offsets is not None

    @property
    def num_meshes(self) -> int:
        """Number n of joined meshes, 1 for one mesh."""
        return 1 if self.mesh_offsets is None else self.mesh_offsets.shape[0] - 1

    @cached_table
    def mesh_sizes(self) -> list[int]:
        """Number of vertices of each mesh, what ``torch.split`` takes vertices apart by."""
        return [self.num_vertices] if self.mesh_offsets is None else list(self.mesh_offsets.diff().tolist())

    @cached_table
    def vertex_meshes(self) -> Tensor:
        """(V,) mesh of each vertex."""
        if self.mesh_offsets is None:
            return torch.zeros(self.num_vertices, dtype=torch.int64, device=self.device)
        return torch.repeat_interleave(torch.arange(self.num_meshes, device=self.device), self.mesh_offsets.diff())

    @cached_table
    def face_meshes(self) -> Tensor:
        """(F,) mesh of each face."""
        return self.vertex_meshes[self.corners[self.face_offsets[:-1]]]

    @cached_table
    def edge_meshes(self) -> Tensor:
        """(E,) mesh of each edge."""
        return self.vertex_meshes[self.edges[:, 0]]

    @cached_table
    def _vertex_sums(self) -> MeshSums:
        return MeshSums.of(self.vertex_meshes, self.num_meshes)

    @cached_table
    def _interior_edge_sums(self) -> MeshSums:
        return MeshSums.of(self.edge_meshes[: self.num_interior_edges], self.num_meshes)

    @cached_table
    def _face_sums(self) -> MeshSums:
        return MeshSums.of(self.face_meshes, self.num_meshes)

    def sum_per_mesh(self, terms: Tensor, of: Elements | MeshSums) -> Tensor:
        """Sums of terms over each mesh: (*batch, N) to (*batch, n), or to (*batch,) where nothing is joined.

        Args:
            terms: one for each element.
            of: what the elements are, ``"vertices"``, ``"faces"`` or ``"interior_edges"``; others by ``sums_over``.
        """
        if not self.is_joined:
            return terms.sum(-1)
        if isinstance(of, MeshSums):
            return of.sum(terms)
        tables = {"vertices": self._vertex_sums, "faces": self._face_sums, "interior_edges": self._interior_edge_sums}
        return tables[of].sum(terms)

    def sums_over(self, vertices: Tensor) -> MeshSums:
        """For :meth:`sum_per_mesh`, of elements each of which has one of its vertices among ``vertices`` (N,)."""
        return MeshSums.of(self.vertex_meshes[vertices], self.num_meshes)

    def spread(self, values: Tensor, of: Elements) -> Tensor:
        """A value per mesh for each of its elements: (*batch, n) to (*batch, N), or (*batch,) to (*batch, 1)."""
        if not self.is_joined:
            return values[..., None]
        meshes = {"vertices": self.vertex_meshes, "faces": self.face_meshes, "interior_edges": self.edge_meshes}[of]
        return values.index_select(-1, meshes[: self.num_interior_edges] if of == "interior_edges" else meshes)

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
        return ends.new_zeros(self.num_vertices).index_add_(0, ends, torch.ones_like(ends))

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

    def boundary_loops(self) -> list[Tensor]:
        """Boundary loops as vertex tensors, the surface on the left, each starting at its smallest vertex."""
        return list(torch.split(self.loop_vertices, self.loop_offsets.diff().tolist()))


def _as_tensors(pair: tuple[_connectivity.Ints, _connectivity.Ints], device: torch.device) -> tuple[Tensor, Tensor]:
    return torch.from_numpy(pair[0]).to(device), torch.from_numpy(pair[1]).to(device)
