"""Exact closest points on a reference surface given as a polygon mesh."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import numpy as np
import torch
from torch import Tensor

from ..errors import MeshError
from ..topology import Topology
from ._closest_boxes import Floats, Ints
from ._closest_cut import cut_faces
from ._closest_points import to_columns
from ._closest_query import Kind, ask
from ._closest_search import BLOCK, nearest_pieces
from ._closest_tracker import PieceTracker
from ._closest_triangles import Triangles, dot
from .normals import face_normals, unit_normal, vertex_normals


class ClosestPoints(NamedTuple):
    """Closest points of a :class:`ReferenceSurface`, one for each of N query points.

    Floating tensors have the dtype and all tensors the device of the query points; nothing carries a gradient.

    Attributes:
        positions: (N, 3) closest point.
        distances: (N,) its distance from the query point, >= 0.
        faces: (N,) face of the mesh it lies on.
        normals: (N, 3) unit normal of the flat piece it lies on, for tangent planes. A piece without area has
            the mean direction of the vertex normals at its corners, zero if there are none.
        smooth_normals: (N, 3) vertex normals (face normals at the centres of fans) interpolated over the piece,
            unit length, continuous on the surface; the same as ``normals`` where they cancel.
        pieces: (N,) row of :attr:`ReferenceSurface.pieces`.
        weights: (N, 3) barycentric coordinates in that piece, >= 0 with sum 1.
    """

    positions: Tensor
    distances: Tensor
    faces: Tensor
    normals: Tensor
    smooth_normals: Tensor
    pieces: Tensor
    weights: Tensor


_ANSWER: tuple[Kind, ...] = ("vector", "number", "index", "vector", "vector", "index", "vector")


class ReferenceSurface:
    r"""A polygon mesh to which exact distances are measured.

    Triangles are as they are. A face with more corners is the fan of triangles around the mean of its corners,
    whether planar or not, so the surface does not depend on where the list of its corners starts; only a face
    that does not see all its corners from there (far from convex) is cut along diagonals instead::

            3 ------- 2          3 ------- 2
            |         |          | \     / |
            |         |    ->    |    m    |        m = (p0 + p1 + p2 + p3) / 4
            |         |          | /     \ |
            0 ------- 1          0 ------- 1

    The vertices of the faces are on the surface: their distance is exactly 0. Isolated vertices are not.

    Closest points are exact: as if every piece had been measured in float64, whatever the shape of the mesh
    and wherever the points are; the result is the same bit for bit. Of several closest points of equal distance
    the one on the piece with the lowest number is taken. Faces without area count as the segments they are.

    Args:
        vertices: (V, 3) positions, any length unit. Later changes of the tensor have no effect.
        topology: any polygons, mixed, with or without boundary.

    Attributes:
        points: (P, 3) float64, on the CPU: the vertices, then the centres of fans.
        pieces: (T, 3) the triangles, numbers of points, sorted by face.
        piece_faces: (T,) face of each piece.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (V, 3).
        MeshError: if there is no face, or a coordinate is not finite or beyond 1e70.

    Example:
        >>> from torchfair.geometry import ReferenceSurface
        >>> import torch
        >>> from torchfair import Topology
        >>> square = torch.tensor([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [0, 2, 0]])
        >>> surface = ReferenceSurface(square, Topology.from_faces([[0, 1, 2, 3]]))
        >>> surface.closest(torch.tensor([[1.0, 1, 5], [3, 1, 0]])).distances
        tensor([5., 1.])
    """

    _answer: ClassVar[tuple[Kind, ...]] = _ANSWER

    def __init__(self, vertices: Tensor, topology: Topology) -> None:
        topology.check_vertices(vertices)
        if topology.num_faces == 0:
            raise MeshError("the reference surface has no faces. Give a mesh with at least one face.")
        topology = topology.to("cpu")
        cut = cut_faces(to_columns(vertices, "vertices").T, topology)
        self.points = torch.from_numpy(cut.points)
        self.pieces = torch.from_numpy(cut.corners)
        self.piece_faces = torch.from_numpy(cut.faces)
        self._piece_faces = cut.faces
        self._triangles = Triangles(cut.points[cut.corners]).prepare()
        self._corners, smooth = cut.corners, self._point_normals(topology).numpy()
        flat = unit_normal(self.points[self.pieces]).numpy().T
        # Tables with points or pieces in the last axis.
        self._smooth: Floats = np.ascontiguousarray(smooth.T)
        self._normals: Floats = np.ascontiguousarray(flat)
        bare = np.flatnonzero(~flat.any(0))
        sums = smooth[cut.corners[bare]].transpose(1, 2, 0).sum(0)
        self._normals[:, bare] = _unit(sums, flat[:, bare])

    def _point_normals(self, topology: Topology) -> Tensor:
        """Vertex normals, then face normals at the centres of fans: (P, 3)."""
        vertices = self.points[: topology.num_vertices]
        normals = torch.zeros_like(self.points)
        normals[: topology.num_vertices] = vertex_normals(vertices, topology)
        fanned = self.pieces[:, 2] >= topology.num_vertices
        normals[self.pieces[fanned, 2]] = face_normals(vertices, topology)[self.piece_faces[fanned]]
        return normals

    def closest(self, points: Tensor) -> ClosestPoints:
        """Closest points of ``points`` (N, 3), N >= 0, anywhere in space.

        For points that are asked for again and again while they move, as in a solver, use :meth:`tracker`.
        The search is slow only where very many pieces are equally near to within rounding: at the centre of
        a sphere, or more than 1e5 times the size of a flat mesh away.

        Raises:
            ShapeError: if ``points`` is not a floating tensor (N, 3).
            MeshError: if a coordinate is not finite or beyond 1e70; the first few such rows are named.
        """
        return ClosestPoints(*ask(self, points))

    def _search(self, points: Floats, owners: Tensor | None) -> Sequence[Floats | Ints]:
        return self._describe(points, nearest_pieces(self._triangles, points))

    def tracker(self) -> ClosestPointTracker:
        """A :class:`ClosestPointTracker` on this surface."""
        return ClosestPointTracker(self)

    def _describe(self, points: Floats, pieces: Ints) -> Sequence[Floats | Ints]:
        starts = range(0, max(1, pieces.size), BLOCK)
        blocks = [self._describe_block(points[:, a : a + BLOCK], pieces[a : a + BLOCK]) for a in starts]
        return blocks[0] if len(blocks) == 1 else [np.concatenate(parts) for parts in zip(*blocks, strict=True)]

    def _describe_block(self, points: Floats, pieces: Ints) -> Sequence[Floats | Ints]:
        squared, positions, weights = self._triangles.locate(points, pieces)
        flat = self._normals.take(pieces, axis=1)
        at_corners = self._smooth.take(self._corners.take(pieces, axis=0).T, axis=1).transpose(1, 0, 2)
        smooth = _unit(dot(weights[:, None], at_corners), flat)
        faces = self._piece_faces.take(pieces)
        return positions.T, np.sqrt(squared), faces, flat.T, smooth.T, pieces, weights.T


class ClosestPointTracker:
    """Closest points on a surface for the same N points again and again, while they move.

    The result of :meth:`closest` is that of :meth:`ReferenceSurface.closest`, bit for bit, in about a quarter
    of the time once the points move slowly: for every point up to 16 pieces around it are kept. A point that
    moves by more than about a tenth of an edge length off the surface, or a fifth along it, is searched
    anew, and only that point. Another number of points is a new start.

    Args:
        surface: where closest points are sought.
    """

    _answer: ClassVar[tuple[Kind, ...]] = _ANSWER

    def __init__(self, surface: ReferenceSurface) -> None:
        self.surface = surface
        self._tracker = PieceTracker(surface._triangles)

    def closest(self, points: Tensor) -> ClosestPoints:
        """Closest points of ``points`` (N, 3); see :meth:`ReferenceSurface.closest`."""
        return ClosestPoints(*ask(self, points))

    def _search(self, points: Floats, owners: Tensor | None) -> Sequence[Floats | Ints]:
        return self.surface._describe(points, self._tracker.nearest(points))


def _unit(vectors: Floats, otherwise: Floats) -> Floats:
    """Unit vectors (3, M) along sums of unit vectors, or ``otherwise`` where those cancel."""
    length = np.sqrt(dot(vectors, vectors))
    clear = length > 1e-14
    return np.where(clear, vectors / np.where(clear, length, 1.0), otherwise)
