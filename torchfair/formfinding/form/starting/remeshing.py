"""Even triangles: edges are split, collapsed and flipped, and vertices evened out, until all are about as long."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import torch

from ....curves import ClosedCurve
from ....shapes._delaunay import flip_to_delaunay
from .collapses import collapsed
from .patch import Edges, Floats, Ints, Mask, Patch, edges_of, face_vectors, middle_parameters

_LONG, _SHORT = 4.0 / 3.0, 4.0 / 5.0  # of the wanted length: where splitting and collapsing do not undo each other
_PASSES = 12  # of splits or collapses in a round, each of many edges that do not touch
_HALVES = 4  # how often the moves of vertices beside a face that would turn over are taken back

Sides = Callable[[Floats, Ints], Mask]
"""Whether triangles (F, 3) between points (V, 3) lie the right way up."""

Surface = Callable[[Patch], Floats]
"""Where the vertices of a patch belong (V, 3)."""


def remeshed(
    patch: Patch, curves: Sequence[ClosedCurve], sizes: Callable[[Floats], Floats], right: Sides, surface: Surface,
    rounds: int, *, keeps_rim: bool = False,
) -> Patch:  # fmt: skip
    """Edges of the wanted length, on the boundary too, as far as the rim allows.

    Args:
        patch: Triangles; their boundary vertices lie on the curves.
        curves: On which those stay; corners keep their places.
        sizes: Wanted edge lengths (n,) at places (n, 3).
        right: Never becomes False where it was True.
        surface: Puts vertices back where they belong, after every round.
        rounds: How often.
        keeps_rim: Whether boundary edges are not split. Where all boundary vertices are corners, the boundary stays.
    """
    for _ in range(rounds):
        patch = _split(patch, curves, sizes, right, keeps_rim=keeps_rim)
        patch = collapsed(patch, sizes, right, _SHORT, _LONG)
        patch = _flipped(patch, right)
        patch = _evened(patch, right)
        patch = _moved(patch, surface(patch), right)
    return _flipped(patch, right)


# ---- splits --------------------------------------------------------------------------------------------


def _split(
    patch: Patch, curves: Sequence[ClosedCurve], sizes: Callable[[Floats], Floats], right: Sides, *, keeps_rim: bool
) -> Patch:
    for _ in range(_PASSES):
        edges = edges_of(patch.faces)
        p = patch.points[edges.ends]
        ratio = np.linalg.norm(p[:, 1] - p[:, 0], axis=1) / sizes(p.mean(1))
        # An inner edge between two rims is split even if it is short: its ends cannot move apart.
        bridge = ~edges.boundary & (patch.rims[edges.ends] >= 0).all(1)
        ratio = np.where(bridge, np.maximum(ratio, 1.01 * _LONG), ratio)
        chosen = _apart(edges, np.where(edges.boundary & keeps_rim, 0.0, ratio), _LONG)
        grown, made = _with_middles(patch, curves, edges, chosen)
        turned = ~right(grown.points, made)
        if not chosen.size:
            return patch
        if turned.any():  # a boundary edge whose curve bends too far to one side waits for finer neighbours
            bad = np.unique(made[turned].max(1)) - len(patch.points)
            chosen = np.delete(chosen, bad)
            if not chosen.size:
                return patch
            grown, made = _with_middles(patch, curves, edges, chosen)
        patch = grown
    return patch


def _apart(edges: Edges, ratio: Floats, least: float) -> Ints:
    """Edges of a ratio above ``least``, the largest first, no two of one face."""
    candidates = np.flatnonzero(ratio > least)
    order = candidates[np.argsort(-ratio[candidates], kind="stable")]
    rank = np.full(len(edges.ends), len(order))
    rank[order] = np.arange(len(order))
    best = rank[edges.of_faces].min(1, keepdims=True)
    beaten = np.zeros(len(edges.ends), bool)
    beaten[edges.of_faces[rank[edges.of_faces] > best]] = True
    chosen: Ints = candidates[~beaten[candidates]]
    return chosen


def _with_middles(patch: Patch, curves: Sequence[ClosedCurve], edges: Edges, chosen: Ints) -> tuple[Patch, Ints]:
    """The patch with new vertices in the middle of edges, and the faces that are new (in pairs, behind the others)."""
    ends, first = edges.ends[chosen], len(patch.points)
    points, rims = patch.points[ends].mean(1), np.where(edges.boundary[chosen], patch.rims[ends[:, 0]], -1)
    parameters = np.where(rims >= 0, middle_parameters(*patch.parameters[ends].T), 0.0)
    points = on_curves(points, rims, parameters, curves)
    number = np.full(len(edges.ends), -1)
    number[chosen] = first + np.arange(len(chosen))
    middles = number[edges.of_faces]
    cut = (middles >= 0).any(1)
    corner = (middles[cut] >= 0).argmax(1)
    turned = patch.faces[cut][np.arange(cut.sum())[:, None], (corner[:, None] + np.arange(3)) % 3]
    tip, start, end = turned.T
    middle = middles[cut].max(1)
    made = np.concatenate([np.stack([tip, start, middle], 1), np.stack([tip, middle, end], 1)])
    grown = Patch(
        np.concatenate([patch.points, points]), np.concatenate([patch.faces[~cut], made]),
        np.concatenate([patch.rims, rims]), np.concatenate([patch.parameters, parameters]),
        np.concatenate([patch.corners, np.zeros(len(points), bool)]),
    )  # fmt: skip
    return grown, made


def on_curves(points: Floats, rims: Ints, parameters: Floats, curves: Sequence[ClosedCurve]) -> Floats:
    """The points (n, 3) with those that have a curve put there."""
    result = points.copy()
    for number, curve in enumerate(curves):
        mine = rims == number
        result[mine] = curve.at(torch.from_numpy(parameters[mine])).numpy()
    return result


# ---- flips and moves -----------------------------------------------------------------------------------


def _flipped(patch: Patch, right: Sides) -> Patch:
    return patch._replace(faces=flip_to_delaunay(patch.points, patch.faces, right))


def _evened(patch: Patch, right: Sides) -> Patch:
    """Inner vertices in the middle of their neighbours, along the surface."""
    edges = edges_of(patch.faces).ends
    count = len(patch.points)
    total = np.zeros((count, 3))
    for a, b in (edges.T, edges.T[::-1]):
        np.add.at(total, a, patch.points[b])
    way = total / np.bincount(edges.ravel(), minlength=count)[:, None] - patch.points
    normals = np.zeros((count, 3))
    for corner in patch.faces.T:
        np.add.at(normals, corner, face_vectors(patch.points, patch.faces))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True).clip(1e-300)
    way -= (way * normals).sum(1, keepdims=True) * normals
    return _moved(patch, patch.points + way, right)


def _moved(patch: Patch, places: Floats, right: Sides) -> Patch:
    """Inner vertices at their new places, unless a face would turn over: those beside it stay."""
    moves = patch.inside & np.isfinite(places).all(1)
    before = right(patch.points, patch.faces)
    old = face_vectors(patch.points, patch.faces)
    share = np.where(moves, 1.0, 0.0)[:, None]
    for attempt in range(_HALVES + 50):
        trial = patch.points + share * np.where(moves[:, None], places - patch.points, 0.0)
        bad = before & ~right(trial, patch.faces) | ((face_vectors(trial, patch.faces) * old).sum(1) <= 0.0)
        if not bad.any():
            return patch._replace(points=trial)
        share[patch.faces[bad]] *= 0.5 if attempt < _HALVES else 0.0
    return patch
