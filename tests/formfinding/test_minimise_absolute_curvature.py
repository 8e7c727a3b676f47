"""The job that lowers C: theorems of the paper, conditions kept, independence of the unit."""

from __future__ import annotations

import math

import pytest
import torch
from form_boundaries import TURN, cone_distance, ring, wave
from helpers import wavy_grid
from torch import Tensor

from torchfair import Topology
from torchfair.curves import ClosedCurve
from torchfair.errors import MeshError, ShapeError
from torchfair.formfinding import FormSettings, JobResult, Level, minimise_absolute_curvature, start_surface
from torchfair.geometry import face_areas
from torchfair.projection import ProjectionSettings, Status
from torchfair.shapes import Cone, Cylinder, Surface, irregular_triangles, principal_triangles


def barrel(surface: Surface, bottom: float, top: float, height: float, kind: str) -> tuple[Tensor, Topology]:
    """A mesh of the cone, bulged by a quarter."""
    mesh = irregular_triangles(surface, 400) if kind == "irregular" else principal_triangles(surface, 14, 28)
    x, y, z = mesh.vertices.unbind(1)
    t = (z - z.min()) / height
    bulge = 1.0 + 0.25 * 4.0 * t * (1.0 - t)
    return torch.stack([x * bulge, y * bulge, z], 1), mesh.topology


def assert_monotone(result: JobResult[Level]) -> None:
    for stage in result.runs:
        merits = [record.merit for record in stage.history]
        assert merits == sorted(merits, reverse=True)


@pytest.mark.parametrize("kind", ["irregular", "lattice"])
@pytest.mark.parametrize(("bottom", "top", "height"), [(1.0, 1.0, 2.0), (1.0, 0.5, 1.0), (1.0, 1.0, 3.0)])
def test_between_coaxial_circles_a_barrel_becomes_the_cone(bottom: float, top: float, height: float, kind: str) -> None:
    same = bottom == top
    surface = Cylinder(radius=bottom, height=height) if same else Cone(bottom, top, height)
    vertices, topology = barrel(surface, bottom, top, height, kind)
    result = minimise_absolute_curvature(vertices, topology)
    assert cone_distance(vertices, bottom, top, height) > 0.04 * height  # the start is far from it
    assert cone_distance(result.vertices, bottom, top, height) < 0.005 * height
    assert result.after["total_absolute_curvature"] == pytest.approx(TURN * height, rel=0.05)
    assert result.vertices[topology.is_boundary_vertex].equal(vertices[topology.is_boundary_vertex])
    assert result.after["smallest_angle_degrees"] > 15.0
    assert result.projection.status.converged
    assert_monotone(result)


def test_slender_tubes_are_not_taken_for_waisted_ones() -> None:
    """Two cones tip to tip have the same C; noise in an irregular mesh must not lead there."""
    vertices, topology = barrel(Cylinder(radius=1.0, height=6.0), 1.0, 1.0, 6.0, "irregular")
    result = minimise_absolute_curvature(vertices, topology)
    radii = result.vertices[:, :2].norm(dim=1)
    assert float(radii.min()) > 0.9  # a waist has 0
    assert result.after["smallest_angle_degrees"] > 10.0


@pytest.mark.slow
def test_refinement_comes_nearer_to_the_cone() -> None:
    vertices, topology = barrel(Cone(1.0, 0.5, 1.0), 1.0, 0.5, 1.0, "irregular")
    coarse, fine = (minimise_absolute_curvature(vertices, topology, levels=levels) for levels in (0, 1))
    assert fine.topology.num_faces == 4 * topology.num_faces
    assert [len(level.runs) for level in fine.levels] == [len(coarse.runs), len(fine.runs) - len(coarse.runs)]
    errors = [abs(result.after["total_absolute_curvature"] - TURN) for result in (coarse, fine)]
    assert errors[1] < 0.8 * errors[0]
    assert cone_distance(fine.vertices, 1.0, 0.5, 1.0) < cone_distance(coarse.vertices, 1.0, 0.5, 1.0)
    # New boundary vertices lie on the circles, not on the polygons.
    rim = fine.vertices[fine.topology.is_boundary_vertex]
    radii = torch.where(rim[:, 2] > 0.5 * (rim[:, 2].min() + rim[:, 2].max()), 0.5, 1.0)
    assert float((rim[:, :2].norm(dim=1) - radii).abs().max()) < 1e-4


