"""Short edges of a triangle mesh become vertices."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from .patch import Edges, Floats, Ints, Mask, Patch, edges_of, face_vectors, smallest_angles

_PASSES = 30
_LEAST_ANGLE = np.radians(12.0)  # of new faces, unless one was smaller before


def collapsed(
    patch: Patch, sizes: Callable[[Floats], Floats], right: Callable[[Floats, Ints], Mask], short: float, long: float
) -> Patch:
    """Collapses edges shorter than ``short`` wanted lengths.

    Not so where longer edges than ``long`` would come of it, or faces that are flat or turned over. Corners and the
    boundary stay: an inner vertex goes to the boundary, and one of the boundary to the next one.
    """
    refused: set[tuple[int, int]] = set()
    for _ in range(_PASSES):
        edges = edges_of(patch.faces)
        p = patch.points[edges.ends]
        wanted = sizes(p.mean(1))
        ratio = np.linalg.norm(p[:, 1] - p[:, 0], axis=1) / wanted
        candidates = np.flatnonzero((ratio < short) & _allowed(patch, edges))
        known = np.array([tuple(pair) not in refused for pair in edges.ends[candidates].tolist()], bool)
        candidates = candidates[known]
        if not candidates.size:
            break
        chosen = _far_apart(len(patch.points), edges, candidates[np.argsort(ratio[candidates], kind="stable")])
        done, failed = _collapse(patch, edges, chosen, long * wanted, right)
        refused |= {tuple(pair) for pair in edges.ends[failed].tolist()}
        patch = done
    return patch.without_unused()


def _allowed(patch: Patch, edges: Edges) -> Mask:
    """Edges that can go without gluing anything: their ends have no common neighbours but the tips beside them."""
    from scipy.sparse import coo_array

    v, w = edges.ends.T
    count = len(patch.points)
    ones = np.ones(2 * len(v), np.int32)
    graph = coo_array((ones, (np.concatenate([v, w]), np.concatenate([w, v]))), shape=(count, count)).tocsr()
    common = np.asarray((graph @ graph)[v, w]).ravel()
    on_rim = patch.rims[edges.ends] >= 0
    free = ~on_rim.all(1) | (edges.boundary & ~patch.corners[edges.ends].all(1) & _long_rim(patch)[v])
    allowed: Mask = (common == np.where(edges.boundary, 1, 2)) & free
    return allowed


def _long_rim(patch: Patch) -> Mask:
    """(V,) whether the curve of a vertex has more than six vertices."""
    sizes = np.bincount(patch.rims[~patch.inside])
    return ~patch.inside & (sizes[np.maximum(patch.rims, 0)] > 6)


def _far_apart(count: int, edges: Edges, ordered: Ints) -> Ints:
    """The first of the ordered edges, and of the others those whose surroundings do not meet."""
    rank = np.full(count, len(ordered))
    order = np.arange(len(ordered))
    for end in edges.ends[ordered].T:
        np.minimum.at(rank, end, order)
    around = rank.copy()
    for a, b in (edges.ends.T, edges.ends.T[::-1]):
        np.minimum.at(around, a, rank[b])
    chosen: Ints = ordered[around[edges.ends[ordered]].min(1) == order]
    return chosen


def _collapse(
    patch: Patch, edges: Edges, chosen: Ints, longest: Floats, right: Callable[[Floats, Ints], Mask]
) -> tuple[Patch, Ints]:
    """The patch without the chosen edges, and those that had to stay."""
    kept, gone, places = _targets(patch, edges.ends[chosen])
    owner = np.full(len(patch.points), -1)  # which of the chosen edges moves a vertex
    owner[kept] = owner[gone] = np.arange(len(chosen))
    points, numbers = patch.points.copy(), np.arange(len(patch.points))
    points[kept], numbers[gone] = places, kept
    corner_owner = owner[patch.faces]
    touched = corner_owner.max(1)
    whole = np.flatnonzero((touched >= 0) & ((corner_owner >= 0).sum(1) == 1))
    new = numbers[patch.faces[whole]]
    old, now = (face_vectors(p, f) for p, f in ((patch.points, patch.faces[whole]), (points, new)))
    sides = np.linalg.norm(points[new] - points[np.roll(new, 1, axis=1)], axis=2).max(1)
    angle = smallest_angles(points, new)
    least = np.minimum(_LEAST_ANGLE, smallest_angles(patch.points, patch.faces[whole]))
    bad = ((old * now).sum(1) <= 0.0) | (angle < least) | (sides > longest[chosen[touched[whole]]])
    bad |= right(patch.points, patch.faces[whole]) & ~right(points, new)
    failed = np.zeros(len(chosen), bool)
    failed[touched[whole[bad]]] = True
    good = ~failed
    points, numbers = patch.points.copy(), np.arange(len(patch.points))
    points[kept[good]], numbers[gone[good]] = places[good], kept[good]
    faces = numbers[patch.faces]
    faces = faces[(faces != np.roll(faces, 1, axis=1)).all(1)]
    return patch._replace(points=points, faces=faces), chosen[failed]


def _targets(patch: Patch, ends: Ints) -> tuple[Ints, Ints, Floats]:
    """Which end stays, which goes, and where the one that stays is put."""
    weight = (patch.rims[ends] >= 0).astype(int) + patch.corners[ends]
    swap = weight[:, 1] > weight[:, 0]
    kept, gone = np.where(swap[:, None], ends[:, ::-1], ends).T
    middle = patch.points[ends].mean(1)
    places = np.where((weight.max(1) == 0)[:, None], middle, patch.points[kept])
    return kept, gone, places
