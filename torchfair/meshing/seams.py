"""Values of a map on both sides of the cuts, by those of one side and whole translations."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..fields.frames import FaceFrames, Ints
from .cut_graph import CutGraph

Terms = dict[int, complex]

ROTATIONS = (1, -1j, -1, 1j)
"""By what coordinates ``u + iv`` are multiplied where directions turn by 0 to 3 quarters."""


@dataclass(frozen=True, eq=False)
class Seams:
    """Every corner has a *copy* of its vertex; copies are affine in one value per vertex and in translations.

    A copy is ``unit * value[vertex] + sum_p terms[p] * translation[p]``, all numbers complex, units and terms made of
    1, i, -1, -i. Over an edge with q quarter turns from the left to the right ``c_right = (-i)^q c_left + t``.

    Attributes:
        copies: (F, 3) copy at every corner.
        vertex: (N,) of every copy.
        unit: (N,) complex.
        terms: of the copies that are not the first of their vertex.
        closures: vertex, coefficient of its value and of translations: what has to vanish around vertices.
    """

    copies: Ints
    vertex: Ints
    unit: np.ndarray
    terms: dict[int, Terms]
    closures: list[tuple[int, complex, Terms]]

    def matrices(self, num_vertices: int, num_paths: int) -> tuple[sp.csr_matrix, sp.csr_matrix]:
        """Complex matrices (N, V) and (N, paths) that give copies from values and translations."""
        count = len(self.vertex)
        values = sp.csr_matrix((self.unit, (np.arange(count), self.vertex)), shape=(count, num_vertices))
        entries = [(copy, path, number) for copy, terms in self.terms.items() for path, number in terms.items()]
        rows, columns, numbers = zip(*entries, strict=True) if entries else ((), (), ())
        shape = (count, num_paths)
        return values, sp.csr_matrix((np.asarray(numbers, complex), (rows, columns)), shape=shape)


def translation_terms(graph: CutGraph, edge: int) -> Terms:
    """The translation over a cut edge, by those of the paths."""
    path, along = graph.paths[edge]
    return {path: 1.0 if along else -ROTATIONS[graph.quarters[edge]]}


def find_seams(frames: FaceFrames, graph: CutGraph) -> Seams:
    """The copies of a mesh that is cut open.

    Args:
        frames: of the triangles.
        graph: the cut.
    """
    copies = frames.joined_corners(graph.cut)
    count = int(copies.max()) + 1
    vertex = np.zeros(count, np.int64)
    vertex[copies.ravel()] = frames.triangles.ravel()
    first = np.zeros(len(frames.points), np.int64)
    first[vertex[::-1]] = np.arange(count)[::-1]
    unit: np.ndarray = np.ones(count, complex)
    terms: dict[int, Terms] = {}
    closures: list[tuple[int, complex, Terms]] = []
    for at, links in _links(frames, graph, copies).items():
        known: dict[int, tuple[complex, Terms]] = {int(first[at]): (1.0, {})}
        left = links
        while left:
            waiting = []
            for link in left:
                closure = _follow(graph, known, link)
                if closure is None:
                    waiting.append(link)
                elif closure:
                    closures.append((at, *closure[0]))
            left = waiting
        for copy, (number, sums) in known.items():
            unit[copy], terms[copy] = number, sums
    return Seams(copies, vertex, unit, terms, closures)


Link = tuple[int, int, int]


def _follow(graph: CutGraph, known: dict[int, tuple[complex, Terms]], link: Link) -> list[tuple[complex, Terms]] | None:
    """Passes a cut edge between two copies: learns one from the other, or what is to vanish; None if both are new."""
    f, g, edge = link
    turn, step = ROTATIONS[graph.quarters[edge]], translation_terms(graph, edge)
    if f in known:
        unit, sums = known[f]
        there = turn * unit, _sum((turn, sums), (1.0, step))
        if g not in known:
            known[g] = there
            return []
        unit, sums = known[g]
        return [(unit - there[0], _sum((1.0, sums), (-1.0, there[1])))]
    if g in known:
        unit, sums = known[g]
        back = turn.conjugate() if isinstance(turn, complex) else turn
        known[f] = back * unit, _sum((back, sums), (-back, step))
        return []
    return None


def _sum(*parts: tuple[complex, Terms]) -> Terms:
    total: Terms = defaultdict(complex)
    for factor, terms in parts:
        for path, number in terms.items():
            total[path] += factor * number
    return {path: number for path, number in total.items() if number}


def _links(frames: FaceFrames, graph: CutGraph, copies: Ints) -> dict[int, list[Link]]:
    """For every vertex on the cut: the pairs of copies left and right of its cut edges."""
    links: dict[int, list[Link]] = defaultdict(list)
    for edge in np.flatnonzero(graph.cut).tolist():
        (f, g), (i, j) = frames.faces[edge], frames.corners[edge]
        start, end = frames.edges[edge].tolist()
        links[start].append((int(copies[f, i]), int(copies[g, (j + 1) % 3]), edge))
        links[end].append((int(copies[f, (i + 1) % 3]), int(copies[g, j]), edge))
    return links
