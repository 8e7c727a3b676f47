"""A mesh cut open, with a field of directions combed on it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..errors import MeshError
from ..fields import (
    Directions,
    FaceFrames,
    Pull,
    Symmetry,
    direction_field,
    matchings,
    merge_singularities,
    vertex_charges,
)
from ..fields.direction_field import WEAK
from ..fields.frames import Floats
from ..fields.matchings import QUARTER
from .creases import Creases, crease_pull
from .cut_graph import CutGraph, cut_open
from .even_crosses import even_crosses
from .node_room import with_room

_FIRM = 10.0  # weight of creases that the field follows
_ALIKE = 1e-6  # relative difference of moments of inertia that says nothing of what is longest


def combed(
    frames: FaceFrames,
    directions: Directions,
    symmetry: Symmetry,
    smoothing: float,
    merging: float,
    creases: Creases | None = None,
    angle: float = 0.0,
    *,
    even: float = 0.0,
) -> CutGraph:
    """The mesh cut open, with a field of directions.

    Crosses are tried for directions, too: the larger and the smaller curvature change places where the surface has an
    umbilic line, crosses go on. They will do if one of their two directions never comes back as the other. Directions
    that creases at right angles pull both ways, as on a box, run lengthwise where singular points are fewer and less
    sharp then.

    Args:
        frames: of the triangles.
        directions: principal directions.
        symmetry: of the field, 2 or 4.
        smoothing: length over which directions are smoothed.
        merging: singular vertices that are closer are merged, but for corners of creases.
        creases: of the surface.
        angle: between chains of creases and the field, up to which it follows them.
        even: where positive, crosses are made to do, where they do not: see :func:`even_crosses`.

    Raises:
        MeshError: if they do anyway, or cannot be made to.
    """
    stay = None if creases is None else creases.corners
    chained = creases if creases is not None and creases.chains else None
    if even:
        angles = _field(frames, directions, smoothing, 4, creases, angle)
        matched = matchings(frames, angles, 4)
        angles, matched = merge_singularities(frames, angles, matched, directions, smoothing, merging, 4, stay)
        before = matched
        angles, matched = even_crosses(frames, angles, matched, directions, smoothing, even, stay)
        graph = cut_open(frames, angles, matched, vertex_charges(frames, angles, matched))
        if matched is before or (graph.quarters % 2).any():
            raise MeshError("crosses have no odd index that can be joined with another")
        return _lengthwise(frames, directions, graph)
    tried: tuple[Symmetry, ...] = (4, 2) if symmetry == 2 else (4,)
    for of in tried:
        graphs = []
        for pull in (None, _along_the_longest_axis(frames, chained)) if of == 2 and chained else (None,):
            angles = (
                _field(frames, directions, smoothing, of, creases, angle)
                if pull is None
                else direction_field(frames, directions, smoothing, of, pull)
            )
            matched = matchings(frames, angles, of)
            sharpness = int((vertex_charges(frames, angles, matched) ** 2).sum())
            angles, matched = merge_singularities(frames, angles, matched, directions, smoothing, merging, of, stay)
            angles, matched = with_room(frames, angles, matched, directions, smoothing, merging, of, stay)
            charges = vertex_charges(frames, angles, matched)
            graphs.append((sharpness, cut_open(frames, angles, matched, charges)))
        graph = min(graphs, key=lambda rated: rated[0])[1]
        if symmetry == 4 or not (graph.quarters % 2).any():
            break
    return graph if symmetry == 4 or of == 2 else _lengthwise(frames, directions, graph)


def _lengthwise(frames: FaceFrames, directions: Directions, graph: CutGraph) -> CutGraph:
    """Crosses turned by a quarter where the other direction is nearer to the principal one, by the whole surface."""
    along = directions.values * np.exp(-2j * graph.angles)
    across = float(frames.areas @ along.real) < 0
    return replace(graph, angles=graph.angles + QUARTER) if across else graph


def _field(
    frames: FaceFrames,
    directions: Directions,
    smoothing: float,
    symmetry: Symmetry,
    creases: Creases | None,
    angle: float,
) -> Floats:
    """The field that follows the creases which it nearly follows by itself."""
    if creases is None or not creases.chains:
        return direction_field(frames, directions, smoothing, symmetry)
    pull, chains = crease_pull(frames, creases)
    field = direction_field(frames, directions, smoothing, symmetry, pull)
    step = 2 * np.pi / symmetry  # directions follow creases that run along them, crosses those across, too
    turns = step * np.rint((field[pull.faces] - pull.angles) / step)
    off = np.abs(field[pull.faces] - pull.angles - turns)
    count = np.bincount(chains)
    follows = np.bincount(chains, off) <= angle * count
    if not follows.any():
        return field
    firm = Pull(pull.faces, pull.angles + turns, np.where(follows[chains], _FIRM, pull.weights))
    return direction_field(frames, directions, smoothing, symmetry, firm)


def _along_the_longest_axis(frames: FaceFrames, creases: Creases) -> Pull:
    """Directions of the axis of least inertia in all faces, with small weights."""
    apart = frames.centres - frames.areas @ frames.centres / frames.areas.sum()
    spread, axes = np.linalg.eigh(apart.T @ (frames.areas[:, None] * apart))
    longest = axes[:, spread > (1 - _ALIKE) * spread[-1]]
    axis = longest[:, -1] if longest.shape[1] == 1 else _among(longest, frames, creases)
    faces = np.arange(len(apart))
    seen = frames.seen(np.broadcast_to(axis, apart.shape), faces)
    return Pull(faces, np.angle(seen), WEAK * np.abs(seen) ** 2)


def _among(axes: Floats, frames: FaceFrames, creases: Creases) -> Floats:
    """The unit vector (3,) among those that ``axes`` (3, n) span, as of a cube, that is nearest to a crease.

    The first of the edges that have most along them: rounding must not say where rows run.
    """
    first = np.array([chain.vertices[:2] for chain in creases.chains])
    along = frames.points[first[:, 1]] - frames.points[first[:, 0]]
    shares = np.linalg.norm(along @ axes, axis=1) / np.linalg.norm(along, axis=1)
    chosen = axes @ (along[np.argmax(shares > shares.max() - _ALIKE)] @ axes)
    return np.asarray(chosen / np.linalg.norm(chosen))
