"""Polygons whose edges can be collapsed and which can be merged, one at a time, without leaving the manifold."""

from __future__ import annotations

import math

import numpy as np

from .polygon_area import area_vector
from .polygon_faces import Edge, PolygonFaces
from .polygon_sides import sharpest_angle, sides_cross

_TURN_DIGITS = 6  # of angles that are compared, so that rounding does not decide


class PolygonEdits(PolygonFaces):
    """Faces as lists of nodes that change; every change is checked before it is made."""

    def collapse(self, edge: Edge, most: float = math.inf, *, may_sharpen: bool = True) -> bool:
        """Collapses an edge to the end that is to stay: a fixed one, or one on the boundary or on a crease.

        Args:
            edge: two nodes, in either order.
            may_sharpen: whether a corner of the faces around it may become sharper than their sharpest one was.
            most: radians by which an inner edge may have turned from its first direction afterwards. If that is finite,
                of two ends that may stay it is the one for which less turns.

        Returns:
            Whether it is an edge and that left a manifold, with no face turned over or with sides that cross; otherwise
            nothing has changed.
        """
        stays, goes = edge[::-1] if self._outranks(*edge[::-1]) else edge
        if math.isinf(most):
            return self._collapse(stays, goes, may_sharpen=may_sharpen)
        ways = [(stays, goes), (goes, stays)][: 2 if self._rank(stays) == self._rank(goes) else 1]
        turned = sorted((round(self._turn(*way), _TURN_DIGITS), k, way) for k, way in enumerate(ways))
        return any(turn <= most and self._collapse(*way, may_sharpen=may_sharpen) for turn, _, way in turned)

    def _turn(self, stays: int, goes: int) -> float:
        """By how much the inner edges of a node that goes are turned at most, radians."""
        there = self.neighbours(stays)
        moved = [node for node in self.neighbours(goes) - there - {stays} if not self.is_on_curve((node, goes))]
        return max((self.directions.turn(node, goes, stays) for node in moved), default=0.0)

    def _collapse(self, stays: int, goes: int, *, may_sharpen: bool) -> bool:
        edge = stays, goes
        is_curve = self.is_on_curve(edge)
        if (
            not self.faces_at(edge)
            or self.fixed[goes]
            or (not is_curve and self.on_curve[stays] and self.on_curve[goes])
        ):
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
        if not self._allowed(changed) or not (may_sharpen or self._keeps_angles(changed)):
            return False
        self.directions.carry(self.neighbours(goes) - self.neighbours(stays) - {stays}, goes, stays)
        return self._apply(changed, goes, stays)

    def _rank(self, node: int) -> tuple[bool, bool]:
        return bool(self.fixed[node]), bool(self.on_curve[node])

    def _outranks(self, node: int, other: int) -> bool:
        """Whether a node stays rather than another; among equals by geometry, so that numbers do not decide."""
        ranks = [(*self._rank(of), len(self.around[of])) for of in (node, other)]
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
        """Takes nodes out of a face that it has alone, apart from fixed ones, while no sides cross."""
        for node in list(self.faces[number]):
            face = self.faces[number]
            if len(face) > 3 and len(self.around[node]) == 1 and not self.fixed[node]:
                without = [other for other in face if other != node]
                normal = self.normals[number]
                if area_vector(self.positions, without) @ normal > 0 and not sides_cross(
                    self.positions[without], normal
                ):
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

    def _keeps_angles(self, changed: dict[int, list[int]]) -> bool:
        """Whether no corner of changed faces is sharper than their sharpest one was."""
        before = min(sharpest_angle(self.positions[self.faces[number]]) for number in changed)
        return min(sharpest_angle(self.positions[face]) for face in changed.values() if face) >= before

    def _keeps_side(self, number: int, face: list[int]) -> bool:
        normal = self.normals[number]
        area = area_vector(self.positions, face)
        ahead = float(area @ normal) > 0.2 * float(np.linalg.norm(area)) * float(np.linalg.norm(normal))
        return ahead and not sides_cross(self.positions[face], normal)

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
