"""A tangent frame in every triangle, and how frames turn from triangle to triangle."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from .._graph import connected
from .._one_mesh import one_mesh
from ..topology import Topology

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
Complexes = npt.NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class FaceFrames:
    """Triangles with orthonormal frames ``first, second``, counterclockwise, along and left of their first side.

    Arrays over edges hold the interior edges of the topology, in its order; two columns are the left and the right
    face. Edge ``v -> w`` starts at corner ``corners[e, 0]`` of its left face and ends at ``corners[e, 1]`` of its right
    face.

    Attributes:
        topology: the triangle mesh.
        points: (V, 3).
        triangles: (F, 3).
        normals, first, second: (F, 3) unit vectors.
        areas: (F,).
        edges: (I, 2) vertices ``v, w``.
        faces: (I, 2) left and right face.
        corners: (I, 2), see above.
        lengths: (I,).
        edge_angles: (I, 2) angle of the edge in the frame of the left and of the right face.
        is_boundary: (V,) bool.
    """

    topology: Topology
    points: Floats
    triangles: Ints
    normals: Floats
    first: Floats
    second: Floats
    areas: Floats
    edges: Ints
    faces: Ints
    corners: Ints
    lengths: Floats
    edge_angles: Floats
    is_boundary: Bools

    @classmethod
    def of(cls, vertices: Tensor, topology: Topology) -> FaceFrames:
        """Frames of one triangle mesh ``(V, 3)`` without faces that have no area.

        Raises:
            ShapeError: if the vertices do not fit the topology.
            MeshError: if a face is not a triangle.
        """
        points = one_mesh(vertices, topology).cpu().double().numpy()
        topology = topology.to("cpu")
        triangles = topology.triangles.numpy()
        a, b, c = points[triangles].transpose(1, 0, 2)
        doubled = np.cross(b - a, c - a)
        size = np.linalg.norm(doubled, axis=1)
        normals = doubled / size[:, None]
        first = (b - a) / np.linalg.norm(b - a, axis=1)[:, None]
        second = np.cross(normals, first)
        edges, faces = topology.interior_edges.numpy(), topology.interior_edge_faces.numpy()
        corners = _corners(topology)
        along = points[edges[:, 1]] - points[edges[:, 0]]
        x, y = ((along[:, None] * frame[faces]).sum(-1) for frame in (first, second))
        return cls(topology, points, triangles, normals, first, second, size / 2, edges, faces, corners,
                   np.linalg.norm(along, axis=1), np.arctan2(y, x), topology.is_boundary_vertex.numpy())  # fmt: skip

    def grown(self, inside: Bools, rings: int) -> Bools:
        """(F,) triangles within rings of neighbours of some (F,)."""
        for _ in range(rings):
            near = np.zeros(len(self.points), bool)
            near[self.triangles[inside]] = True
            inside = np.asarray(near[self.triangles].any(1))
        return inside

    def at_vertices(self, values: Floats) -> Floats:
        """(V,) means of values (F,) of the triangles around; 0 where there are none."""
        corners, size = self.triangles.ravel(), len(self.points)
        counts = np.bincount(corners, minlength=size)
        return np.asarray(np.bincount(corners, np.repeat(values, 3), size) / np.maximum(counts, 1))

    def seen(self, vectors: Floats, faces: Ints) -> Complexes:
        """(n, ...) vectors (n, ..., 3) in the frames of faces (n,), as complex numbers."""
        apart = (len(faces), *[1] * (vectors.ndim - 2), 3)
        x, y = ((vectors * axis[faces].reshape(apart)).sum(-1) for axis in (self.first, self.second))
        return np.asarray(x + 1j * y)

    def sides(self, corners: Ints) -> Complexes:
        """(n,) sides that start at corners ``3 f + k``, in the frames of their faces."""
        faces, side = corners // 3, corners % 3
        along = self.points[self.triangles[faces, (side + 1) % 3]] - self.points[self.triangles[faces, side]]
        return self.seen(along, faces)

    @property
    def turns(self) -> Floats:
        """(I,) by how much an angle grows from the left face to the right face of an edge."""
        return self.edge_angles[:, 1] - self.edge_angles[:, 0]

    @cached_property
    def gradients(self) -> Complexes:
        """(F, 3) gradients of the functions that are 1 at one corner, as complex numbers in the frame."""
        opposite = np.roll(self.points[self.triangles], -2, axis=1) - np.roll(self.points[self.triangles], -1, axis=1)
        inward = np.cross(self.normals[:, None], opposite) / (2 * self.areas)[:, None, None]
        return self.seen(inward, np.arange(len(inward)))

    @cached_property
    def outer_corners(self) -> Ints:
        """(B,) ``3 f + k`` where boundary edges start at corner k of face f."""
        return np.flatnonzero(self.topology.corner_edges.numpy() >= self.topology.num_interior_edges)

    @cached_property
    def left_corners(self) -> tuple[Ints, Ints]:
        """(E,) left face of every edge, boundary edges included, and its corner where the edge starts."""
        inner = self.topology.num_interior_edges
        face, corner = np.zeros((2, self.topology.num_edges), np.int64)
        face[:inner], corner[:inner] = self.faces[:, 0], self.corners[:, 0]
        edge = self.topology.corner_edges.numpy()[self.outer_corners]
        face[edge], corner[edge] = self.outer_corners // 3, self.outer_corners % 3
        return face, corner

    def joined_corners(self, cut: Bools) -> Ints:
        """(F, 3) numbers of corners, the same on both sides of interior edges but where they are cut (I,)."""
        (f, g), (i, j) = self.faces[~cut].T, self.corners[~cut].T
        ours = np.concatenate([3 * f + i, 3 * f + (i + 1) % 3])
        theirs = np.concatenate([3 * g + (j + 1) % 3, 3 * g + j])
        return connected(np.stack([ours, theirs], 1), 3 * len(self.triangles)).reshape(-1, 3)

    def cut_along(self, cut: Bools) -> FaceFrames:
        """The same triangles, apart from each other where interior edges are cut (I,)."""
        corners = self.joined_corners(cut)
        points = np.zeros((int(corners.max()) + 1, 3))
        points[corners] = self.points[self.triangles]
        topology = Topology.from_faces(torch.from_numpy(corners), len(points))
        return FaceFrames.of(torch.from_numpy(points), topology)

    @cached_property
    def dual_weights(self) -> Floats:
        """Squared lengths over the areas on both sides (I,), the weights of the smoothness of fields."""
        return np.asarray(3 * self.lengths**2 / self.areas[self.faces].sum(1))

    @cached_property
    def centres(self) -> Floats:
        """Centres of the faces (F, 3)."""
        return np.asarray(self.points[self.triangles].mean(1))


def _corners(topology: Topology) -> Ints:
    """(I, 2) corner of the left face where an edge starts, corner of the right face where it ends."""
    edge_of, start = topology.corner_edges.numpy(), topology.corners.numpy()
    inside = edge_of < topology.num_interior_edges
    is_right = start != topology.edges.numpy()[edge_of, 0]
    found = np.zeros((topology.num_interior_edges, 2), np.int64)
    places = np.flatnonzero(inside)
    found[edge_of[places], is_right[places].astype(np.int64)] = places % 3
    return found
