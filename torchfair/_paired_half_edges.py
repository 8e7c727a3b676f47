"""Edges of an oriented manifold mesh from its half-edges, sorted as words of 64 bits.

All large arrays but the words are results, and are filled some rows at a time: pages that the system fills with zeros
for an array that is needed for one step cost as much as the step.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ._half_edges import HalfEdges, Ints
from ._sorted_keys import WORD

Words = npt.NDArray[np.uint64]

_BLOCK = 1 << 15  # half-edges that are looked at together: few enough for the cache


@dataclass(frozen=True)
class Edges:
    """Undirected edges, interior ones first, each class sorted by its two vertex numbers."""

    vertices: Ints  # (E, 2), in the direction in which the left face traverses the edge
    faces: Ints  # (I, 2) left and right face of the interior edges
    twins: Ints  # (H,) opposite half-edge, -1 on the boundary
    corner_edges: Ints  # (H,) edge of each half-edge


def paired_edges(half: HalfEdges) -> Edges | None:
    """The edges of a mesh; None where one of them is traversed twice in one direction, or words have too few bits.

    A word holds the lower vertex of a half-edge, the higher one, whether it leads down, and its number. Of two
    half-edges that follow each other in their order and differ in direction only the first has the left face.
    """
    places = max(half.corners.size - 1, 0).bit_length()
    if (max(half.num_vertices, 1) ** 2 - 1).bit_length() + 1 + places > WORD:
        return None
    words = _words(half, places)
    words.sort()
    interior = _parts_of_pairs(words, places)
    if interior is None:
        return None
    if interior.all():
        return _edges(half, words.reshape(-1, 2), words[:0], places)
    return _edges(half, words[interior].reshape(-1, 2), words[~interior], places)


def _words(half: HalfEdges, places: int) -> Words:
    words = np.empty(half.corners.size, np.uint64)
    count = np.int64(max(half.num_vertices, 1))
    for part in _blocks(words.size, half.size or 1):
        tails, heads = half.corners[part], half.heads_of(part)
        word = np.minimum(tails, heads)
        word *= count
        word += np.maximum(tails, heads)
        word <<= 1
        word |= tails > heads
        words[part] = word
        words[part] <<= np.uint64(places)
        words[part] |= np.arange(part.start, part.stop, dtype=np.uint64)
    return words


def _parts_of_pairs(words: Words, places: int) -> npt.NDArray[np.bool_] | None:
    """Which of the sorted words have a partner; None if two are of the same edge in the same direction."""
    paired = np.zeros(words.size, bool)
    for part in _blocks(words.size - 1):
        differs = words[part] ^ words[part.start + 1 : part.stop + 1]
        differs >>= np.uint64(places)
        if not differs.all():
            return None
        paired[part] |= differs == 1
    paired[1:] |= paired[:-1] & ~np.append(False, paired[:-2])[: max(words.size - 1, 0)]
    return paired


def _edges(half: HalfEdges, pairs: Words, singles: Words, places: int) -> Edges:
    """Edges of sorted words, (I, 2) of interior edges and (B,) of boundary edges."""
    inner, number = len(pairs), len(pairs) + len(singles)
    vertices, faces = np.empty((number, 2), np.int64), np.empty((inner, 2), np.int64)
    twins, corner_edges = np.empty(half.corners.size, np.int64), np.empty(half.corners.size, np.int64)
    for part in _blocks(inner):
        left, right = _places(pairs[part, 0], places), _places(pairs[part, 1], places)
        vertices[part, 0], vertices[part, 1] = _ends(half, pairs[part, 0], places)
        faces[part, 0], faces[part, 1] = half.faces_at(left), half.faces_at(right)
        twins[left], twins[right] = right, left
        corner_edges[left] = corner_edges[right] = np.arange(part.start, part.stop)
    single = _places(singles, places)
    vertices[inner:, 0], vertices[inner:, 1] = half.corners[single], half.corners[half.next[single]]
    twins[single] = -1
    corner_edges[single] = np.arange(inner, number)
    return Edges(vertices, faces, twins, corner_edges)


def _places(words: Words, places: int) -> Ints:
    return (words & np.uint64((1 << places) - 1)).view(np.int64)


def _ends(half: HalfEdges, words: Words, places: int) -> tuple[Ints, Ints]:
    """Lower and higher vertex."""
    keys = (words >> np.uint64(places + 1)).view(np.int64)
    count = np.int64(max(half.num_vertices, 1))
    lower = keys // count
    return lower, keys - lower * count


def _blocks(size: int, step: int = 1) -> Iterator[slice]:
    """Runs of rows, of a multiple of ``step`` but for the last."""
    each = max(_BLOCK // step, 1) * step
    return (slice(start, min(start + each, size)) for start in range(0, size, each))
