"""Vertices that lie on the edge of another face become corners of it, within the tolerance and away from its ends."""

from __future__ import annotations

import torch

from torchfair.repair import repair_mesh

DOUBLE = torch.float64


def test_a_vertex_near_the_end_of_an_edge_is_no_t_junction() -> None:
    """Nearer than twice the tolerance it would leave an edge that is no edge within it."""
    vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [1.5e-3, 0, 0], [1, 1, 0], [1, -1, 0]], dtype=DOUBLE)
    faces = [[0, 2, 3], [2, 1, 3], [1, 0, 4]]
    assert len(repair_mesh(vertices, faces, weld=1e-3).faces[-1]) == 3
    assert len(repair_mesh(vertices, faces, weld=5e-4).faces[-1]) == 4


def test_a_vertex_beside_an_edge_is_a_t_junction_within_the_tolerance() -> None:
    vertices = torch.tensor([[0.0, 0, 0], [2, 0, 0], [1, 1, 0], [1, -0.005, 0], [0, -1, 0], [2, -1, 0]], dtype=DOUBLE)
    faces = [[0, 1, 2], [0, 4, 3], [3, 5, 1], [3, 4, 5]]
    assert len(repair_mesh(vertices, faces, weld=1e-3).faces[0]) == 3
    vertices[3, 1] = -0.0005
    assert len(repair_mesh(vertices, faces, weld=1e-3).faces[0]) == 4
