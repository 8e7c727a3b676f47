"""The index tensors of a mesh, and how many of everything there are."""

from __future__ import annotations

import torch
from torch import Tensor

from ._tables import cached_table


class MeshSizes:
    """Index tensors that the subclass holds, and sizes."""

    num_vertices: int
    corners: Tensor
    face_offsets: Tensor
    corner_faces: Tensor
    corner_edges: Tensor
    edges: Tensor
    interior_edge_faces: Tensor
    mesh_offsets: Tensor | None

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
