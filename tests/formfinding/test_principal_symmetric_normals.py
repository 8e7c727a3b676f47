"""Normals of principal-symmetric meshes, and the strips that stand on them."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE
from symmetric_starts import STARTS, pulled, start

from torchfair.formfinding import principal_symmetric, strip_normals
from torchfair.geometry import vertex_normals
from torchfair.principal import developable_strips, star_spheres


@pytest.mark.parametrize("name", STARTS)
def test_strips_along_all_principal_polylines_are_planar_up_to_the_boundary(name: str) -> None:
    vertices, edges = start(name)
    level = principal_symmetric(vertices, edges, handles=pulled(vertices, edges, 0.05)).levels[0]
    torch.testing.assert_close(level.normals.norm(dim=1), torch.ones(len(vertices), dtype=DOUBLE))
    assert float((level.normals * vertex_normals(level.vertices, edges.topology)).sum(1).min()) > 0.9
    strips = developable_strips(level.vertices, edges.polylines(), level.normals, 0.05)
    assert float(strips.planarity.max()) < 1e-8
    assert float(strips.isometry_errors.max()) < 1e-10


def test_normals_at_stars_are_those_of_their_spheres() -> None:
    """Whatever principal edges along the boundary ask of the normals at their ends."""
    vertices, edges = start("enneper")
    noise = torch.randn(vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    moved = vertices + 0.01 * noise
    stars = edges.stars()
    normals = strip_normals(moved, edges)
    torch.testing.assert_close(normals[stars.vertices], star_spheres(moved, stars).normals, rtol=0, atol=1e-12)
    torch.testing.assert_close(normals.norm(dim=1), torch.ones(len(normals), dtype=DOUBLE))


def test_normals_of_float32_meshes_keep_their_dtype() -> None:
    vertices, edges = start("enneper")
    normals = strip_normals(vertices.float(), edges)
    assert normals.dtype == torch.float32
    assert float((normals.norm(dim=1) - 1.0).abs().max()) < 1e-6
    result = principal_symmetric(vertices.float(), edges)
    assert result.vertices.dtype == torch.float32
