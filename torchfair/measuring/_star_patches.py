"""The faces around a star and the stars beside it, and what can be tried to mend them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from .._graph import edge_numbers
from .._names import Names
from ..geometry import edge_lengths, star_normals
from ..geometry.tangent_basis import tangent_bases
from ..stars import classify_stars, pyramid_self_intersections
from ..topology import Topology

_SLIDES = (0.1, 0.2, 0.35)  # mean edge lengths of the star that a vertex is tried to be slid by
_WAYS = 12


class Near(NamedTuple):
    """What of a mesh is around a vertex.

    Attributes:
        judged: (n,) the vertex and its neighbours.
        faces: all that have one of these, as lists of vertices, in the order of the mesh.
    """

    judged: Tensor
    faces: list[list[int]]


class Trial(NamedTuple):
    """Something that can be done, and the patch after it."""

    words: str
    vertices: Tensor
    faces: list[list[int]]


def surroundings(topology: Topology, chosen: Sequence[int]) -> list[Near]:
    """What is around each of some vertices."""
    rings = [topology.ring_vertices[slice(*topology.ring_offsets[v : v + 2].tolist())] for v in chosen]
    judged = [torch.cat([torch.tensor([v]), ring]) for v, ring in zip(chosen, rings, strict=True)]
    # All corners of the mesh are looked at once, those beside the chosen vertices for each of them.
    any_judged = torch.zeros(topology.num_vertices, dtype=torch.bool)
    any_judged[torch.cat([torch.empty(0, dtype=torch.int64), *judged])] = True
    corners = torch.nonzero(any_judged[topology.corners]).squeeze(1)
    vertices, faces, offsets = topology.corners[corners], topology.corner_faces[corners], topology.face_offsets
    found = []
    for own in judged:
        numbers = torch.unique(faces[torch.isin(vertices, own)]).tolist()
        found.append(Near(own, [topology.corners[offsets[face] : offsets[face + 1]].tolist() for face in numbers]))
    return found


class Patch:
    """The faces around a vertex and its neighbours, which hold all stars that change.

    Raises:
        MeshError: where they touch in single vertices.
    """

    def __init__(self, vertices: Tensor, near: Near, vertex: int, names: Names) -> None:
        self._names = names
        self.numbers = torch.tensor(sorted({v for face in near.faces for v in face}))
        place = {v: i for i, v in enumerate(self.numbers.tolist())}
        self.faces = [[place[v] for v in face] for face in near.faces]
        self.topology = Topology.from_faces(self.faces, len(place))
        self.vertices, self._vertex = vertices[self.numbers], place[vertex]
        self.judged = torch.isin(self.numbers, near.judged)

    def trials(self) -> list[Trial]:
        """Nothing, then slides, the shortest first, then flips."""
        return [Trial("", self.vertices, self.faces), *self._slides(), *self._flips()]

    def _slides(self) -> list[Trial]:
        """Of the vertex, along its tangent plane, the shortest first."""
        lengths, ends = edge_lengths(self.vertices, self.topology), self.topology.edges
        edge = float(lengths[(ends == self._vertex).any(1)].mean())
        first, second = tangent_bases(star_normals(self.vertices, self.topology))[self._vertex]
        made = []
        for share in _SLIDES:
            for way in range(_WAYS):
                angle = math.tau * way / _WAYS
                slid = self.vertices.clone()
                slid[self._vertex] += share * edge * (math.cos(angle) * first + math.sin(angle) * second)
                x, y, z = slid[self._vertex].tolist()
                words = f"slide it by {share:g} of its edges, to {x:.6g} {y:.6g} {z:.6g}"
                made.append(Trial(words, slid, self.faces))
        return made

    def _flips(self) -> list[Trial]:
        """Of edges between two triangles, one of which has the vertex."""
        made = []
        corners = [set(face) for face in self.faces]
        for number, (left, right) in enumerate(self.topology.interior_edge_faces.tolist()):
            v, w = self.topology.edges[number].tolist()
            if (
                len(corners[left]) != 3
                or len(corners[right]) != 3
                or self._vertex not in corners[left] | corners[right]
            ):
                continue
            a, b = (corners[left] - {v, w}).pop(), (corners[right] - {v, w}).pop()
            if int(edge_numbers(self.topology, torch.tensor([[a, b]]))[0]) >= 0:
                continue
            faces = [face for i, face in enumerate(self.faces) if i not in (left, right)]
            names = [self._names.vertex(int(self.numbers[i])) for i in (v, w, a, b)]
            words = "flip the edge {} {} to {} {}".format(*names)
            made.append(Trial(words, self.vertices, [*faces, [v, b, a], [b, w, a]]))
        return made


def bad_stars(patches: Sequence[Patch], trials: Sequence[Sequence[Trial]]) -> list[list[int]]:
    """Bad stars among those judged in each patch, after each of its trials; all are judged at once."""
    faces: list[list[int]] = []
    vertices, judged, sizes = [], [], []
    count = 0
    for patch, tried in zip(patches, trials, strict=True):
        for trial in tried:
            faces += [[v + count for v in face] for face in trial.faces]
            vertices.append(trial.vertices)
            judged.append(patch.judged)
            sizes.append(len(trial.vertices))
            count += sizes[-1]
    if not count:
        return [[] for _ in patches]
    topology, positions = Topology.from_faces(faces, count), torch.cat(vertices)
    wrong = classify_stars(positions, topology).bad | (pyramid_self_intersections(positions, topology) > 0)
    numbers = iter([int(part.sum()) for part in torch.split(wrong & torch.cat(judged), sizes)])
    return [[next(numbers) for _ in tried] for tried in trials]
