"""The matrix of a smoothing step from weights of vertices: what Loop, Catmull-Clark and their mixture share."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import scipy.sparse as sp
from torch import Tensor

from ..topology import Topology
from ._arrays import Floats, MeshArrays, scaled, sparse
from ._boundary import (
    Boundary,
    boundary_edge_rows,
    boundary_vertex_rows,
    check_boundary,
    corner_mask,
    staying_vertices,
)
from ._split import split_faces
from .refinement import Refinement

Mask = npt.NDArray[np.bool_]


class VertexWeights(NamedTuple):
    """How an interior vertex moves: ``own v + ring sum(neighbours) + face sum(centroids of centred faces)``.

    Each (V,); those of vertices that are not interior have no meaning.
    """

    own: Floats
    ring: Floats
    face: Floats


def smooth_step(
    topology: Topology,
    mesh: MeshArrays,
    centred: Mask,
    weights: VertexWeights,
    boundary: Boundary,
    corners: Tensor | None,
) -> Refinement:
    """Splits faces as :func:`split_faces` and places the vertices.

    Args:
        topology: the coarse mesh.
        mesh: its arrays.
        centred: (F,) faces with a vertex in their middle.
        weights: of the interior vertices.
        boundary: rule of the boundary.
        corners: (V,) bool, vertices that stay.
    """
    check_boundary(boundary)
    fixed = corner_mask(topology, corners)
    stay = staying_vertices(mesh, boundary, fixed)
    split = split_faces(topology, centred)
    centroids = face_centroids(mesh)
    moving = ~stay & ~mesh.on_boundary
    vertices = _vertex_rows(mesh, centred, weights, centroids, moving) + boundary_vertex_rows(mesh, stay)
    edges = _edge_rows(mesh, centred) + boundary_edge_rows(mesh, boundary, fixed)
    matrix = sp.csr_array(sp.vstack([vertices, edges, centroids[np.flatnonzero(centred)]]))
    matrix.eliminate_zeros()
    return Refinement(topology, split.topology, matrix, *split[1:])


def face_centroids(mesh: MeshArrays) -> sp.csr_array:
    """(F, V) means of the corners of every face."""
    return scaled(1 / mesh.face_sizes, mesh.face_corners())


def _vertex_rows(
    mesh: MeshArrays, centred: Mask, weights: VertexWeights, centroids: sp.csr_array, moving: Mask
) -> sp.csr_array:
    """(V, V) rows of the ``moving`` vertices; other rows are zero."""
    own, ring, face = (np.where(moving, part, 0.0) for part in weights)
    at_centred = centred[mesh.corner_faces]
    vertex, beside = mesh.corners[at_centred], mesh.corner_faces[at_centred]
    around = sparse(face[vertex], vertex, beside, mesh.num_vertices, mesh.num_faces)
    every = np.arange(mesh.num_vertices)
    itself = sparse(own, every, every, mesh.num_vertices, mesh.num_vertices)
    return sp.csr_array(itself + scaled(ring, mesh.neighbours()) + around @ centroids)


def _edge_rows(mesh: MeshArrays, centred: Mask) -> sp.csr_array:
    """(E, V) rows of the interior edges; other rows are zero.

    Each side gives a half: a centred face 1/8 of both ends and 1/4 of its centroid, another triangle 1/16 of both
    ends and 3/8 of its centroid, which is 3/16 of both ends and 1/8 of the opposite vertex.
    """
    inner = mesh.corner_edges < mesh.num_interior_edges
    edge, face = mesh.corner_edges[inner], mesh.corner_faces[inner]
    of_ends: Floats = np.where(centred, 1 / 8, 1 / 16)[face]
    of_corners = (np.where(centred, 1 / 4, 3 / 8) / mesh.face_sizes)[face]
    sides = sparse(of_corners, edge, face, mesh.num_edges, mesh.num_faces)
    ends: Floats = np.bincount(edge, of_ends, mesh.num_edges).astype(np.float64)
    return sp.csr_array(scaled(ends, mesh.edge_ends()) + sides @ mesh.face_corners())
