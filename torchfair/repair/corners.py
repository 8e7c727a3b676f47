"""Faces that come twice to the same vertex, and edges without length."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .._graph import connected
from .._names import Ints, few, few_groups
from .soup import Soup


def without_repeated_corners(soup: Soup) -> Soup:
    """Every face cut where it comes back to a vertex; pieces of fewer than three corners are dropped.

    A corner that stands twice is left once (1 2 3 3), a spike is taken off (1 2 3 2), and two loops that touch become
    two faces.
    """
    keys = np.sort(soup.corner_faces * np.int64(max(len(soup.points), 1)) + soup.corners)
    repeating = np.unique(keys[1:][keys[1:] == keys[:-1]] // max(len(soup.points), 1))
    if not repeating.size:
        return soup
    pieces = {face: _loops(soup.corners, soup.offsets[face], soup.offsets[face + 1]) for face in repeating.tolist()}
    kept = np.ones(len(soup.faces), np.bool_)
    kept[repeating] = False
    good = soup.keeping(kept)
    loops = [(face, loop) for face, found in pieces.items() for loop in found]
    order = np.argsort([*np.flatnonzero(kept), *(face for face, _ in loops)], kind="stable")
    untouched = np.split(np.flatnonzero(np.repeat(kept, soup.sizes)), good.offsets[1:-1]) if kept.any() else []
    corners = [*untouched, *(np.array(loop) for _, loop in loops)]
    chosen = [corners[i] for i in order.tolist() if len(corners[i])]
    places = np.concatenate(chosen).astype(np.int64) if chosen else np.zeros(0, np.int64)
    sizes = np.array([len(piece) for piece in chosen], np.int64)
    result = replace(
        soup,
        corners=soup.corners[places],
        origins=soup.origins[places],
        offsets=np.concatenate([[0], np.cumsum(sizes)]).astype(np.int64),
        faces=soup.faces[soup.corner_faces[places[np.cumsum(sizes) - sizes]]] if chosen else soup.faces[:0],
    )
    gone = [face for face, found in pieces.items() if not found]
    shorter = [face for face, found in pieces.items() if found]
    if shorter:
        result = result.saying(
            f"dropped repeated corners of {len(shorter)} face(s): faces ", few("face", soup.faces[shorter]), "."
        )
    if gone:
        result = result.saying(
            f"dropped {len(gone)} face(s) with fewer than three different corners: faces ",
            few("face", soup.faces[gone]),
            ".",
        )
    return result


def _loops(corners: Ints, start: int, end: int) -> list[list[int]]:
    """Corners of each piece of a face that comes back to a vertex; the piece with its first corner comes first."""
    loops: list[list[int]] = []
    path: list[int] = []
    at: dict[int, int] = {}
    for place in range(start, end):
        vertex = int(corners[place])
        if vertex in at:
            loop = path[at[vertex] + 1 :]
            del path[at[vertex] + 1 :]
            for left in loop:
                del at[int(corners[left])]
            loops.append([place, *loop])
        else:
            at[vertex] = len(path)
            path.append(place)
    return [loop for loop in (path, *loops) if len(loop) > 2]


def without_zero_edges(soup: Soup) -> Soup:
    """The two ends of every edge of length zero made one vertex; nothing is done where no face has any area."""
    same = (soup.points[soup.corners] == soup.points[soup.heads]).all((1, 2)) & (soup.corners != soup.heads)
    if not same.any() or soup.without_area().all():
        return soup
    pairs = np.stack([soup.corners[same], soup.heads[same]], 1)
    labels = connected(pairs, len(soup.points))
    _, first = np.unique(labels, return_index=True)
    lower = np.unique(np.sort(pairs, axis=1), axis=0)
    named = ([("vertex", int(soup.vertices[v])), " and ", ("vertex", int(soup.vertices[w]))] for v, w in lower.tolist())
    told = soup.saying(
        f"merged the ends of {len(lower)} edge(s) of length zero: vertices ", few_groups(named, len(lower)), "."
    )
    return without_repeated_corners(told.renaming(first[labels]))
