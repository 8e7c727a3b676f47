"""Vertices of a new mesh move along the surface until its edges follow the principal directions."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
import torch

from ..energies.normal_variation import normal_variation_per_edge
from ..fields import hermitian_solver
from ..fields.frames import Bools, Floats, Ints
from ..geometry import ClosestPointTracker
from ..settings.meshing_settings import MeshingSettings
from ..topology import Topology
from .components import Pieces, ReadSurface
from .face_room import FaceRoom
from .measures import angles_to_directions, has_direction
from .nearest_directions import nearest
from .steps import Steps, incidence

_ROUNDS = 3
_LARGE = 0.03  # radians: residuals above count in proportion, not squared, so that they are not spread
_STRAIN = 0.05  # weight of changes of length, relative, beside angles in radians
_PULL = 2.5  # weight of moves, over spacings, times the squared smoothing of directions
_ACUTE = np.radians(25.0)  # angles of faces may fall to that
_ACUTE_OF_TRIANGLES = np.radians(15.0)
_ROUGHER = 0.002  # by which triangles may raise E where K is negative, relative
_FARTHEST = 0.25  # move of a round, in spacings
_TRIES = 8  # with moves that are halved where faces would have no room; then none are left there
_FOLLOWED = 1e-3  # radians, by the sum below: edges that follow directions
_LEAST = 1e-9  # length of edges, in spacings


def aligned(
    pieces: Pieces, surface: ReadSurface, spacing: float, settings: MeshingSettings, has_rows: bool = False
) -> Pieces:
    r"""Pieces whose vertices have moved along the triangles of the surface so that edges turn to the directions there.

    Lines of a map follow a field in the mean of every triangle and are bound to whole numbers at singular points;
    edges are their chords. With few faces both cost degrees. With moves ``d`` in the planes of the triangles it
    minimises, by linear least squares, whose directions are read off anew in every round::

        sum_e w_e angle_e(d)^2 + 0.05 sum_e strain_e(d)^2 + 2.5 s^2 sum_v |x_v + d_v - x_v0|^2 / h^2

    with the angles of inner edges to the nearest principal direction at their middles, where there is one, relative
    changes of the lengths of all edges, the spacing h, and the length s in spacings over which directions are
    smoothed: the rougher the surface, the less they are followed. The weights ``w = 1 / sqrt(1 + (angle / 0.03)^2)``
    are those of the round before: one edge that has to turn does not turn ten others. In lattices with rows angles are
    those of edges on rows and, with a quarter of the weight, of medians across them: see :class:`Steps`.

    A vertex at a singular point takes it along. Where angles of a component do not fall in the mean and in their
    95 %, by the sum of the one and a quarter of the other, all its vertices stay; also where that sum is below 0.001
    at first. Of triangles those of the last round are taken in which E is no more than 0.2 % above that
    at first where K is negative.

    Vertices on the boundary and on creases stay. So do those whose faces would have too little room, see
    :class:`FaceRoom`; faces keep their corners.

    Args:
        pieces: on the triangles of the surface.
        surface: with its directions.
        spacing: of the pieces.
        settings: they say how far directions are smoothed.
        has_rows: whether they are triangles of a lattice with rows.
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
        rows = {(a - of.start, b - of.start) for a, b in pieces.rows if of.start <= a < of.stop} if has_rows else None
        moved.append(_aligned(start[of], faces, rows, on_creases[of], part, spacing, smoothing))
    return pieces.moved(np.concatenate(moved))


def _aligned(
    start: Floats,
    faces: list[list[int]],
    rows: set[tuple[int, int]] | None,
    on_creases: Bools,
    surface: ReadSurface,
    spacing: float,
    smoothing: float,
) -> Floats:
    """(V, 3) the vertices of one component after all rounds, or as they were."""
    topology = Topology.from_faces(faces, len(start))
    held = topology.is_boundary_vertex.numpy() | on_creases
    steps = Steps.of(topology, rows)
    off = _off(start, topology, steps, surface, spacing)
    if held.all() or off < _FOLLOWED:
        return start
    room = FaceRoom.of(topology, start, spacing, _ACUTE if rows is None else _ACUTE_OF_TRIANGLES)
    middles, feet = ClosestPointTracker(surface.reference), ClosestPointTracker(surface.reference)
    most = np.inf if rows is None else (1 + _ROUGHER) * _saddle_energy(start, topology, surface)
    points = best = start
    for _ in range(_ROUNDS):
        moves = _moves(points, start, topology, steps, surface, spacing, smoothing, held, middles, feet)
        moved = points + _with_room(room, points, moves, held)
        points = np.where(held[:, None], start, feet.closest(torch.from_numpy(moved)).positions.numpy())
        if rows is None or _saddle_energy(points, topology, surface) <= most:
            best = points
    return best if _off(best, topology, steps, surface, spacing) < off else start


