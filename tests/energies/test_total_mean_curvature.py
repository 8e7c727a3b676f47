from __future__ import annotations

import itertools
import math

import pytest
import torch
from geometry_meshes import capped_prism, flat_pair, icosphere, split_faces, torus
from helpers import DOUBLE, cube, wavy_grid

from torchfair.energies import TotalMeanCurvature, angle_variation, total_mean_curvature
from torchfair.geometry import mean_curvature_vectors, shape_operators, vertex_normals


def test_unit_cube_and_prisms():
    assert total_mean_curvature(*cube()).item() == pytest.approx(3 * math.pi)
    value = total_mean_curvature(*capped_prism(6, radius=1.0, height=3.0)).item()
    assert value == pytest.approx(math.pi * 3 + 6 * math.pi / 2)


def test_tends_to_four_pi_r_on_spheres_with_second_order():
    errors = [abs(total_mean_curvature(*icosphere(level)).item() - 4 * math.pi) for level in (1, 2, 3)]
    assert all(math.log2(coarse / fine) > 1.9 for coarse, fine in itertools.pairwise(errors))


def test_tends_to_the_integral_on_the_torus_whatever_the_mesh():
    """Integral of (k1 + k2)/2 over the torus with radii R, r: 2 pi^2 R. E' depends on the diagonals, this does not."""
    exact = 2 * math.pi**2 * 3
    for mesh in (torus, lambda *size: split_faces(torus(*size))):
        errors = [abs(total_mean_curvature(*mesh(n, n)).item() - exact) for n in (12, 24, 48)]
        assert all(math.log2(coarse / fine) > 1.8 for coarse, fine in itertools.pairwise(errors))


def test_steiner_derivative_of_the_area():
    """Offsetting a closed surface by t changes its area by 2 t times the total mean curvature."""
    vertices, topology = icosphere(4)
    along = (mean_curvature_vectors(vertices, topology) * vertex_normals(vertices, topology)).sum()
    assert total_mean_curvature(vertices, topology).item() == pytest.approx(along.item(), rel=2e-3)


def test_half_the_traces_of_the_shape_operators():
    mesh = wavy_grid(5, 4, triangles=True)
    traces = shape_operators(*mesh, sine=False).diagonal(dim1=-2, dim2=-1).sum()
    torch.testing.assert_close(total_mean_curvature(*mesh), traces / 2)


def test_convex_and_concave_cancel_and_never_exceed_half_of_angle_variation():
    vertices, topology = wavy_grid(6, 6, triangles=True)
    mirrored = vertices * torch.tensor([1.0, 1, -1], dtype=DOUBLE)
    value = total_mean_curvature(vertices, topology)
    torch.testing.assert_close(total_mean_curvature(mirrored, topology), -value)
    assert value.abs() < angle_variation(vertices, topology) / 2


def test_terms_are_signed_and_smooth_across_flat_edges():
    vertices, topology = flat_pair()
    module = TotalMeanCurvature(topology)
    lift = torch.tensor([0.0, 0, 1, 0], dtype=DOUBLE)
    for t in (-1e-3, 0.0, 1e-3):
        bent = vertices.clone()
        bent[:, 2] = t * lift
        assert module.per_edge(bent).item() == pytest.approx(-math.atan(t))  # edge length 2, height 1
        slope = torch.func.grad(module)(bent)[:, 2] @ lift
        assert slope.item() == pytest.approx(-1, rel=1e-5)
