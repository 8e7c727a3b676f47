"""The target C as element terms: the shape operators of stars, their derivatives, and what they sum to."""

from __future__ import annotations

import pytest
import torch
from helpers import wavy_grid
from torch import Tensor

from torchfair.constraints import absolute_curvature_terms
from torchfair.errors import MeshError
from torchfair.geometry import shape_operators
from torchfair.projection import symmetric_matrix
from torchfair.projection.differentiation import differentiate
from torchfair.shapes import FreeFormPatch, ShapeMesh, Torus, icosphere, irregular_triangles


def noisy(mesh: ShapeMesh, size: float) -> Tensor:
    generator = torch.Generator().manual_seed(0)
    return mesh.vertices + size * torch.randn(mesh.vertices.shape, dtype=torch.float64, generator=generator)


MESHES = [irregular_triangles(FreeFormPatch(), 150), irregular_triangles(Torus(), 200), icosphere(2)]


@pytest.mark.parametrize("mesh", MESHES)
def test_every_star_has_the_shape_operator_of_the_geometry(mesh: ShapeMesh) -> None:
    vertices = noisy(mesh, 0.02)
    expected = shape_operators(vertices, mesh.topology)
    seen = torch.zeros(mesh.topology.num_vertices, dtype=torch.bool)
    for term in absolute_curvature_terms(mesh.topology, smoothing=0.1):
        centres = term.stencil[0][1][:, 0]
        operators = symmetric_matrix(term.values(term.arguments({"vertices": vertices})))
        torch.testing.assert_close(operators, expected[centres], atol=1e-13, rtol=1e-12)
        assert not bool(seen[centres].any())
        seen[centres] = True
    assert not bool(expected[~seen].any())  # the stars left out have no interior edge


@pytest.mark.parametrize("mesh", MESHES)
def test_closed_derivative_equals_automatic_one(mesh: ShapeMesh) -> None:
    vertices = noisy(mesh, 0.05)
    for term in absolute_curvature_terms(mesh.topology, smoothing=0.1):
        arguments = term.arguments({"vertices": vertices})
        automatic = differentiate(term.residual, arguments, 1)[1]
        torch.testing.assert_close(term.jacobians(arguments), automatic, atol=1e-11, rtol=1e-9)


@pytest.mark.parametrize("smoothing", [1e-2, 1e-4])
def test_the_merit_is_the_sum_of_absolute_eigenvalues_up_to_smoothing(smoothing: float) -> None:
    mesh = irregular_triangles(Torus(), 300)
    terms = absolute_curvature_terms(mesh.topology, smoothing=smoothing, weight=2.0)
    arguments = [term.arguments({"vertices": mesh.vertices}) for term in terms]
    merit = sum(float(t.contributions(a, t.values(a)).sum()) for t, a in zip(terms, arguments, strict=True))
    operators = shape_operators(mesh.vertices, mesh.topology)
    exact = 2.0 * float(torch.linalg.svdvals(operators).sum())
    assert exact - 2.0 * 3.0 * smoothing * mesh.topology.num_vertices <= merit <= exact


def test_a_flat_mesh_has_no_merit_and_no_gradient() -> None:
    vertices, topology = wavy_grid(6, 5, triangles=True)
    flat = vertices * torch.tensor([1.0, 1.0, 0.0], dtype=torch.float64)
    for term in absolute_curvature_terms(topology, smoothing=1e-3):
        arguments = term.arguments({"vertices": flat})
        values, jacobians = term.linearised(arguments)
        assert float(values.abs().max()) < 1e-15
        assert bool(torch.isfinite(jacobians).all())
        assert float(term.contributions(arguments, values).abs().max()) < 1e-15


def test_other_polygons_are_refused() -> None:
    _, topology = wavy_grid(4, 4, triangles=False)
    with pytest.raises(MeshError, match="Triangulate"):
        absolute_curvature_terms(topology, smoothing=0.1)
