"""Finer meshes through the coarse vertices: what is kept, what is reproduced, no kinks along the boundary."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE, random_rotation

from torchfair import MeshError
from torchfair.boundary import boundary_corners
from torchfair.geometry import vertex_normals
from torchfair.shapes import Catenoid, Enneper, Paraboloid, ShapeMesh, Torus, principal_triangles
from torchfair.shapes.principal_triangles import parameter_triangles
from torchfair.subdivision import Refinement, interpolate_vertices, loop, near
from torchfair.subdivision.interpolation import BOUNDARY_CORNER


def one_step(mesh: ShapeMesh) -> Refinement:
    corners = boundary_corners(mesh.vertices, mesh.topology, BOUNDARY_CORNER)
    return loop(mesh.topology, boundary="interpolate", corners=corners)


def refined(mesh: ShapeMesh, *, exact_normals: bool = True) -> tuple[torch.Tensor, torch.Tensor]:
    """Positions and the mask of boundary vertices."""
    step = one_step(mesh)
    normals = mesh.normals if exact_normals else None
    return interpolate_vertices(step, mesh.vertices, normals), step.topology.is_boundary_vertex


@pytest.mark.parametrize("ends", ["straight", "zigzag"])
def test_coarse_vertices_stay(ends: str) -> None:
    mesh = principal_triangles(Enneper(0.8), 8, 10, ends=ends)  # type: ignore[arg-type]
    fine, _ = refined(mesh)
    assert torch.equal(fine[: len(mesh.vertices)], mesh.vertices)


def test_planes_are_reproduced_and_quadratics_inside() -> None:
    flat = parameter_triangles(Paraboloid(0.0, 0.0), 8, 8, ends="zigzag")
    fine, _ = refined(flat)
    assert float(fine[:, 2].abs().max()) < 1e-14
    bent = parameter_triangles(Paraboloid(0.6, -0.9), 12, 12, ends="zigzag")
    fine, on_boundary = refined(bent)
    x, y, z = fine.unbind(1)
    away = (z - 0.5 * (0.6 * x * x - 0.9 * y * y)).abs()
    deep = (x.abs() < 0.5) & (y.abs() < 0.5) & ~on_boundary
    assert int(deep.sum()) > 50
    assert float(away[deep].max()) < 2e-6  # the influence of the boundary fades by half from row to row
    sag = 0.9 * (2.0 / 12) ** 2 / 8
    assert float(away[~on_boundary].max()) < 0.2 * sag


def test_distance_from_surfaces_falls_with_the_third_power_of_the_spacing_at_least() -> None:
    errors = []
    for cells in (12, 24, 48):
        fine, _ = refined(principal_triangles(Torus(2.0, 1.0), cells, 2 * cells))
        ring = fine[:, :2].norm(dim=1) - 2.0
        errors.append(float((torch.hypot(ring, fine[:, 2]) - 1.0).abs().max()))
    assert errors[0] / errors[1] > 8.0
    assert errors[1] / errors[2] > 8.0


@pytest.mark.parametrize("ends", ["straight", "zigzag"])
def test_new_vertices_lie_on_the_surface_up_to_the_boundary(ends: str) -> None:
    mesh = principal_triangles(
        Catenoid(1.0, (-0.6, 0.6), angles=(0.0, 2.0)),
        12,
        16,
        along="v",
        ends=ends,  # type: ignore[arg-type]
    )
    step = one_step(mesh)
    on_boundary = step.topology.is_boundary_vertex

    def away(fine: torch.Tensor) -> torch.Tensor:
        return (fine[:, :2].norm(dim=1) - torch.cosh(fine[:, 2])).abs()

    kept, moved = away(interpolate_vertices(step, mesh.vertices, mesh.normals)), away(step.apply(mesh.vertices))
    assert float(kept[~on_boundary].max()) < 0.35 * float(moved[~on_boundary].max())
    assert float(kept[~on_boundary].mean()) < 0.05 * float(moved[~on_boundary].mean())
    assert float(kept[on_boundary].max()) < 4e-5  # of an arc whose sag is 1e-3


def test_what_is_not_kept_is_smoothed_as_loop_does() -> None:
    mesh = principal_triangles(Torus(2.0, 1.0), 12, 18)
    step = one_step(mesh)
    none = torch.zeros(len(mesh.vertices), dtype=torch.bool)
    torch.testing.assert_close(
        interpolate_vertices(step, mesh.vertices, keep=near(mesh.topology, none, 3)), step.apply(mesh.vertices)
    )
    one = none.clone()
    one[40] = True
    weights = near(mesh.topology, one, 4)
    fine = interpolate_vertices(step, mesh.vertices, keep=weights)
    assert torch.equal(fine[40], mesh.vertices[40])
    away = (fine[: len(none)] - mesh.vertices).norm(dim=1)
    assert float(away[weights == 0.0].min()) > 1e-3
    assert bool((weights[mesh.topology.edges[(mesh.topology.edges == 40).any(1)]] == 1.0).all())
    assert sorted(set(weights.tolist())) == pytest.approx([0.0, 0.5 - 0.125**0.5, 0.5, 0.5 + 0.125**0.5, 1.0])


def test_motions_and_scale_carry_over() -> None:
    mesh = principal_triangles(Enneper(0.8), 6, 8, ends="zigzag")
    step = one_step(mesh)
    turn = random_rotation(5)
    shift = torch.tensor([3.0, 1.0, -2.0], dtype=DOUBLE)
    one = interpolate_vertices(step, mesh.vertices)
    other = interpolate_vertices(step, 7.0 * mesh.vertices @ turn.T + shift)
    torch.testing.assert_close(other, 7.0 * one @ turn.T + shift)
    normals = vertex_normals(mesh.vertices, mesh.topology)
    torch.testing.assert_close(interpolate_vertices(step, mesh.vertices, normals), one)


def test_steps_that_move_the_boundary_or_more_than_one_are_refused() -> None:
    mesh = principal_triangles(Enneper(0.8), 6, 8, ends="zigzag")
    with pytest.raises(MeshError, match="move"):
        interpolate_vertices(loop(mesh.topology, boundary="curve"), mesh.vertices)
    first = one_step(mesh)
    with pytest.raises(MeshError, match="one step"):
        interpolate_vertices(first.then(loop(first.topology, boundary="interpolate")), mesh.vertices)
