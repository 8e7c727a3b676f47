"""Thin triangles at the boundary and at creases, where clipped cells were cut, shared out by flips and collapses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import torch
from scipy.spatial import KDTree

from ..boundary import boundary_corners
from ..fields.frames import Bools, Floats, Ints
from ..principal import PrincipalEdges
from ..settings.meshing_settings import MeshingSettings
from ..topology import Topology
from .boundary_cells import Compact, compact
from .components import Pieces, ReadSurface
from .polygon_area import area_vector, area_vectors
from .polygon_edits import PolygonEdits
from .polygon_sides import sharpest_angle
from .row_edges import row_mask
from .turned_over import turned_over

Pair = tuple[int, int]

_SMALL = 0.06  # area over the mean
_ROUNDS = 4
_AT = 1e-6  # spacings


def without_thin_triangles(pieces: Pieces, surface: ReadSurface, kept: Bools) -> Pieces:
    """Triangles of which those at curves are no thinner than a few edits of their edges can make them.

    An edge of a triangle below 6 % of the mean area is flipped where that leaves the smaller one of the two triangles
    beside it larger and turns neither over. Where no flip helps, one of its two shorter edges is collapsed, if its ends
    may. Neither is done where a corner would become sharper than the sharpest one beside the edge was. Edges on rows
    and along creases are not flipped. All stays as it is where more triangles would be turned over than before, or more
    regular vertices be without a row that passes through them.

    Args:
        pieces: a lattice with rows.
        surface: that it was made from.
        kept: (V,) bool: vertices that are not collapsed, among them all on creases.
    """
    edited = thickened(pieces, kept)
    if edited is pieces:
        return pieces
    before, after = ((len(turned_over(of, surface)), _exceptions(of)) for of in (pieces, edited))
    return edited if all(new <= old for new, old in zip(after, before, strict=True)) else pieces


def _exceptions(pieces: Pieces) -> int:
    """Of the principal edges."""
    topology = Topology.from_faces(pieces.faces, len(pieces.positions))
    return len(PrincipalEdges(topology, row_mask(topology, pieces.rows)).exceptions)


def thickened(pieces: Pieces, kept: Bools) -> Pieces:
    """The same, whatever becomes of rows and of normals; the very pieces where no triangle at a curve is small."""
    for _ in range(_ROUNDS):
        topology = Topology.from_faces(pieces.faces, len(pieces.positions))
        on_boundary, creases = topology.is_boundary_vertex.numpy(), pieces.creases.edges.numpy()
        on_curve = on_boundary.copy()
        on_curve[creases] = True
        if not _small(pieces.positions, pieces.faces, on_curve):
            break
        pieces = replace(pieces, faces=_flipped(pieces, on_curve))
        edits = PolygonEdits(pieces.positions, pieces.faces, on_boundary, kept, creases)
        if not _collapsed(edits, _small(pieces.positions, pieces.faces, on_curve)):
            break
        stay = np.setdiff1d(np.arange(len(kept)), [*edits.went])
        pieces, kept = _renumbered(pieces, compact(edits), stay), kept[stay]
    return pieces


def kept_vertices(pieces: Pieces, surface: ReadSurface, settings: MeshingSettings, spacing: float) -> Bools:
    """(V,) bool: vertices of a mesh at corners of the boundary of a surface, on creases and at singular points."""
    points, topology = surface.whole
    corners = points[boundary_corners(points, topology, settings.corner_angle)].numpy()
    kept = np.zeros(len(pieces.positions), bool)
    kept[pieces.creases.edges.numpy()] = True
    places = np.concatenate([corners, pieces.places.numpy()])
    gaps, nearest = map(np.asarray, KDTree(pieces.positions).query(places))
    kept[nearest[gaps <= _AT * spacing]] = True
    return kept


def _renumbered(pieces: Pieces, fewer: Compact, stay: Ints) -> Pieces:
    """Pieces with the vertices (n,) that stay, and what became of triangles."""
    pairs = np.sort(fewer.number[np.array(sorted(pieces.rows), np.int64).reshape(-1, 2)], axis=1).tolist()
    rows = {(a, b) for a, b in pairs if a != b}
    creases = replace(pieces.creases, edges=torch.from_numpy(fewer.creases))
    owners = np.digitize(stay, np.cumsum(pieces.counts))
    counts = np.bincount(owners, minlength=len(pieces.counts)).tolist()
    return replace(pieces, positions=fewer.positions, faces=fewer.faces, rows=rows, creases=creases, counts=counts)


def _small(positions: Floats, triangles: list[list[int]], on_curve: Bools) -> list[int]:
    """Numbers of small triangles with a vertex on a curve, the smallest first."""
    areas = np.linalg.norm(area_vectors(positions, triangles), axis=1)
    small = np.flatnonzero((areas < _SMALL * areas.mean()) & on_curve[np.array(triangles)].any(1))
    found: list[int] = small[np.argsort(areas[small], kind="stable")].tolist()
    return found


def _collapsed(edits: PolygonEdits, small: list[int]) -> int:
    """How many of some triangles lost one of their two shorter sides; others that this changes wait."""
    before, done = {number: list(edits.faces[number]) for number in small}, 0
    for number in small:
        if edits.faces.get(number) == before[number]:
            done += any(
                edits.collapse(edge, may_sharpen=False) for edge in sorted(edits.sides(number), key=edits.length)[:2]
            )
    return done


def _flipped(pieces: Pieces, on_curve: Bools) -> list[list[int]]:
    """The triangles after flips beside small ones."""
    found, positions = [list(triangle) for triangle in pieces.faces], pieces.positions
    owners = {(face[k - 1], face[k]): number for number, face in enumerate(found) for k in range(3)}
    kept = pieces.rows | {(int(a), int(b)) for a, b in pieces.creases.edges.sort(1).values}
    for _ in range(_ROUNDS):
        small = _small(positions, found, on_curve)
        if not sum(_flip_one(positions, found, owners, kept, number) for number in small):
            break
    return found


def _flip_one(
    positions: Floats, triangles: list[list[int]], owners: dict[Pair, int], kept: set[Pair], number: int
) -> bool:
    """Flips the edge of a triangle that leaves the smaller of two triangles largest, if it is larger than before."""
    best: tuple[float, int, list[list[int]]] | None = None
    for k in range(3):
        a, b, c = triangles[number][k:] + triangles[number][:k]
        other = owners.get((c, b))
        if other is None or (min(b, c), max(b, c)) in kept:
            continue
        (d,) = set(triangles[other]) - {b, c}
        if (a, d) in owners or (d, a) in owners:
            continue
        old, new = [triangles[number], triangles[other]], [[a, b, d], [a, d, c]]
        if sharpest_angle(positions[np.array(new)]) < sharpest_angle(positions[np.array(old)]):
            continue
        before = [area_vector(positions, face) for face in old]
        normal = before[0] + before[1]
        size = max(float(np.linalg.norm(normal)), np.finfo(float).tiny)
        least = min(float(area_vector(positions, face) @ normal) / size for face in new)
        if least > max(min(float(np.linalg.norm(area)) for area in before), best[0] if best else 0.0):
            best = least, other, new
    if best is None:
        return False
    _, other, new = best
    for of in (number, other):
        for k in range(3):
            del owners[triangles[of][k - 1], triangles[of][k]]
    for of, face in zip((number, other), new, strict=True):
        triangles[of] = face
        for k in range(3):
            owners[face[k - 1], face[k]] = of
    return True
