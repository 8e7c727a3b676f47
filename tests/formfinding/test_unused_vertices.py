"""Vertices that no face uses change nothing, wherever they are, and stay where they are."""

from __future__ import annotations

import torch

from torchfair import Topology
from torchfair.formfinding import FairSettings, minimise_normal_variation
from torchfair.projection import ProjectionSettings
from torchfair.shapes import Enneper, irregular_triangles


def test_a_stray_vertex_changes_nothing() -> None:
    mesh = irregular_triangles(Enneper(), 40)
    settings = FairSettings(projection=ProjectionSettings(max_iterations=8))
    alone = minimise_normal_variation(mesh.vertices, mesh.topology, settings=settings)
    for far in (1e3, 1e9):
        vertices = torch.cat([mesh.vertices, torch.tensor([[far, 0.0, far]], dtype=torch.float64)])
        topology = Topology.from_faces(mesh.topology.face_lists(), len(vertices))
        result = minimise_normal_variation(vertices, topology, settings=settings)
        assert result.steps == alone.steps
        assert torch.allclose(result.vertices[:-1], alone.vertices, atol=1e-9)
        assert result.vertices[-1].equal(vertices[-1])