def _saddle_energy(points: Floats, topology: Topology, surface: ReadSurface) -> float:
    """E of the inner edges whose middles are where K is negative."""
    positions = torch.from_numpy(points)
    faces = surface.reference.closest(positions[topology.interior_edges].mean(1)).faces.numpy()
    saddle = np.abs(surface.directions.means) < np.abs(surface.directions.values)
    return float(normal_variation_per_edge(positions, topology).numpy()[saddle[faces]].sum())


def _off(points: Floats, topology: Topology, steps: Steps, surface: ReadSurface, spacing: float) -> float:
    """How far edges are off directions: the mean angle and a quarter of what 95 % are below; 0 without any."""
    on = torch.from_numpy(points), topology, surface.reference, surface.frames, surface.directions, spacing
    angles = angles_to_directions(*on, torch.from_numpy(steps.edges))
    return float(angles.mean() + np.percentile(angles, 95) / 4) if len(angles) else 0.0


def _moves(
    points: Floats,
    start: Floats,
    topology: Topology,
    steps: Steps,
    surface: ReadSurface,
    spacing: float,
    smoothing: float,
    held: Bools,
    middles: ClosestPointTracker,
    feet: ClosestPointTracker,
) -> Floats:
    """(V, 3) the moves of a round, those of vertices that are held zero."""
    frames, directions = surface.frames, surface.directions
    edges = incidence(topology.edges.numpy(), len(points))
    along, sides = steps.differences @ points, edges @ points
    lengths, sizes = (np.maximum(np.linalg.norm(of, axis=1), _LEAST * spacing)[:, None] for of in (along, sides))
    at = middles.closest(torch.from_numpy(steps.middles @ points))
    faces = at.faces.numpy()
    wanted = nearest(frames, directions, faces, at.weights.numpy(), along)[0][:, None]
    across = np.cos(wanted) * frames.second[faces] - np.sin(wanted) * frames.first[faces]
    across = across * has_direction(directions, spacing)[faces, None] / lengths
    off = (along * across).sum(1, keepdims=True)
    across = across * steps.weights[:, None] * (1 + (off / _LARGE) ** 2) ** -0.25
    below = feet.closest(torch.from_numpy(points)).faces.numpy()
    axes = np.stack([frames.first[below], frames.second[below]], 1)
    free = np.flatnonzero(~held)
    turns = _differences(steps.differences, across, axes, free)
    strains = _differences(edges, sides / sizes**2, axes, free)
    pull = _PULL * (smoothing / spacing) ** 2
    back = (axes[free] @ (start - points)[free, :, None]).ravel()
    matrix = turns.T @ turns + _STRAIN * (strains.T @ strains) + pull * sp.identity(2 * len(free))
    right = pull * back - turns.T @ (along * across).sum(1)
    parts = hermitian_solver(sp.csr_matrix(matrix))(right).reshape(-1, 1, 2)
    moves = np.zeros_like(points)
    moves[free] = (parts @ axes[free])[:, 0]
    far = np.linalg.norm(moves, axis=1, keepdims=True)
    return np.asarray(moves * np.minimum(1, _FARTHEST * spacing / np.maximum(far, _LEAST * spacing)))


def _differences(steps: sp.csr_matrix, vectors: Floats, axes: Floats, free: Ints) -> sp.csr_matrix:
    """(S, 2n) what moves along the axes (V, 2, 3) of n free vertices change of steps, along vectors (S, 3)."""
    number = np.full(len(axes), -1)
    number[free] = np.arange(len(free))
    entries = steps.tocoo()
    kept = number[entries.col] >= 0
    rows, columns = entries.row[kept], entries.col[kept]
    values = entries.data[kept, None] * (axes[columns] @ vectors[rows, :, None])[..., 0]
    at = np.repeat(rows, 2), (2 * number[columns, None] + [0, 1]).ravel()
    return sp.csr_matrix((values.ravel(), at), shape=(steps.shape[0], 2 * len(free)))


def _with_room(room: FaceRoom, points: Floats, moves: Floats, held: Bools) -> Floats:
    """Moves that are halved, and then left out, at the corners of faces that would have no room."""
    for attempt in range(_TRIES):
        tight = room.tight(points + moves) & ~held
        if not tight.any():
            return moves
        moves = np.where(tight[:, None], moves / 2 if attempt < _TRIES // 2 else 0, moves)
    return np.zeros_like(moves)
