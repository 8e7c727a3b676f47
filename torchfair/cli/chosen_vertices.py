"""Vertices that options name: by their numbers in the file, or by a place near them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from .._names import first_few
from .distances import from_segments, two_nearest
from .errors import CommandError

if TYPE_CHECKING:
    from torch import Tensor

    from ..io import PolygonMesh

NEAR, BOX, TO = "near", "box", "to"
PLACES = {"--handle": 4, "--fix": 1, "--seed": 1, "--on": 1, "--vertex": 1}
"""Options that take numbers and these words, as many as there are, and how many there are at least."""

NUMBERS = "numbers as in the file: from 1 in OBJ files, from 0 in others and in example:NAME"
_SHOWN = 3


def joined_places(words: Sequence[str]) -> list[str]:
    """Arguments in which what follows an option of :data:`PLACES` is one word, so that INPUT may stand behind it."""
    result: list[str] = []
    taken = least = 0
    for word in words:
        if least and not word.startswith("--") and (taken < least or word in (NEAR, BOX, TO) or _is_number(word)):
            result[-1] += f" {word}" if taken else f"={word}"
            taken += 1
        else:
            result.append(word)
            taken, least = 0, PLACES.get(word, 0)
    return result


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True


@dataclass
class ChosenVertices:
    """Finds vertices of one mesh by numbers of its file and by places.

    Attributes:
        mesh: The mesh.
        notes: What was taken for each place, in words, added to as places are looked for.
    """

    mesh: PolygonMesh
    notes: list[str] = field(default_factory=list)

    # ---- by words --------------------------------------------------------------------------------------

    def of(self, option: str, words: str) -> list[int]:
        """Vertices that the words of an option name: numbers, ``near X Y Z`` and ``box X Y Z X Y Z``, mixed.

        Raises:
            CommandError: the words are others, or there is no such vertex.
        """
        found: list[int] = []
        for kind, values in parts_of(option, words, (NEAR, BOX)):
            if kind == NEAR:
                found.append(self.near(option, values))
            else:
                found += self.between(option, values) if kind == BOX else [self.numbered(option, kind)]
        return list(dict.fromkeys(found))

    def handle(self, option: str, words: str) -> tuple[int, list[float]]:
        """A vertex and where it is pulled, of ``VERTEX X Y Z`` or ``near X Y Z to X Y Z``; ``to`` may be left out."""
        parts = [word for word in words.split() if word != TO]
        expected = f"{option}: expected VERTEX X Y Z or near X Y Z to X Y Z, got '{words}'"
        near = parts[:1] == [NEAR]
        places = parts[1:] if near else parts
        if len(places) != (6 if near else 4) or not all(map(_is_number, places)):
            raise CommandError(expected)
        if not all(math.isfinite(float(word)) for word in places):
            raise CommandError(f"{option}: coordinates must be finite numbers, got '{words}'")
        target = [float(word) for word in places[-3:]]
        if near:
            return self.near(option, [float(word) for word in places[:3]]), target
        return self.numbered(option, places[0]), target

    # ---- by number -------------------------------------------------------------------------------------

    def numbered(self, option: str, word: str) -> int:
        """The vertex that has that number in the file."""
        mesh, first = self.mesh, self.mesh.names.first
        total = mesh.topology.num_vertices if mesh.vertex_map is None else len(mesh.vertex_map)
        number = int(word) - first if word.lstrip("+-").isdigit() else -1
        if not 0 <= number < total:
            numbers = f"vertices are numbered {first} to {first + total - 1} in the file"
            raise CommandError(f"{option}: {numbers}, got {word}")
        if mesh.vertex_map is not None:
            number = int(mesh.vertex_map[number])
        if number < 0:
            raise CommandError(f"{option}: vertex {word} is one that no face uses, and was dropped by --repair")
        return number

    # ---- by place --------------------------------------------------------------------------------------

    def near(self, option: str, place: Sequence[float]) -> int:
        """The vertex of a face that is nearest to a place, if it is clear which one is meant.

        Raises:
            CommandError: the nearest one is farther away than its longest edge and the mean edge, or another one is
                about as near.
        """
        import torch

        vertices, used = self.mesh.vertices.double(), self.mesh.topology.valences > 0
        away = torch.linalg.vector_norm(vertices - torch.tensor(place, dtype=torch.float64), dim=1)
        away = torch.where(used, away, math.inf)
        order, distances, is_clear = two_nearest(away)
        vertex, distance = order[0], distances[0]
        words = f"{option} near {_text(place)}"
        reach = self._reach(vertex)
        if distance > reach:
            raise CommandError(
                f"{words}: no vertex is there; the nearest one, {self._told(vertex)}, is {distance:.4g} away, more "
                f"than its edges ({reach:.4g}). Is the place in the unit of the file?"
            )
        if not is_clear:
            raise CommandError(
                f"{words}: which vertex is meant is not clear: {self._told(vertex)} is {distance:.4g} away, "
                f"{self._told(order[1])} {distances[1]:.4g}. Give a place nearer to one, or its number"
                f"{', or weld them by --weld' if distances[1] == 0.0 else ''}"
            )
        self.notes.append(f"{words}: {self._told(vertex)}, {distance:.4g} away")
        return vertex

    def between(self, option: str, corners: Sequence[float]) -> list[int]:
        """Vertices of faces between two opposite corners of a box."""
        low = [min(pair) for pair in zip(corners[:3], corners[3:], strict=True)]
        high = [max(pair) for pair in zip(corners[:3], corners[3:], strict=True)]
        vertices = self.mesh.vertices.double()
        inside = (vertices >= vertices.new_tensor(low)).all(1) & (vertices <= vertices.new_tensor(high)).all(1)
        found: list[int] = (inside & (self.mesh.topology.valences > 0)).nonzero().squeeze(1).tolist()
        if not found:
            raise CommandError(f"{option} box: no vertex of the mesh is between {_text(low)} and {_text(high)}")
        some = ", ".join(map(self.mesh.names.vertex, found[:_SHOWN])) + ", ..." * (len(found) > _SHOWN)
        self.notes.append(f"{option} box: {len(found)} vertices, {some}")
        return found

    def edge_near(self, option: str, place: Sequence[float]) -> int:
        """The edge that is nearest to a place, if it is clear which one is meant."""
        import torch

        edges = self.mesh.vertices.double()[self.mesh.topology.edges]
        away = from_segments(torch.tensor(place, dtype=torch.float64), edges)
        order, (distance, *_), is_clear = two_nearest(away)
        edge, words = order[0], f"{option} near {_text(place)}"
        if distance > float((edges[edge, 1] - edges[edge, 0]).norm()):
            raise CommandError(f"{words}: no edge is there; the nearest is {distance:.4g} away")
        if not is_clear:
            pairs = " and ".join(map(self.edge_name, order))
            raise CommandError(f"{words}: which edge is meant is not clear, {pairs} are as near: aim at its middle")
        self.notes.append(f"{words}: the edge {self.edge_name(edge)}, {distance:.4g} away")
        return edge

    # ---- in words --------------------------------------------------------------------------------------

    def names_of(self, vertex: int) -> str:
        """All vertices of the file that are this one, such as after welding, with a verb for what happens to them."""
        mesh, first = self.mesh, self.mesh.names.first
        if mesh.vertex_map is None:
            return f"vertex {mesh.names.vertex(vertex)} is"
        numbers = (mesh.vertex_map == vertex).nonzero().squeeze(1) + first
        if len(numbers) < 2:
            return f"vertex {mesh.names.vertex(vertex)} is"
        return f"vertices {first_few(numbers.tolist(), len(numbers))} of the file are one, which is"

    def edge_name(self, edge: int) -> str:
        """Numbers of the ends of an edge in the file."""
        return " - ".join(self.mesh.names.vertex(v) for v in self.mesh.topology.edges[edge].tolist())

    def _told(self, vertex: int) -> str:
        return f"vertex {self.mesh.names.vertex(vertex)} at {_text(self.mesh.vertices[vertex].tolist())}"

    def _reach(self, vertex: int) -> float:
        """The longest edge at a vertex, or the mean edge if that is longer."""
        from ..geometry import edge_lengths

        lengths: Tensor = edge_lengths(self.mesh.vertices.double(), self.mesh.topology)
        own = lengths[(self.mesh.topology.edges == vertex).any(1)]
        return max(float(own.max()), float(lengths.mean()))


def faces_of_file(option: str, numbers: Sequence[int], mesh: PolygonMesh) -> tuple[int, ...]:
    """Faces of a mesh that an option names by their numbers in its file."""
    count, names = mesh.topology.num_faces, mesh.names
    rows = range(count) if names.faces is None else names.faces.tolist()
    faces = {names.first + row: face for face, row in enumerate(rows)}
    wrong = [number for number in numbers if number not in faces]
    if wrong:
        ends = f"{min(faces)} to {max(faces)}"
        raise CommandError(f"{option}: faces are numbered {ends} in the file, without those dropped, got {wrong[0]}")
    return tuple(faces[number] for number in numbers)


def parts_of(option: str, text: str, kinds: Sequence[str]) -> Iterator[tuple[str, list[float]]]:
    """Each number as ``(word, [])``, each place as ``(near or box, coordinates)``."""
    words = text.split()
    expected = f"{option}: expected vertex numbers, 'near X Y Z' or 'box X Y Z X Y Z', got '{text}'"
    at = 0
    while at < len(words):
        kind, size = words[at], {NEAR: 3, BOX: 6}.get(words[at], 0)
        values = words[at + 1 : at + 1 + size]
        if kind not in kinds and not kind.lstrip("+-").isdigit():
            raise CommandError(expected)
        if len(values) != size or not all(map(_is_number, values)):
            raise CommandError(expected)
        numbers = [float(value) for value in values]
        if not all(map(math.isfinite, numbers)):
            raise CommandError(expected)
        yield kind, numbers
        at += 1 + size


def _text(place: Sequence[float]) -> str:
    return " ".join(f"{x:.6g}" for x in place)
