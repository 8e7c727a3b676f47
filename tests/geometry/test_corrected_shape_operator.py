from __future__ import annotations

import math

import pytest
import torch
from geometry_meshes import GENERIC, flat_pair, flat_squares
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair import ShapeError, Topology
from torchfair.geometry import balanced_normals, corrected_shape_operators, face_normals
from torchfair.shapes import Cylinder, Sphere, Torus, irregular_triangles, parameter_quads, parameter_triangles


def cross(a: Tensor, b: Tensor) -> Tensor:
    return torch.linalg.cross(a, b)


def measures(x: list[Tensor], u: list[Tensor]):
    """Mean and anisotropic measures of one triangle, word by word from Lachaud et al. 2020."""
    xi, xj, xk = x
    ui, uj, uk = u
    mean = (ui + uj + uk) / 3
    mu1 = 0.5 * mean @ (cross(uk - uj, xi) + cross(ui - uk, xj) + cross(uj - ui, xk))

    def anisotropic(a: Tensor, b: Tensor) -> Tensor:
        forward = 0.5 * mean @ cross((b @ (uk - ui)) * a, xj - xi)
        return forward - 0.5 * mean @ cross((b @ (uj - ui)) * a, xk - xi)

    return mean, mu1, anisotropic


def random_triangle(seed: int) -> tuple[Tensor, Tensor]:
    random = torch.Generator().manual_seed(seed)
    x = torch.randn(3, 3, dtype=DOUBLE, generator=random)
    normal = face_normals(x, Topology.from_faces([[0, 1, 2]]))
    u = normal + 0.3 * torch.randn(3, 3, dtype=DOUBLE, generator=random)
    return x, torch.nn.functional.normalize(u, dim=-1)


@pytest.mark.parametrize("seed", range(5))
def test_trace_and_turned_anisotropic_measure_of_one_triangle(seed):
    x, u = random_triangle(seed)
    stars = corrected_shape_operators(x, Topology.from_faces([[0, 1, 2]]), u)
    torch.testing.assert_close(stars, stars[:1].expand(3, 3, 3))  # one third for every corner
    operator = stars.sum(0)
    mean, mu1, anisotropic = measures(list(x), list(u))
    torch.testing.assert_close(torch.trace(operator), mu1)
    axis = mean / mean.norm()
    a, b = torch.linalg.svd(axis[None])[2][1:]  # any basis of the plane orthogonal to the mean normal
    for first, second in ((a, a), (a, b), (b, a), (b, b)):
        turned = anisotropic(cross(axis, first), cross(axis, second))
        torch.testing.assert_close(second @ operator @ first, -turned)


def test_polygons_are_integrals_over_their_boundary():
    """A planar quad cut by a diagonal, with the same mean normal for both halves, holds what the halves hold."""
    x = torch.tensor([[0.0, 0, 0], [2, 0.2, 0], [1.8, 1, 0], [0.1, 1.3, 0]], dtype=DOUBLE)
    u = torch.nn.functional.normalize(
        torch.tensor([[-0.1, 0, 1], [0.1, 0, 1], [0.1, 0.2, 1], [-0.2, 0.1, 1]]).double(), dim=-1
    )
    whole = corrected_shape_operators(x, Topology.from_faces([[0, 1, 2, 3]]), u).sum(0)
    axis = u.mean(0)
    halves = torch.zeros(3, 3, dtype=DOUBLE)
    for i, j, k in ((0, 1, 2), (0, 2, 3)):
        halves += torch.outer(cross(axis, u[j] - u[i]), x[k] - x[i]) / 2
        halves -= torch.outer(cross(axis, u[k] - u[i]), x[j] - x[i]) / 2
    torch.testing.assert_close(whole, halves)


@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
def test_equals_a_loop_over_faces(mesh):
    vertices, topology = mesh()
    normals = balanced_normals(vertices, topology)
    expected = torch.zeros(topology.num_vertices, 3, 3, dtype=DOUBLE)
    for face in topology.face_lists():
        mean = normals[face].mean(0)
        operator = torch.zeros(3, 3, dtype=DOUBLE)
        for before, here, after in zip(face[-1:] + face[:-1], face, face[1:] + face[:1], strict=True):
            operator += torch.outer(cross(mean, normals[here]), vertices[after] - vertices[before]) / 2
        for v in face:
            expected[v] += operator / len(face)
    torch.testing.assert_close(corrected_shape_operators(vertices, topology), expected)


