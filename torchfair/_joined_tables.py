"""Which mesh everything belongs to, where several are joined in one topology; sums over each mesh."""

from __future__ import annotations

from typing import Literal

import torch
from torch import Tensor

from ._mesh_sizes import MeshSizes
from ._mesh_sums import MeshSums
from ._tables import cached_table

Elements = Literal["vertices", "faces", "interior_edges"]

JOINED_TABLES = ("vertex_meshes", "edge_meshes", "face_meshes", "_vertex_sums", "_face_sums", "_interior_edge_sums")
"""Filled in with a joined topology, so that ``torch.compile`` finds them."""


class JoinedTables(MeshSizes):
    """Meshes of a joined topology; one that is not joined is one mesh."""

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
