"""What bad stars need: a slide of the vertex, a flip of an edge, or another layout of the whole mesh."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, NamedTuple

import torch
from torch import Tensor

from .._graph import edge_numbers
from .._names import FROM_ZERO, Names
from .._threads import threads_for
from ..errors import MeshError, TorchfairError
from ..geometry import edge_lengths, star_normals
from ..geometry.tangent_basis import tangent_bases
from ..stars import classify_stars, pyramid_self_intersections
from ..topology import Topology
from .diagnosis import Diagnosis

_SLIDES = (0.1, 0.2, 0.35)  # mean edge lengths of the star that a vertex is tried to be slid by
_WAYS = 12
_MANY = 0.2  # share of negatively curved stars that are bad from which on the layout is to blame
_ALIGNED = 0.2  # radians off principal directions up to which a family of edges is worth keeping


@dataclass(frozen=True)
class Remedy:
    """What makes fewer stars around a vertex bad.

    Attributes:
        words: what to do.
        bad_before: bad stars among the vertex and its neighbours: bad saddles, stars that are neither convex nor
            saddles, pyramids that intersect themselves.
        bad_after: those left, measured.
    """

    words: str
    bad_before: int
    bad_after: int

    def as_dict(self) -> dict[str, Any]:
        """For reports."""
        return {"words": self.words, "bad_before": self.bad_before, "bad_after": self.bad_after}


def star_remedy(vertices: Tensor, topology: Topology, vertex: int, *, names: Names = FROM_ZERO) -> Remedy | None:
    """The slide of an inner vertex, or the flip of an edge beside it, after which least stars around it are bad.

    Slides go along the tangent plane, by up to a third of an edge; edges are flipped between triangles. Everything is
    tried and measured on the star and the stars beside it. The shortest slide comes first, slides before flips.

    Args:
        vertices: (V, 3) float64.
        topology: any polygons.
        vertex: an inner vertex.
        names: what vertices are called in words, such as ``names`` of a mesh that was read.

    Returns:
        None where nothing of that leaves fewer bad stars.
    """
    try:
        patch = _Patch(vertices, topology, vertex, names)
    except MeshError:  # faces around it that touch in single vertices are no mesh
        return None
    trials = [_Trial("", patch.vertices, patch.faces), *patch.slides(), *patch.flips()]
    with threads_for(0, vertices.device):
        before, *after = patch.bad(trials)
    least = min(after, default=before)
    if least >= before:
        return None
    return Remedy(trials[1 + after.index(least)].words, before, least)


class _Trial(NamedTuple):
    """Something that can be done, and the patch after it."""

    words: str
    vertices: Tensor
    faces: list[list[int]]


class _Patch:
    """The faces around a vertex and its neighbours, which hold all stars that change."""

    def __init__(self, vertices: Tensor, topology: Topology, vertex: int, names: Names) -> None:
        self._names = names
        start, stop = topology.ring_offsets[vertex : vertex + 2].tolist()
        self._judged = torch.cat([torch.tensor([vertex]), topology.ring_vertices[start:stop]])
        near = torch.isin(topology.corners, self._judged)
        faces = torch.unique(topology.corner_faces[near]).tolist()
        offsets = topology.face_offsets
        chosen = [topology.corners[offsets[face] : offsets[face + 1]].tolist() for face in faces]
        self.numbers = torch.tensor(sorted({v for face in chosen for v in face}))
        place = {v: i for i, v in enumerate(self.numbers.tolist())}
        self.faces = [[place[v] for v in face] for face in chosen]
        self.topology = Topology.from_faces(self.faces, len(place))
        self.vertices, self._vertex = vertices[self.numbers], place[vertex]
        self._own = torch.isin(self.numbers, self._judged)

    def bad(self, trials: list[_Trial]) -> list[int]:
        """Bad stars among those judged after each trial; all are judged at once, beside each other."""
        count = len(self.numbers)
        faces = [[v + count * i for v in face] for i, trial in enumerate(trials) for face in trial.faces]
        topology = Topology.from_faces(faces, count * len(trials))
        vertices = torch.cat([trial.vertices for trial in trials])
        classes = classify_stars(vertices, topology)
        wrong = classes.bad | (pyramid_self_intersections(vertices, topology) > 0)
        numbers: list[int] = (wrong.view(-1, count) & self._own).sum(1).tolist()
        return numbers

    def slides(self) -> list[_Trial]:
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
                made.append(_Trial(words, slid, self.faces))
        return made

    def flips(self) -> list[_Trial]:
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
            made.append(_Trial(words, self.vertices, [*faces, [v, b, a], [b, w, a]]))
        return made


def layout_advice(vertices: Tensor, topology: Topology, diagnosis: Diagnosis, *, names: Names = FROM_ZERO) -> list[str]:
    """What the mesh as a whole needs, in sentences; none if no star is bad.

    Args:
        vertices: (V, 3) float64.
        topology: any polygons.
        diagnosis: of this mesh.
        names: what vertices are called in words, such as ``names`` of a mesh that was read.
    """
    counts = diagnosis.counts()
    negative = counts["negative_angle_defects"]
    bad = counts["bad_saddle"] + counts["neither"]
    if not bad + counts["self_intersecting_pyramids"]:
        return []
    words = f"{bad} of {counts['inner_vertices']} stars are neither convex nor good saddles"
    wrong = counts["bad_saddle"] + counts["neither_with_negative_angle_defect"]
    if not negative or wrong <= _MANY * negative:
        return [f"{words}: few, so that single vertices are worth mending as listed, or all of them by torchfair fair"]
    if not topology.is_triangular:
        remesh = f"torchfair mesh --quads {topology.num_faces}"
        return [f"{words}, too many to mend one by one: lower E by torchfair fair, or remesh by {remesh}"]
    from ..principal import LARGE_MISALIGNMENT, principal_edges_from_directions

    try:
        aligned = principal_edges_from_directions(vertices, topology, allow_exceptions=True)
    except TorchfairError:  # stars without a normal, in a whole component
        return [f"{words}, and there are no principal directions to go by: remesh, or mend degenerate faces first"]
    degrees = math.degrees(aligned.misalignment)
    off = f"the best family of parallel edges is {degrees:.0f} degrees off the nearer principal direction"
    remesh = f"torchfair mesh --triangles {topology.num_faces}"
    if aligned.misalignment > LARGE_MISALIGNMENT:
        return [f"{words}, and {off}: no choice of edges will do; remesh by {remesh}"]
    v, w = map(names.vertex, topology.edges[int(aligned.edges.mask.nonzero()[0])].tolist())
    advice = [f"{words}, and {off}: torchfair symmetric --seed {v} {w} makes saddles of negatively curved stars"]
    if aligned.misalignment > _ALIGNED:
        advice.append(f"edges that far off have to turn, which bends the shape: {remesh} lays them right")
    return advice
