"""Polygons as lists of nodes, and what lies beside what."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from ..fields.frames import Bools, Floats, Ints
from .edge_directions import EdgeDirections
from .polygon_area import area_vector, area_vectors, joined

Edge = tuple[int, int]


class PolygonFaces:
    """Faces as lists of nodes, with the faces around every node.

    Args:
        positions: (N, 3), changed in place.
        faces: nodes counterclockwise, each at least three.
        on_boundary: (N,) bool.
        fixed: (N,) bool: nodes that keep their places.
        creases: (C, 2) nodes of edges that stay edges, such as those along creases; none by default.

    Attributes:
        on_curve: (N,) bool: nodes on the boundary or on creases.
        beside: neighbours of nodes along creases.
        directions: of edges, before anything was changed.
    """

    def __init__(
        self, positions: Floats, faces: list[list[int]], on_boundary: Bools, fixed: Bools, creases: Ints | None = None
    ) -> None:
        self.positions, self.on_curve, self.fixed = positions, on_boundary.copy(), fixed
        self.beside: dict[int, set[int]] = defaultdict(set)
        for a, b in [] if creases is None else creases.tolist():
            self.on_curve[[a, b]] = True
            self.beside[a].add(b)
            self.beside[b].add(a)
        self.faces = {number: list(face) for number, face in enumerate(faces)}
        self.went: dict[int, int] = {}
        self.around: dict[int, set[int]] = defaultdict(set)
        for number, face in self.faces.items():
            for node in face:
                self.around[node].add(number)
        self.normals = dict(zip(self.faces, area_vectors(self.positions, faces), strict=True))
        self.directions = EdgeDirections(positions)

    def place_of(self, node: int) -> int:
        """The node that a node was collapsed to, itself if it was not."""
        while node in self.went:
            node = self.went[node]
        return node

    def area(self, number: int) -> float:
        """Of a face, along the normal that it had at first."""
        first = self.normals[number]
        size = float(np.linalg.norm(first))
        return float(area_vector(self.positions, self.faces[number]) @ first) / size if size else 0.0

    def areas_over(self, full: Floats) -> Floats:
        """Areas of all faces in their order, each as :meth:`area`, over the smallest of some (N,) at their nodes."""
        areas = area_vectors(self.positions, self.faces.values())
        first = np.array([self.normals[number] for number in self.faces])
        size = np.linalg.norm(first, axis=1)
        along = (areas * first).sum(1) / np.where(size > 0, size, np.inf)
        nodes, starts = joined(self.faces.values())
        return np.asarray(along / np.minimum.reduceat(full[nodes], starts))

    def curve_faces(self) -> list[int]:
        """Faces with a node on the boundary or on a crease."""
        nodes, starts = joined(self.faces.values())
        if not len(nodes):
            return []
        has_one = np.logical_or.reduceat(self.on_curve[nodes], starts)
        return [number for number, at in zip(self.faces, has_one, strict=True) if at]

    def sides(self, number: int) -> Iterator[Edge]:
        """The edges of a face."""
        face = self.faces[number]
        return zip(face, face[1:] + face[:1], strict=True)

    def across(self, edge: Edge, number: int) -> int | None:
        """The face on the other side of an edge of a face; None at the boundary."""
        others = [of for of in self.around[edge[0]] & self.around[edge[1]] if of != number]
        others = [of for of in others if self.has_side(of, edge[::-1])]
        return others[0] if len(others) == 1 else None

    def has_side(self, number: int, edge: Edge) -> bool:
        """Whether an edge is one of a face, in its direction."""
        return edge in set(self.sides(number))

    def length(self, edge: Edge) -> float:
        """Of an edge."""
        return float(np.linalg.norm(self.positions[edge[0]] - self.positions[edge[1]]))

    def neighbours(self, node: int) -> set[int]:
        """Nodes at the other ends of the edges of a node."""
        faces = [self.faces[number] for number in self.around[node]]
        at = [face.index(node) for face in faces]
        return {face[k - step] for face, k in zip(faces, at, strict=True) for step in (1, len(face) - 1)}

    def faces_at(self, edge: Edge) -> list[int]:
        """The faces with an edge, in either direction."""
        shared = self.around[edge[0]] & self.around[edge[1]]
        return [number for number in shared if self.has_side(number, edge) or self.has_side(number, edge[::-1])]

    def is_on_curve(self, edge: Edge) -> bool:
        """Whether an edge is one of the boundary or of a crease."""
        return edge[1] in self.beside[edge[0]] or len(self.faces_at(edge)) == 1