def test_sphere_holds_its_projector_times_area_over_radius():
    radius = 1.7
    mesh = parameter_triangles(Sphere(radius, (-1.0, 1.0)), 30, 90)
    total = corrected_shape_operators(mesh.vertices, mesh.topology, mesh.normals)
    exact = mesh.surface.integrate(lambda u, v: torch.ones_like(u) / radius) * 2
    assert total.diagonal(dim1=-2, dim2=-1).sum().item() == pytest.approx(exact, rel=2e-3)


@pytest.mark.parametrize("make", [parameter_quads, parameter_triangles])
def test_cylinder_bends_round_its_axis_and_the_matrix_points_along_it(make):
    mesh = make(Cylinder(0.5, 2.0), 10, 60)
    stars = corrected_shape_operators(mesh.vertices, mesh.topology)
    expected = torch.zeros(3, 3, dtype=DOUBLE)
    expected[2, 2] = 2 * math.pi * 2.0  # integral of 1/r over 2 pi r h
    torch.testing.assert_close(stars.sum(0), expected, rtol=2e-3, atol=1e-2)


def test_torus_has_its_total_mean_curvature():
    mesh = irregular_triangles(Torus(2.0, 0.8), 1500)
    for normals in (None, mesh.normals):
        traces = corrected_shape_operators(mesh.vertices, mesh.topology, normals).diagonal(dim1=-2, dim2=-1)
        assert traces.sum().item() == pytest.approx(4 * math.pi**2 * 2.0, rel=0.02)


@pytest.mark.parametrize("mesh", [flat_pair, flat_squares])
def test_flat_meshes_have_none(mesh):
    assert corrected_shape_operators(*mesh()).abs().max() < 1e-15


@pytest.mark.parametrize("normals", [torch.zeros(4, 3), torch.zeros(30, 3, dtype=torch.int64)])
def test_refuses_other_normals(normals):
    vertices, topology = wavy_grid(6, 5)
    with pytest.raises(ShapeError, match="normals: expected a floating tensor"):
        corrected_shape_operators(vertices, topology, normals)


def test_one_set_of_normals_serves_a_batch():
    mesh = parameter_quads(Cylinder(), 4, 8)
    batch = torch.stack([mesh.vertices, 2 * mesh.vertices])
    stars = corrected_shape_operators(batch, mesh.topology, mesh.normals)
    torch.testing.assert_close(stars[1], 2 * stars[0])


def corner_by_corner(vertices: Tensor, topology: Topology, normals: Tensor) -> Tensor:
    """The same sums over all corners of any polygons, not by faces with equally many of them."""
    corners, faces, following = topology.corners, topology.corner_faces, topology.next_corners
    points, at, sizes = vertices[corners], normals[corners], topology.face_sizes[:, None]
    chord = torch.zeros_like(points)
    chord[following] = points[following[following]] - points  # x_{i+1} - x_{i-1}
    mean = normals.new_zeros(topology.num_faces, 3).index_add(0, faces, at) / sizes
    per_corner = (cross(mean[faces], at)[:, :, None] * chord[:, None, :]).flatten(-2) / 2
    per_face = normals.new_zeros(topology.num_faces, 9).index_add(0, faces, per_corner) / sizes
    stars = normals.new_zeros(topology.num_vertices, 9).index_add(0, corners, per_face[faces])
    return stars.view(-1, 3, 3)


@pytest.mark.parametrize("faces", ["quads", "triangles", "both"])
def test_faces_with_equally_many_corners_are_summed_like_any_polygons(faces: str) -> None:
    vertices, topology = wavy_grid(6, 5, triangles=faces == "triangles")
    if faces == "both":
        (a, b, c, d), *others = topology.face_lists()
        topology = Topology.from_faces([[a, b, c], *others, [a, c, d]], len(vertices))
    vertices = vertices.to(DOUBLE)
    normals = balanced_normals(vertices, topology)
    found = corrected_shape_operators(vertices, topology, normals)
    assert torch.equal(found, corner_by_corner(vertices, topology, normals))
