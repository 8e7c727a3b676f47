"""Which two of the faces around an edge continue each other."""

from __future__ import annotations

import itertools

import numpy as np

from .._names import Ints
from .._sorted_keys import edge_keys, groups_of
from .soup import Floats, Soup

_TIE = 1e-6  # radians


def paired_corners(soup: Soup, places: Ints, chosen: Ints, *, split: bool) -> Ints:
    """Corners (P, 2) from which two faces traverse the same edge.

    Args:
        soup: The faces.
        places: (V,) what counts as one place; edges between the same places are the same.
        chosen: Corners that are looked at.
        split: What becomes of more than two faces around an edge. If true, they are put into the pairs that bend least,
            convex rather than concave where they bend as much, those that are oriented alike before others, and one
            face may be left alone. If false, each makes a pair with the next one, so that all hang together.
    """
    keys = edge_keys(places[soup.corners[chosen]], places[soup.heads[chosen]], len(soup.points))
    order, starts, counts = groups_of(keys)
    if not split:
        follows = np.repeat(np.arange(len(counts)), counts)
        joined = np.flatnonzero(follows[1:] == follows[:-1])
        return np.stack([chosen[order[joined]], chosen[order[joined + 1]]], 1)
    two = starts[counts == 2]
    pairs = [np.stack([chosen[order[two]], chosen[order[two + 1]]], 1)]
    crowds = np.flatnonzero(counts > 2)
    if crowds.size:
        areas, faces, heads = soup.area_vectors()[:, 0], soup.corner_faces, soup.heads
        for crowd in crowds.tolist():
            around = chosen[order[starts[crowd] : starts[crowd] + counts[crowd]]]
            pairs.append(around[_flattest_pairs(soup, places, around, heads[around], areas[faces[around]])])
    return np.concatenate(pairs)


def _flattest_pairs(soup: Soup, places: Ints, around: Ints, heads: Ints, areas: Floats) -> Ints:
    """Pairs (P, 2) of numbers of the corners ``around`` an edge."""
    tails = soup.corners[around]
    edge = soup.points[heads[0], 0] - soup.points[tails[0], 0]
    forward = places[tails] == places[tails[0]]
    normals = _unit(areas)
    inward = _unit(np.cross(normals, np.where(forward[:, None], edge, -edge)))
    bends = np.arccos(np.clip(-inward @ inward.T, -1.0, 1.0))
    concave = normals @ inward.T > 0.0
    candidates = [
        (bool(forward[i] == forward[j]), round(float(bends[i, j]) / _TIE), bool(concave[i, j]), i, j)
        for i, j in itertools.combinations(range(len(around)), 2)
    ]
    free = set(range(len(around)))
    found = []
    for _, _, _, i, j in sorted(candidates):
        if i in free and j in free:
            free -= {i, j}
            found.append((i, j))
    return np.array(found, np.int64).reshape(-1, 2)


def _unit(vectors: Floats) -> Floats:
    units: Floats = vectors / np.maximum(np.linalg.norm(vectors, axis=1, keepdims=True), 1e-300)
    return units


def joined_ends(soup: Soup, pairs: Ints, places: Ints) -> Ints:
    """(2 P, 2) corners at the same end of each pair of edges: their tails and heads, whichever way they run."""
    following = np.arange(1, len(soup.corners) + 1)
    following[soup.offsets[1:] - 1] = soup.offsets[:-1]
    a, b = pairs.T
    same_way = places[soup.corners[a]] == places[soup.corners[b]]
    tails = np.stack([a, np.where(same_way, b, following[b])], 1)
    heads = np.stack([following[a], np.where(same_way, following[b], b)], 1)
    return np.concatenate([tails, heads])
