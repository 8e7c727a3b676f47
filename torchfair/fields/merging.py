"""Singular vertices that are too close to each other are merged."""

from __future__ import annotations

import itertools

import numpy as np
import scipy.sparse as sp
import torch
from scipy.sparse.csgraph import dijkstra

from .._graph import edge_numbers
from .direction_field import Symmetry, connection_laplacian, hermitian_solver
from .directions import Directions
from .frames import Bools, FaceFrames, Floats, Ints
from .matchings import QUARTER, vertex_charges

_LOOSE = 0.05  # confidence beside moved singular vertices, relative
_RINGS = 2  # around them
_ROUNDS = 8
_MOST_POSITIVE = {4: 1, 2: 2}  # four times the index where three quads or triangles meet, by symmetry
_MOST_NEGATIVE = -4  # four times the index of a merged vertex: eight quads meet


def merge_singularities(
    frames: FaceFrames,
    angles: Floats,
    matched: Ints,
    directions: Directions,
    smoothing: float,
    radius: float,
    symmetry: Symmetry = 4,
    stay: Bools | None = None,
) -> tuple[Floats, Ints]:
    """Merges singular vertices of a field within a radius: opposite ones cancel, negative ones become one.

    Two vertices of valence 5 become one of valence 6, as at a monkey saddle, four one of valence 8. The change is one
    of whole numbers along a shortest path; angles are solved for again.

    Args:
        frames: of the triangles.
        angles: (F,) of the field.
        matched: (I,) quarter turns over edges.
        directions: principal directions.
        smoothing: as for the field.
        radius: along edges.
        symmetry: of the field, 2 or 4.
        stay: (V,) bool: vertices that keep their index; those that have none take that of a singular vertex within
            the radius. None by default.

    Returns:
        Angles (F,) and matchings (I,); those given, where nothing is to be merged.
    """
    trust = frames.at_vertices(directions.confidence)
    moved, touched = _split(frames, matched, vertex_charges(frames, angles, matched), trust, radius, symmetry)
    for _ in range(_ROUNDS):
        charges = vertex_charges(frames, angles, moved)
        again, beside = _merged(frames, moved, charges if stay is None else np.where(stay, 0, charges), trust, radius)
        if not beside.any():
            break
        moved, touched = again, touched | beside
    if stay is not None:
        moved, beside = _onto(frames, moved, vertex_charges(frames, angles, moved), stay, radius)
        touched |= beside
    if not touched.any():
        return angles, matched
    return refitted(frames, angles, moved, directions, smoothing, touched, symmetry), moved


def _merged(frames: FaceFrames, matched: Ints, charges: Ints, trust: Floats, radius: float) -> tuple[Ints, Bools]:
    """Matchings with pairs of singular vertices moved to where directions are trusted least on the way between them."""
    size = len(frames.points)
    touched = np.zeros(size, bool)
    singular = np.flatnonzero(charges)
    if len(singular) < 2:
        return matched, touched
    distance, before = dijkstra(inner_edges(frames), indices=singular, limit=radius, return_predecessors=True)
    near = distance[:, singular]
    rows, columns = np.nonzero(np.triu(np.isfinite(near), 1))
    free = set(singular.tolist())
    steps: list[tuple[int, int, int]] = []
    for place in np.argsort(near[rows, columns], kind="stable"):
        row, goal = rows[place], int(singular[columns[place]])
        start = int(singular[row])
        together = charges[start] + charges[goal]
        if start not in free or goal not in free or not _MOST_NEGATIVE <= together <= 0:
            continue
        free -= {start, goal}
        path = [goal]
        while path[-1] != start:
            path.append(int(before[row, path[-1]]))
        middle = int(np.argmin(trust[path]))
        steps += [(a, b, int(charges[goal])) for a, b in itertools.pairwise(path[: middle + 1])]
        steps += [(b, a, int(charges[start])) for a, b in itertools.pairwise(path[middle:])]
        touched[path] = True
    return carried_charges(frames, matched, steps), touched


def _onto(frames: FaceFrames, matched: Ints, charges: Ints, stay: Bools, radius: float) -> tuple[Ints, Bools]:
    """Matchings with singular vertices moved onto vertices without an index that stay, the nearest first."""
    touched = np.zeros(len(frames.points), bool)
    singular, free = np.flatnonzero((charges != 0) & ~stay), np.flatnonzero((charges == 0) & stay & ~frames.is_boundary)
    steps: list[tuple[int, int, int]] = []
    for path in nearest_paths(inner_edges(frames), singular, free, radius):
        steps += [(a, b, int(charges[path[-1]])) for a, b in itertools.pairwise(path[::-1])]
        touched[path] = True
    return carried_charges(frames, matched, steps), touched