def test_a_planar_boundary_gives_the_plane() -> None:
    ellipse = ClosedCurve.from_function(
        lambda t: torch.stack([torch.cos(TURN * t), 0.6 * torch.sin(TURN * t), 0 * t], 1)
    )
    vertices, topology = start_surface([ellipse], 300)
    vertices[:, 2] += 0.4 * (1.0 - vertices[:, 0].square() - (vertices[:, 1] / 0.6).square()).clamp_min(0.0)
    result = minimise_absolute_curvature(vertices, topology)
    assert float(vertices[:, 2].max()) > 0.3
    assert float(result.vertices[:, 2].abs().max()) < 2e-3
    assert result.after["total_absolute_curvature"] < 0.05
    assert bool((face_areas(result.vertices, topology) > 0).all())


@pytest.mark.parametrize("unit", [1e-3, pytest.param(1000.0, marks=pytest.mark.slow)])
def test_results_do_not_depend_on_the_unit(unit: float) -> None:
    vertices, topology = start_surface([wave()], 200)
    plain = minimise_absolute_curvature(vertices, topology)
    scaled = minimise_absolute_curvature(unit * vertices, topology)
    torch.testing.assert_close(scaled.vertices / unit, plain.vertices, atol=1e-6, rtol=0)
    assert [s.iterations for s in scaled.runs] == [s.iterations for s in plain.runs]


def test_handles_are_reached_and_kept_through_refinement() -> None:
    vertices, topology = start_surface([ring(1.0, 0.0)], 300)
    middle = int(vertices.norm(dim=1).argmin())
    result = minimise_absolute_curvature(vertices, topology, handles={middle: [0.0, 0.0, 0.5]}, levels=1)
    # A cone point, the paper says (section 6, limitations).
    assert result.after["largest_handle_distance"] < 0.02
    torch.testing.assert_close(
        result.vertices[middle], torch.tensor([0.0, 0.0, 0.5], dtype=torch.float64), atol=0.02, rtol=0
    )


def test_handles_on_a_boundary_that_stays_are_refused() -> None:
    vertices, topology = start_surface([ring(1.0, 0.0)], 60)
    on_rim = topology.boundary_loops()[0].tolist()
    away = {on_rim[0]: [0.0, 0.0, 1.0], on_rim[3]: [0.0, 0.0, 2.0], 0: [0.0, 0.0, 0.1]}
    with pytest.raises(MeshError, match=f"2 handle.*{on_rim[0]}, {on_rim[3]}.*glide"):
        minimise_absolute_curvature(vertices, topology, handles=away)
    square = ClosedCurve(torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]).double())
    start, disk = start_surface([square], 60)
    pulled = {int(start.norm(dim=1).argmin()): [0.0, 0.0, 1.0]}
    glide = FormSettings(boundary="glide")
    with pytest.raises(MeshError, match="corners stay"):  # even if the boundary glides
        minimise_absolute_curvature(start, disk, curves=[square], handles=pulled, settings=glide)
    # Where they already are there is nothing to refuse.
    place = {on_rim[0]: vertices[on_rim[0]].tolist()}
    result = minimise_absolute_curvature(vertices, topology, handles=place)
    assert result.after["largest_handle_distance"] == 0.0
    # A gliding boundary is pulled along its curve.
    along = (math.cos(0.05), math.sin(0.05), 0.0)
    nearest = int((vertices - torch.tensor(along).double()).norm(dim=1).argmin())
    slid = minimise_absolute_curvature(vertices, topology, handles={nearest: along}, settings=glide)
    assert slid.after["largest_handle_distance"] < 0.2 * slid.before["largest_handle_distance"]


def test_gliding_boundaries_stay_on_their_curves() -> None:
    curve = wave()
    vertices, topology = start_surface([curve], 250)
    settings = FormSettings(boundary="glide")
    result = minimise_absolute_curvature(vertices, topology, curves=[curve], settings=settings)
    fixed = minimise_absolute_curvature(vertices, topology, curves=[curve])
    rim = result.vertices[topology.is_boundary_vertex]
    assert float((curve.at(curve.parameters_of(rim)) - rim).norm(dim=1).max()) < 1e-12
    assert float((rim - vertices[topology.is_boundary_vertex]).norm(dim=1).max()) > 1e-3  # they did slide
    assert result.after["total_absolute_curvature"] < 1.02 * fixed.after["total_absolute_curvature"]


