"""A topology as NumPy arrays, and its incidences as sparse matrices."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp

from ..topology import Topology

Ints = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]


class MeshArrays:
    """The tables of a :class:`Topology` that subdivision reads, under the same names, in NumPy."""

    def __init__(self, topology: Topology) -> None:
        mesh = topology if topology.device.type == "cpu" else topology.to("cpu")
        self.num_vertices, self.num_edges, self.num_faces = mesh.num_vertices, mesh.num_edges, mesh.num_faces
        self.num_interior_edges = mesh.num_interior_edges
        self.corners: Ints = mesh.corners.numpy()
        self.corner_faces: Ints = mesh.corner_faces.numpy()
        self.corner_edges: Ints = mesh.corner_edges.numpy()
        self.face_offsets: Ints = mesh.face_offsets.numpy()
        self.face_sizes: Ints = mesh.face_sizes.numpy()
        self.edges: Ints = mesh.edges.numpy()
        self.valences: Ints = mesh.valences.numpy()
        self.ring_vertices: Ints = mesh.ring_vertices.numpy()
        self.ring_offsets: Ints = mesh.ring_offsets.numpy()
        self.on_boundary: npt.NDArray[np.bool_] = mesh.is_boundary_vertex.numpy()
        self.next: Ints = mesh.next_corners.numpy()
        self.previous: Ints = np.empty_like(self.next)
        self.previous[self.next] = np.arange(self.next.size)

    def edge_ends(self) -> sp.csr_array:
        """(E, V) with 1 at both ends of every edge."""
        return sparse(
            1.0, np.repeat(np.arange(self.num_edges), 2), self.edges.ravel(), self.num_edges, self.num_vertices
        )

    def face_corners(self) -> sp.csr_array:
        """(F, V) with 1 at the corners of every face."""
        return sparse(1.0, self.corner_faces, self.corners, self.num_faces, self.num_vertices)

    def neighbours(self) -> sp.csr_array:
        """(V, V) with 1 where two vertices have an edge."""
        tails = np.repeat(np.arange(self.num_vertices), self.valences)
        return sparse(1.0, tails, self.ring_vertices, self.num_vertices, self.num_vertices)


def sparse(values: float | Floats, rows: Ints, columns: Ints, height: int, width: int) -> sp.csr_array:
    """CSR array of ``height`` by ``width``; values at the same place are added."""
    data = np.broadcast_to(np.asarray(values, np.float64), rows.shape)
    return sp.csr_array(sp.coo_array((data, (rows, columns)), shape=(height, width)))


def scaled(rows: Floats, matrix: sp.csr_array) -> sp.csr_array:
    """``matrix`` with its rows multiplied by ``rows``."""
    data = matrix.data * np.repeat(rows, np.diff(matrix.indptr))
    return sp.csr_array((data, matrix.indices, matrix.indptr), shape=matrix.shape)