def _split(
    frames: FaceFrames, matched: Ints, charges: Ints, trust: Floats, radius: float, symmetry: Symmetry
) -> tuple[Ints, Bools]:
    """Matchings with vertices of too large an index split, where fewer than three faces would meet.

    One part after the other goes as far as the radius, and to neighbours at least, each as far from those before as it
    can, among vertices inside.
    """
    touched, graph = np.zeros(len(frames.points), bool), inner_edges(frames)
    most = _MOST_POSITIVE[symmetry]
    for vertex in np.flatnonzero(charges > most).tolist():
        reach = max(radius, float(graph[vertex].data.max(initial=0.0)))
        distance, before = dijkstra(graph, True, np.array(vertex), True, limit=2 * reach)
        near = np.flatnonzero(np.isfinite(distance) & (distance <= reach) & (charges == 0))
        steps: list[tuple[int, int, int]] = []
        taken: list[int] = []
        for _ in range((int(charges[vertex]) - 1) // most):
            if not len(near):
                break
            apart = np.min([distance[near], *(_apart(frames, near, other) for other in taken)], axis=0)
            goal = int(near[np.argmax(apart)])
            taken.append(goal)
            path = [goal]
            while path[-1] != vertex:
                path.append(int(before[path[-1]]))
            steps += [(a, b, most) for a, b in itertools.pairwise(path[::-1])]
            touched[path] = True
        matched = carried_charges(frames, matched, steps)
    return matched, touched


def _apart(frames: FaceFrames, vertices: Ints, other: int) -> Floats:
    return np.asarray(np.linalg.norm(frames.points[vertices] - frames.points[other], axis=1))


def inner_edges(frames: FaceFrames) -> sp.csr_matrix:
    """(V, V) lengths of the edges between vertices that are not on the boundary."""
    inner = ~frames.is_boundary[frames.edges].any(1)
    (v, w), lengths = frames.edges[inner].T, frames.lengths[inner]
    size = len(frames.points)
    return sp.csr_matrix((np.r_[lengths, lengths], (np.r_[v, w], np.r_[w, v])), shape=(size, size))


def nearest_paths(
    graph: sp.csr_matrix, sources: Ints, goals: Ints, radius: float, allowed: Bools | None = None
) -> list[list[int]]:
    """Shortest paths from goals to sources within a radius, the nearest pairs first; no vertex is an end of two.

    Args:
        graph: (V, V) lengths of edges.
        sources: vertices.
        goals: others.
        radius: along edges.
        allowed: (sources, goals) bool: pairs that may be joined; all by default.

    Returns:
        Vertices of each path, that of the goal first.
    """
    if not (len(sources) and len(goals)):
        return []
    lengths, before = dijkstra(graph, indices=sources, limit=radius, return_predecessors=True)
    near = lengths[:, goals] if allowed is None else np.where(allowed, lengths[:, goals], np.inf)
    paths: list[list[int]] = []
    taken: set[int] = set()
    for row, column in np.argwhere(np.isfinite(near))[np.argsort(near[np.isfinite(near)], kind="stable")].tolist():
        source, goal = int(sources[row]), int(goals[column])
        if taken.isdisjoint((source, goal)):
            taken |= {source, goal}
            path = [goal]
            while path[-1] != source:
                path.append(int(before[row, path[-1]]))
            paths.append(path)
    return paths


def carried_charges(frames: FaceFrames, matched: Ints, steps: list[tuple[int, int, int]]) -> Ints:
    """Matchings after charges went along edges, from one vertex to another: a step more or less over each edge."""
    a, b, charges = np.array(steps, np.int64).reshape(-1, 3).T
    edges = edge_numbers(frames.topology, torch.from_numpy(np.stack([a, b], 1))).numpy()
    moved = matched.copy()
    np.subtract.at(moved, edges, np.where(frames.edges[edges, 0] == a, charges, -charges))
    return moved


def refitted(
    frames: FaceFrames,
    angles: Floats,
    matched: Ints,
    directions: Directions,
    smoothing: float,
    touched: Bools,
    symmetry: Symmetry,
    rings: int = _RINGS,
) -> Floats:
    """Angles that fit new matchings, by the smoothness and the principal directions of the field.

    Args:
        frames: of the triangles.
        angles: (F,) of the field before.
        matched: (I,) quarter turns over edges.
        directions: principal directions.
        smoothing: as for the field.
        touched: (V,) bool: vertices around which directions count less.
        symmetry: of the field, 2 or 4.
        rings: of triangles around those.
    """
    near = frames.grown(np.asarray(touched[frames.triangles].any(1)), rings)
    trust = directions.confidence * np.where(near, _LOOSE, 1.0)
    pull = frames.areas * trust / smoothing**2 + 1e-9 * frames.areas / frames.areas.mean()
    stiffness = connection_laplacian(frames, np.ones(len(frames.faces), complex)) + sp.diags(pull)
    turning = frames.dual_weights * (frames.turns + QUARTER * matched)
    f, g = frames.faces.T
    count = len(frames.triangles)
    jumps = np.bincount(g, turning, count) - np.bincount(f, turning, count)
    principal, step = np.angle(directions.values) / 2, 2 * np.pi / symmetry
    solve = hermitian_solver(stiffness)
    for _ in range(2):
        nearest = principal + step * np.rint((angles - principal) / step)
        angles = solve(pull * nearest + jumps + 0j).real
    return angles
