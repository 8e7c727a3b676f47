"""Vertices of a new mesh move along the surface until its edges follow the principal directions."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
import torch

from ..fields import hermitian_solver
from ..fields.frames import Bools, Floats, Ints
from ..geometry import ClosestPointTracker
from ..settings.meshing_settings import MeshingSettings
from ..topology import Topology
from .components import Pieces, ReadSurface
from .face_room import FaceRoom
from .measures import angles_to_directions, has_direction
from .nearest_directions import nearest

_ROUNDS = 3
_LARGE = 0.03  # radians: residuals above count in proportion, not squared, so that they are not spread
_STRAIN = 0.05  # weight of changes of length, relative, beside angles in radians
_PULL = 2.5  # weight of moves, over spacings, times the squared smoothing of directions
_FARTHEST = 0.25  # move of a round, in spacings
_TRIES = 8  # with moves that are halved where faces would have no room; then none are left there
_FOLLOWED = 1e-3  # radians, by the sum below: edges that follow directions
_LEAST = 1e-9  # length of edges, in spacings


def aligned(pieces: Pieces, surface: ReadSurface, spacing: float, settings: MeshingSettings) -> Pieces:
    r"""Pieces whose vertices have moved along the triangles of the surface so that edges turn to the directions there.

    Lines of a map follow a field in the mean of every triangle and are bound to whole numbers at singular points;
    edges are their chords. With few faces both cost degrees. With moves ``d`` in the planes of the triangles it
    minimises, by linear least squares, whose directions are read off anew in every round::

        sum_e w_e angle_e(d)^2 + 0.05 sum_e strain_e(d)^2 + 2.5 s^2 sum_v |x_v + d_v - x_v0|^2 / h^2

    with the angles of inner edges to the nearest principal direction at their middles, where there is one, relative
    changes of the lengths of all edges, the spacing h, and the length s in spacings over which directions are
    smoothed: the rougher the surface, the less they are followed. The weights ``w = 1 / sqrt(1 + (angle / 0.03)^2)``
    are those of the round before: one edge that has to turn does not turn ten others.

    A vertex at a singular point takes it along. Where angles of a component do not fall in the mean and in their
    95 %, by the sum of the one and a quarter of the other, all its vertices stay; also where that sum is below 0.001
    at first.

    Vertices on the boundary and on creases stay. So do those whose faces would have too little room, see
    :class:`FaceRoom`; faces keep their corners.

    Args:
        pieces: on the triangles of the surface.
        surface: with its directions.
        spacing: of the pieces.
        settings: they say how far directions are smoothed.
    """
    start, ends = pieces.positions, np.cumsum(pieces.counts)
    on_creases = np.zeros(len(start), bool)
    on_creases[pieces.creases.edges.numpy()] = True
    first = np.searchsorted(ends, [face[0] for face in pieces.faces], side="right")
    moved = []
    for number, (end, count) in enumerate(zip(ends.tolist(), pieces.counts, strict=True)):
        of = slice(end - count, end)
        faces = [[corner - of.start for corner in pieces.faces[face]] for face in np.flatnonzero(first == number)]
        part, smoothing = surface.component(number), settings.smoothing_length(surface.fits[number].rings)
        moved.append(_aligned(start[of], faces, on_creases[of], part, spacing, smoothing))
    points = np.concatenate(moved)
    places = pieces.places.clone()
    which, vertex = np.nonzero((pieces.places.numpy()[:, None] == start).all(-1))
    places[torch.from_numpy(which)] = torch.from_numpy(points[vertex])
    return replace(pieces, positions=points, places=places)


def _aligned(
    start: Floats, faces: list[list[int]], on_creases: Bools, surface: ReadSurface, spacing: float, smoothing: float
) -> Floats:
    """(V, 3) the vertices of one component after all rounds, or as they were."""
    topology = Topology.from_faces(faces, len(start))
    held = topology.is_boundary_vertex.numpy() | on_creases
    off = _off(start, topology, surface, spacing)
    if held.all() or off < _FOLLOWED:
        return start
    room = FaceRoom.of(topology, start, spacing)
    middles, feet = ClosestPointTracker(surface.reference), ClosestPointTracker(surface.reference)
    points = start
    for _ in range(_ROUNDS):
        moves = _moves(points, start, topology, surface, spacing, smoothing, held, middles, feet)
        moved = points + _with_room(room, points, moves, held)
        on = feet.closest(torch.from_numpy(moved)).positions.numpy()
        points = np.where(held[:, None], start, on)
    return points if _off(points, topology, surface, spacing) < off else start


def _off(points: Floats, topology: Topology, surface: ReadSurface, spacing: float) -> float:
    """How far inner edges are off directions: the mean angle and a quarter of what 95 % are below; 0 without any."""
    on = torch.from_numpy(points), topology, surface.reference, surface.frames, surface.directions, spacing
    angles = angles_to_directions(*on)
    return float(angles.mean() + np.percentile(angles, 95) / 4) if len(angles) else 0.0


def _moves(
    points: Floats,
    start: Floats,
    topology: Topology,
    surface: ReadSurface,
    spacing: float,
    smoothing: float,
    held: Bools,
    middles: ClosestPointTracker,
    feet: ClosestPointTracker,
) -> Floats:
    """(V, 3) the moves of a round, those of vertices that are held zero."""
    frames, directions = surface.frames, surface.directions
    edges, inner = topology.edges.numpy(), topology.num_interior_edges
    along = points[edges[:, 1]] - points[edges[:, 0]]
    lengths = np.maximum(np.linalg.norm(along, axis=1), _LEAST * spacing)[:, None]
    at = middles.closest(torch.from_numpy(points[edges[:inner]].mean(1)))
    faces = at.faces.numpy()
    wanted = nearest(frames, directions, faces, at.weights.numpy(), along[:inner])[0][:, None]
    across = np.cos(wanted) * frames.second[faces] - np.sin(wanted) * frames.first[faces]
    across = across * has_direction(directions, spacing)[faces, None] / lengths[:inner]
    off = (along[:inner] * across).sum(1, keepdims=True)
    across = across * (1 + (off / _LARGE) ** 2) ** -0.25
    below = feet.closest(torch.from_numpy(points)).faces.numpy()
    axes = np.stack([frames.first[below], frames.second[below]], 1)
    free = np.flatnonzero(~held)
    turns = _differences(edges[:inner], across, axes, free)
    strains = _differences(edges, along / lengths**2, axes, free)
    pull = _PULL * (smoothing / spacing) ** 2
    back = (axes[free] @ (start - points)[free, :, None]).ravel()
    matrix = turns.T @ turns + _STRAIN * (strains.T @ strains) + pull * sp.identity(2 * len(free))
    right = pull * back - turns.T @ (along[:inner] * across).sum(1)
    parts = hermitian_solver(sp.csr_matrix(matrix))(right).reshape(-1, 1, 2)
    moves = np.zeros_like(points)
    moves[free] = (parts @ axes[free])[:, 0]
    sizes = np.linalg.norm(moves, axis=1, keepdims=True)
    return np.asarray(moves * np.minimum(1, _FARTHEST * spacing / np.maximum(sizes, _LEAST * spacing)))


def _differences(edges: Ints, vectors: Floats, axes: Floats, free: Ints) -> sp.csr_matrix:
    """(E, 2n) what moves along the axes (V, 2, 3) of n free vertices change of edges, along vectors (E, 3)."""
    number = np.full(len(axes), -1)
    number[free] = np.arange(len(free))
    rows, columns, values = [], [], []
    for sign, ends in zip((-1, 1), edges.T, strict=True):
        which = np.flatnonzero(number[ends] >= 0)
        parts = sign * (axes[ends[which]] @ vectors[which, :, None])[..., 0]
        rows.append(np.repeat(which, 2))
        columns.append((2 * number[ends[which], None] + [0, 1]).ravel())
        values.append(parts.ravel())
    entries = np.concatenate(values), (np.concatenate(rows), np.concatenate(columns))
    return sp.csr_matrix(entries, shape=(len(edges), 2 * len(free)))


def _with_room(room: FaceRoom, points: Floats, moves: Floats, held: Bools) -> Floats:
    """Moves that are halved, and then left out, at the corners of faces that would have no room."""
    for attempt in range(_TRIES):
        tight = room.tight(points + moves) & ~held
        if not tight.any():
            return moves
        moves = np.where(tight[:, None], moves / 2 if attempt < _TRIES // 2 else 0, moves)
    return np.zeros_like(moves)
