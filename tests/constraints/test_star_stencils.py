"""Stencils of stars: every vertex once, centre first, ring in order."""

from __future__ import annotations

import torch

from torchfair.constraints.star_stencils import closed_star_stencils, open_star_stencils
from torchfair.shapes import FreeFormPatch, irregular_triangles

TOPOLOGY = irregular_triangles(FreeFormPatch(), 120).topology


def ring_of(vertex: int) -> list[int]:
    start, end = TOPOLOGY.ring_offsets[vertex], TOPOLOGY.ring_offsets[vertex + 1]
    return TOPOLOGY.ring_vertices[start:end].tolist()


def test_closed_stars_are_those_of_the_interior() -> None:
    rows = [row for stencil in closed_star_stencils(TOPOLOGY) for row in stencil.tolist()]
    interior = torch.nonzero(~TOPOLOGY.is_boundary_vertex).squeeze(1).tolist()
    assert sorted(row[0] for row in rows) == interior
    assert all(row[1:] == ring_of(row[0]) for row in rows)


def test_open_stars_come_with_their_places() -> None:
    vertices = torch.nonzero(TOPOLOGY.is_boundary_vertex).squeeze(1).flip(0)
    seen = []
    for chosen, stencil in open_star_stencils(TOPOLOGY, vertices):
        assert stencil[:, 0].equal(vertices[chosen])
        assert all(row[1:] == ring_of(row[0]) for row in stencil.tolist())
        seen += chosen.tolist()
    assert sorted(seen) == list(range(len(vertices)))
    assert open_star_stencils(TOPOLOGY, vertices[:0]) == []
