"""Numbers of a mesh: closed forms, units under scaling, and what is not defined."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, cube, tetrahedron, wavy_grid

from torchfair import ShapeError, Topology
from torchfair.measuring import count_components, measure_mesh, worst_edges


def values(vertices: torch.Tensor, topology: Topology) -> dict[str, float | int | None]:
    return {quantity.key: quantity.value for quantity in measure_mesh(vertices, topology)}


def test_unit_cube_in_closed_form() -> None:
    expected = {
        "vertices": 8,
        "isolated_vertices": 0,
        "edges": 12,
        "boundary_edges": 0,
        "faces": 6,
        "triangles": 0,
        "quads": 6,
        "degenerate_faces": 0,
        "boundary_loops": 0,
        "components": 1,
        "euler_characteristic": 2,
        "normal_variation": 12 * math.sqrt(2),
        "angle_variation": 6 * math.pi,
        "total_mean_curvature": 3 * math.pi,
        "total_absolute_curvature": 8,  # eight corners with two eigenvalues 1/2 each in their planes
        "total_absolute_curvature_corrected": 8 * 2 / 3,  # 1/3 is the squared cosine between vertex and face normals
        "total_frobenius_curvature": 4 * math.sqrt(2),
        "willmore_energy": 8 * 0.5**2 / 0.75,  # mean curvature 1/2 of each corner over an eighth of the area
        "normal_variation_per_area": 2 * math.sqrt(2),
        "angle_variation_per_area": math.pi,
        "total_mean_curvature_per_area": math.pi / 2,
        "total_absolute_curvature_per_area": 8 / 6,
        "total_absolute_curvature_corrected_per_area": 16 / 18,
        "total_frobenius_curvature_per_area": 4 * math.sqrt(2) / 6,
        "area": 6,
        "mean_edge_length": 1,
        "shortest_edge_length": 1,
        "longest_edge_length": 1,
        "largest_dihedral_angle_degrees": 90,
        "smallest_corner_angle_degrees": 90,
        "largest_planarity": 0,
        "largest_conical_deviation": 0,
        "angle_defect_sum_degrees": 720,
    }
    measured = values(*cube())
    assert {key: measured[key] for key in expected} == pytest.approx(expected, abs=1e-12)


def test_scaling_follows_the_units() -> None:
    """Twice the size: lengths double, areas quadruple, pure numbers and degrees stay."""
    vertices, topology = wavy_grid()
    powers = {"length": 1, "area": 2, "1 / length": -1}
    small = measure_mesh(vertices, topology)
    large = values(2 * vertices, topology)
    assert {quantity.unit for quantity in small} == {*powers, "degrees", "dimensionless"}
    for quantity in small:
        assert large[quantity.key] == pytest.approx(quantity.value * 2.0 ** powers.get(quantity.unit, 0), rel=1e-10)


def test_boundary_components_and_isolated_vertices_are_counted() -> None:
    vertices, topology = wavy_grid(3, 3)
    faces = topology.face_lists()
    twice = Topology.from_faces([*faces, *[[v + 9 for v in face] for face in faces]], 20)
    measured = values(torch.cat([vertices, vertices + 5, torch.zeros(2, 3, dtype=DOUBLE)]), twice)
    assert measured["isolated_vertices"] == 2
    assert measured["components"] == 2
    assert measured["boundary_loops"] == 2
    assert measured["boundary_edges"] == 16
    assert measured["euler_characteristic"] == 2
    assert count_components(Topology.from_faces([], 4)) == 0


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        (torch.zeros(0, 3), []),
        (torch.zeros(3, 3), []),
        (torch.zeros(3, 3), [[0, 1, 2]]),
        (torch.tensor([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]]), [[0, 1, 2], [0, 2, 3]]),
    ],
)
def test_degenerate_meshes_have_finite_or_missing_numbers(vertices: torch.Tensor, faces: list[list[int]]) -> None:
    topology = Topology.from_faces(faces, len(vertices))
    for value in values(vertices.to(DOUBLE), topology).values():
        assert value is None or math.isfinite(value)


def test_worst_edges_are_sorted_and_complete() -> None:
    vertices, topology = wavy_grid()
    count = topology.num_interior_edges
    worst = worst_edges(vertices, topology, count + 5)
    assert len(worst) == count
    assert sorted(edge.edge for edge in worst) == list(range(count))
    terms = [edge.angle_variation for edge in worst]
    assert terms == sorted(terms, reverse=True)
    assert sum(terms) == pytest.approx(values(vertices, topology)["angle_variation"])
    for edge in worst:
        start, stop = vertices[list(edge.vertices)]
        assert edge.length == pytest.approx(float(torch.linalg.vector_norm(stop - start)))
        assert edge.angle_variation == pytest.approx(edge.length * abs(math.radians(edge.dihedral_angle_degrees)))
    assert worst_edges(vertices, topology, 3) == worst[:3]
    assert worst_edges(vertices, topology, 0) == []


def test_convex_edges_have_positive_angles() -> None:
    assert all(edge.dihedral_angle_degrees == pytest.approx(109.4712) for edge in worst_edges(*tetrahedron(), 6))


def test_keys_are_unique_and_always_the_same() -> None:
    keys = [quantity.key for quantity in measure_mesh(*cube())]
    assert len(set(keys)) == len(keys)
    assert [quantity.key for quantity in measure_mesh(torch.zeros(0, 3), Topology.from_faces([]))] == keys


def test_meshes_that_are_followed_by_autograd_are_measured_too() -> None:
    vertices, topology = wavy_grid()
    followed = vertices.clone().requires_grad_()
    assert measure_mesh(followed, topology) == measure_mesh(vertices, topology)
    assert worst_edges(followed, topology, 4) == worst_edges(vertices, topology, 4)


def test_wrong_arguments_are_named() -> None:
    vertices, topology = cube()
    for use in (lambda v: measure_mesh(v, topology), lambda v: worst_edges(v, topology, 1)):
        with pytest.raises(ShapeError, match="not a batch"):
            use(vertices[None])
        with pytest.raises(ShapeError, match="vertices"):
            use(vertices[:3])
    with pytest.raises(ShapeError, match="count"):
        worst_edges(vertices, topology, -1)
