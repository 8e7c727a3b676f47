"""C of the smooth surface through the vertices of a mesh: closed forms, order, bends within one triangle."""

from __future__ import annotations

import math

import pytest
import torch
from meshing_tools import irregular
from torch import Tensor

from torchfair import Topology
from torchfair.geometry import edge_lengths, face_areas, fitted_curvature, rings_for_noise
from torchfair.meshing import principal_quads
from torchfair.meshing.surface_curvature import _middles, smooth_absolute_curvature
from torchfair.shapes import Catenoid, Cylinder, Enneper, PrincipalParaboloid, Torus, icosphere


def by_fits(vertices: Tensor, topology: Topology, rings: int = 2) -> float:
    return float(
        smooth_absolute_curvature(vertices, topology, fitted_curvature(vertices, topology, rings=rings).normals)
    )


def bent_strip(positions: list[float], angle: float, start: float, end: float) -> tuple[Tensor, Topology, Tensor]:
    """A strip of width 1 at arc lengths, straight but for a circular bend from start to end; with its normals."""
    s = torch.tensor(positions, dtype=torch.float64)
    bend = ((s - start) / (end - start)).clamp(0, 1)
    turn, radius = angle * bend, (end - start) / angle
    before, after = s.clamp_max(start), (s - end).clamp_min(0)
    x = before + radius * turn.sin() + after * math.cos(angle)
    z = radius * (1 - turn.cos()) + after * math.sin(angle)
    normals = torch.stack([-turn.sin(), torch.zeros_like(s), turn.cos()], 1)
    rows = [torch.stack([x, torch.full_like(s, y), z], 1) for y in (0.0, 1.0)]
    n = len(positions)
    faces = [t for i in range(n - 1) for t in ([i, i + 1, n + i + 1], [i, n + i + 1, n + i])]
    return torch.cat(rows), Topology.from_faces(faces), torch.cat([normals, normals])


@pytest.mark.parametrize("angle", [0.05, 0.2])
def test_middles_of_chords_are_lifted_onto_the_circle(angle):
    """Up to fourth order in the angle."""
    ends = torch.tensor([[math.cos(angle / 2), sign * math.sin(angle / 2), 0.0] for sign in (-1, 1)]).double()
    middle = _middles(2 * ends, ends, torch.tensor([[0, 1]]))
    exact = torch.tensor([[2.0, 0.0, 0.0]], dtype=torch.float64)
    torch.testing.assert_close(middle, exact, atol=0.1 * angle**4, rtol=0)


@pytest.mark.parametrize("shape", [Torus(), Catenoid(), Enneper(), PrincipalParaboloid(1.0, -0.5), Cylinder()])
def test_closed_forms_and_second_order(shape):
    exact = shape.total_absolute_curvature()
    errors = [abs(by_fits(*irregular(shape, count)) / exact - 1) for count in (300, 1200)]
    assert errors[0] < 3e-3
    assert errors[1] < max(0.4 * errors[0], 6e-4)


def test_sphere_by_its_own_normals():
    errors = []
    for subdivisions in (1, 2, 3):
        ball = icosphere(subdivisions, radius=2.0)
        found = smooth_absolute_curvature(ball.vertices, ball.topology, ball.vertices / 2.0)
        errors.append(1 - float(found) / (16 * math.pi))
    assert 0 < errors[0] < 0.03
    assert errors[0] / errors[1] == pytest.approx(4, abs=0.5)
    assert errors[1] / errors[2] == pytest.approx(4, abs=0.2)


@pytest.mark.parametrize("start", [2.0, 2.2, 2.45, 2.6])
def test_a_bend_counts_in_full_wherever_the_vertices_are(start):
    """A fillet that is shorter than an edge: curvature at the vertices says nothing of it, normals say all."""
    vertices, topology, normals = bent_strip([0.0, 1.0, 2.0, 3.0, 4.0, 5.0], math.radians(30), start, start + 0.3)
    found = smooth_absolute_curvature(vertices, topology, normals)
    assert float(found) == pytest.approx(math.radians(30), rel=2e-2)


def pointwise(vertices: Tensor, topology: Topology, rings: int) -> float:
    """The integral of curvatures that are known at the vertices alone."""
    bends = fitted_curvature(vertices, topology, rings=rings).curvatures.abs().sum(1)
    return float(face_areas(vertices, topology) @ bends[topology.triangles].mean(1))


@pytest.mark.parametrize("rings", [2, 3])
def test_coarse_triangles_turn_as_far_as_the_surface(rings):
    """A tube of eight edges around: curvatures of the fits are too large there, what their normals turn is not."""
    exact = Torus().total_absolute_curvature()
    vertices, topology = irregular(Torus(), 300)
    assert by_fits(vertices, topology, rings) == pytest.approx(exact, rel=5e-3)
    assert pointwise(vertices, topology, 3) > 1.08 * exact


def test_noise_adds_less_than_to_curvatures_at_the_vertices():
    exact = Torus().total_absolute_curvature()
    vertices, topology = irregular(Torus(), 1000)
    generator = torch.Generator().manual_seed(0)
    edge = edge_lengths(vertices, topology).mean()
    noisy = vertices + 0.1 * edge * torch.randn(vertices.shape, dtype=torch.float64, generator=generator)
    rings = rings_for_noise(noisy, topology)
    assert by_fits(noisy, topology, rings) == pytest.approx(exact, rel=0.03)
    assert pointwise(noisy, topology, rings) > 1.08 * exact


def test_scale_motion_numbering_and_flat_parts():
    vertices, topology = irregular(Torus(), 400)
    normals = fitted_curvature(vertices, topology).normals
    value = float(smooth_absolute_curvature(vertices, topology, normals))
    turn = torch.linalg.qr(torch.randn(3, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0))).Q
    turn = turn * torch.linalg.det(turn)
    moved = smooth_absolute_curvature(1e3 * vertices @ turn.T + 5, topology, normals @ turn.T)
    assert float(moved) == pytest.approx(1e3 * value, rel=1e-9)
    turned = Topology.from_faces(topology.triangles.flip(1), topology.num_vertices)
    assert float(smooth_absolute_curvature(vertices, turned, -normals)) == pytest.approx(value, rel=1e-12)
    flat = torch.nn.functional.pad(vertices[:, :2], (0, 1))
    up = torch.tensor([0.0, 0, 1]).double().expand_as(flat)
    assert float(smooth_absolute_curvature(flat, topology, up)) == 0
    assert float(smooth_absolute_curvature(flat, topology, 0 * up)) == 0  # no normals, no number that is none


def test_principal_quads_are_measured_against_it():
    vertices, topology = irregular(Torus(), 500)
    found = principal_quads(vertices, topology, count=200).report["total_absolute_curvature"]
    assert found == pytest.approx(by_fits(vertices, topology), rel=1e-12)
