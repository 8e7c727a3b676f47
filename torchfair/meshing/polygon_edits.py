"""Polygons whose edges can be collapsed and which can be merged, one at a time, without leaving the manifold."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from ..fields.frames import Bools, Floats, Ints
from .polygon_area import area_vector

Edge = tuple[int, int]


class PolygonEdits:
    """Faces as lists of nodes that change; every change is checked before it is made.

    Args:
        positions: (N, 3), changed in place.
        faces: nodes counterclockwise, each at least three.
        on_boundary: (N,) bool.
        fixed: (N,) bool: nodes that keep their places.
        creases: (C, 2) nodes of edges that stay edges, such as those along creases; none by default.

    Attributes:
        on_curve: (N,) bool: nodes on the boundary or on creases.
        beside: neighbours of nodes along creases.
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
        self.normals = {number: area_vector(self.positions, face) for number, face in self.faces.items()}

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

    def curve_faces(self) -> list[int]:
        """Faces with a node on the boundary or on a crease."""
        return [number for number, face in self.faces.items() if self.on_curve[face].any()]

    def sides(self, number: int) -> Iterator[Edge]:
        """The edges of a face."""
        face = self.faces[number]
        return zip(face, face[1:] + face[:1], strict=True)

    def across(self, edge: Edge, number: int) -> int | None:
        """The face on the other side of an edge of a face; None at the boundary."""
        others = [f for f in self.around[edge[0]] & self.around[edge[1]] if f != number and self._has(f, edge[::-1])]
        return others[0] if len(others) == 1 else None

    def _has(self, number: int, edge: Edge) -> bool:
        return edge in set(self.sides(number))

    def length(self, edge: Edge) -> float:
        """Of an edge."""
        return float(np.linalg.norm(self.positions[edge[0]] - self.positions[edge[1]]))

    def collapse(self, edge: Edge) -> bool:
        """Collapses an edge to the end that is to stay: a fixed one, or one on the boundary or on a crease.

        Args:
            edge: two nodes, in either order.

        Returns:
            Whether it is an edge and that left a manifold without faces turned over; otherwise nothing has changed.
        """
        stays, goes = edge
        if self._outranks(goes, stays):
            stays, goes = goes, stays
        shared = self.around[stays] & self.around[goes]
        sides = sum(self._has(number, edge) or self._has(number, edge[::-1]) for number in shared)
        is_curve = sides == 1 or stays in self.beside[goes]
        if not sides or self.fixed[goes] or (not is_curve and self.on_curve[stays] and self.on_curve[goes]):
            return False
        if self.beside[stays] & self.beside[goes] or (self.beside[goes] and stays not in self.beside[goes]):
            return False
        changed: dict[int, list[int]] = {}
        for number in self.around[stays] | self.around[goes]:
            face = [stays if node == goes else node for node in self.faces[number]]
            face = [node for k, node in enumerate(face) if node != face[k - 1]]
            if len(set(face)) != len(face):
                return False
            changed[number] = face if len(face) >= 3 else []
        return self._allowed(changed) and self._apply(changed, goes, stays)

    def _outranks(self, node: int, other: int) -> bool:
        """Whether a node stays rather than another; among equals by geometry, so that numbers do not decide."""
        ranks = [(bool(self.fixed[of]), bool(self.on_curve[of]), len(self.around[of])) for of in (node, other)]
        if ranks[0] != ranks[1]:
            return ranks[0] > ranks[1]
        areas = [sum(sorted(map(self.area, self.around[of]))) for of in (node, other)]
        return areas[0] > areas[1]

    def merge(self, number: int, edge: Edge) -> bool:
        """Makes one face of a face and its neighbour across an edge; see :meth:`collapse`."""
        other = self.across(edge, number)
        if other is None or edge[1] in self.beside[edge[0]]:
            return False
        ours, theirs = self.faces[number], self.faces[other]
        i, j = ours.index(edge[1]), theirs.index(edge[0])
        face = ours[i:] + ours[:i] + (theirs[j:] + theirs[:j])[1:-1]
        if len(set(face)) != len(face):
            return False
        changed = {number: face, other: []}
        if not self._allowed(changed):
            return False
        self.normals[number] = self.normals[number] + self.normals[other]
        return self._apply(changed)

    def drop_straight_nodes(self, number: int) -> None:
        """Takes nodes out of a face that it has alone, apart from fixed ones."""
        for node in list(self.faces[number]):
            face = self.faces[number]
            if len(face) > 3 and len(self.around[node]) == 1 and not self.fixed[node]:
                without = [other for other in face if other != node]
                if area_vector(self.positions, without) @ self.normals[number] > 0:
                    self.faces[number] = without
                    del self.around[node]

    def _allowed(self, changed: dict[int, list[int]]) -> bool:
        faces = [face for face in changed.values() if face]
        if not faces or len({frozenset(face) for face in faces}) != len(faces):
            return False
        nodes = {node for number in changed for node in self.faces[number]}
        nodes = {node for node in nodes if any(node in face for face in faces) or self.around[node] - changed.keys()}
        if not all(self._is_fan(node, changed) for node in nodes):
            return False
        return all(self._keeps_side(number, face) for number, face in changed.items() if face)

    def _keeps_side(self, number: int, face: list[int]) -> bool:
        normal = self.normals[number]
        area = area_vector(self.positions, face)
        return float(area @ normal) > 0.2 * float(np.linalg.norm(area)) * float(np.linalg.norm(normal))

    def _is_fan(self, node: int, changed: dict[int, list[int]]) -> bool:
        """Whether the faces around a node are one fan, open or closed."""
        after: dict[int, int] = {}
        for number in self.around[node] | {n for n, face in changed.items() if node in face}:
            face = changed.get(number, self.faces[number])
            if node not in face:
                continue
            k = face.index(node)
            if face[(k + 1) % len(face)] in after:
                return False
            after[face[(k + 1) % len(face)]] = face[k - 1]
        starts = after.keys() - set(after.values())
        if len(starts) > 1 or not after:
            return False
        at = first = next(iter(starts)) if starts else next(iter(after))
        for step in range(1, len(after) + 1):
            at = after[at]
            if at == first or at not in after:
                return step == len(after) and (at == first or bool(starts))
        return False

    def _apply(self, changed: dict[int, list[int]], gone: int | None = None, stays: int | None = None) -> bool:
        for number, face in changed.items():
            for node in self.faces[number]:
                self.around[node].discard(number)
            if not face:
                del self.faces[number]
                continue
            self.faces[number] = face
            for node in face:
                self.around[node].add(number)
        if gone is not None and stays is not None:
            del self.around[gone]
            self.went[gone] = stays
            self.on_curve[stays] |= self.on_curve[gone]
            for node in self.beside.pop(gone, set()) - {stays}:
                self.beside[node] ^= {gone, stays}
                self.beside[stays].add(node)
            self.beside[stays].discard(gone)
        return True
