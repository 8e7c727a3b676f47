"""Vertices where three triangles meet, moved between their neighbours."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor

from ..topology import Topology
from .components import Pieces, ReadSurface

_ALONG = 0.25  # barycentric coordinate of the neighbour on the row, which is a third in the middle
_LEAST = 0.1  # of any neighbour


def with_three_valent_inside(pieces: Pieces, surface: ReadSurface) -> Pieces:
    """A triangle lattice whose vertices of valence 3 lie between their neighbours.

    The row beside such a vertex turns back around it, and the edge of that row cuts its turn short. Where rows lie much
    closer than vertices on them, as on the ends of long ellipsoids, that edge passes on the far side of the vertex, and
    a triangle is turned over. The place of the vertex is free: there is no principal direction at an umbilic. So it
    moves along the row that ends in it, whose direction stays, until its neighbour there has a share of a quarter in
    it; and if another has less than a tenth then, towards the middle of all three. Vertices on creases stay.

    Args:
        pieces: triangles.
        surface: that they were made from; new places are the closest points of its triangles.
    """
    of_valence = Topology.from_faces(pieces.faces, len(pieces.positions)).rings_by_valence
    if 3 not in of_valence:
        return pieces
    centres, ring = of_valence[3]
    free = ~torch.isin(centres, pieces.creases.edges)
    centres, ring = centres[free], ring[free]
    positions = torch.from_numpy(pieces.positions)
    before = positions[centres]
    inside = between(before, positions[_rows_first(centres, ring, pieces.rows)])
    moved = (inside != before).any(1)
    if not moved.any():
        return pieces
    inside = torch.where(moved[:, None], surface.reference.closest(inside).positions, before)
    same = (pieces.places[:, None] == before).all(-1)
    places = torch.where(same.any(1, keepdim=True), inside[same.int().argmax(1)], pieces.places)
    return replace(pieces, positions=positions.index_copy(0, centres, inside).numpy(), places=places)


def between(points: Tensor, corners: Tensor) -> Tensor:
    """Points moved into triangles: towards the first corner, then towards the middle.

    Until the barycentric coordinate of the first corner is a quarter at least, and then until each is a tenth.

    Args:
        points: (n, 3); coordinates are those of their orthogonal projections.
        corners: (n, 3, 3) of a triangle for each.

    Returns:
        (n, 3), the points themselves where that holds; middles of triangles without area.
    """
    first = _weights(points, corners)[:, :1]
    share = ((_ALONG - first).clamp_min(0) / (1 - first)).nan_to_num(0.0)
    points = points + share * (corners[:, 0] - points)
    least = _weights(points, corners).amin(1, keepdim=True)
    share = ((_LEAST - least) / (1 / 3 - least)).nan_to_num(1.0).clamp(0, 1)
    return points + share * (corners.mean(1) - points)


def _weights(points: Tensor, corners: Tensor) -> Tensor:
    """(n, 3) barycentric coordinates; no numbers where there is no area."""
    away = corners - points[:, None]
    parts = torch.linalg.cross(away.roll(-1, 1), away.roll(1, 1))
    normal = parts.sum(1, keepdim=True)
    weights: Tensor = (parts * normal).sum(2) / normal.square().sum(2)
    return weights


def _rows_first(centres: Tensor, ring: Tensor, rows: set[tuple[int, int]]) -> Tensor:
    """(n, 3) the neighbours ``ring`` (n, 3) of vertices (n,), those on rows with them first."""
    edges = torch.stack([centres[:, None].expand_as(ring), ring], -1).sort(-1).values
    off = torch.tensor([tuple(edge) not in rows for edge in edges.flatten(0, 1).tolist()], dtype=torch.int8)
    return ring.gather(1, off.view(ring.shape).argsort(dim=1, stable=True))