def test_corners_stay_on_refined_and_gliding_boundaries() -> None:
    corners = [[0.0, 0.0, 0.0], [2.0, 0.0, 0.5], [2.0, 2.0, 0.0], [0.0, 2.0, 0.5]]
    sides = [
        torch.tensor(a).lerp(torch.tensor(b), k / 4)
        for a, b in zip(corners, corners[1:] + corners[:1], strict=True)
        for k in range(4)
    ]
    curve = ClosedCurve(torch.stack(sides).double())
    vertices, topology = start_surface([curve], 150)
    settings = FormSettings(boundary="glide")
    result = minimise_absolute_curvature(vertices, topology, curves=[curve], levels=1, settings=settings)
    for corner in corners:
        gaps = (result.vertices - torch.tensor(corner, dtype=torch.float64)).norm(dim=1)
        assert float(gaps.min()) < 1e-9


def test_quad_meshes_keep_their_faces() -> None:
    vertices, topology = wavy_grid(9, 8, triangles=False)
    result = minimise_absolute_curvature(vertices, topology)
    assert result.topology.face_lists() == topology.face_lists()
    assert result.after["total_absolute_curvature"] < result.before["total_absolute_curvature"]
    assert "triangles" in result.notes[0]
    finer = minimise_absolute_curvature(vertices, topology, levels=1)
    assert finer.topology.is_quadrangular
    assert finer.topology.num_faces == 4 * topology.num_faces


def test_lifted_formulation_lowers_c_too() -> None:
    vertices, topology = barrel(Cylinder(radius=1.0, height=2.0), 1.0, 1.0, 2.0, "lattice")
    settings = FormSettings(formulation="lifted")
    result = minimise_absolute_curvature(vertices, topology, settings=settings)
    assert result.after["total_absolute_curvature"] < 0.8 * result.before["total_absolute_curvature"]
    assert_monotone(result)


def test_stopping_keeps_the_best_and_ends_all_stages() -> None:
    vertices, topology = start_surface([wave()], 200)
    seen = []

    def stop(record: object) -> bool:
        seen.append(record)
        return len(seen) == 3

    result = minimise_absolute_curvature(vertices, topology, levels=2, callback=stop)
    assert len(result.runs) == 1
    assert result.projection.status is Status.CALLBACK
    assert result.topology.num_faces == topology.num_faces
    assert result.after["total_absolute_curvature"] < result.before["total_absolute_curvature"]


def test_single_precision_comes_back_single() -> None:
    vertices, topology = start_surface([wave()], 120)
    few = FormSettings(projection=ProjectionSettings(max_iterations=2, damping_scale="identity"))
    result = minimise_absolute_curvature(vertices.float(), topology, settings=few)
    assert result.vertices.dtype == torch.float32


def test_bad_requests_are_refused() -> None:
    vertices, topology = start_surface([wave()], 120)
    broken = vertices.clone()
    broken[5] = math.nan
    with pytest.raises(MeshError, match="not finite"):
        minimise_absolute_curvature(broken, topology)
    with pytest.raises(ShapeError, match="one mesh"):
        minimise_absolute_curvature(vertices[None], topology)
    with pytest.raises(ShapeError, match="normals"):
        minimise_absolute_curvature(vertices, topology, normals=torch.zeros(3, 3))
    with pytest.raises(MeshError, match="boundary vertices only"):
        minimise_absolute_curvature(vertices, topology, normals=torch.ones_like(vertices))
    with pytest.raises(MeshError, match="curves were given"):
        minimise_absolute_curvature(vertices, topology, curves=[wave(), ring(1.0, 3.0)])
    with pytest.raises(MeshError, match="no vertex"):
        minimise_absolute_curvature(vertices, topology, handles={9999: [0.0, 0.0, 0.0]})
    flattened = vertices.clone()
    flattened[topology.triangles[0]] = vertices[topology.triangles[0, 0]]
    with pytest.raises(MeshError, match="no area"):
        minimise_absolute_curvature(flattened, topology)
    with pytest.raises(ValueError, match="boundary"):
        FormSettings(boundary="loose")
    with pytest.raises(ValueError, match="smoothing"):
        FormSettings(smoothing=3.0)
