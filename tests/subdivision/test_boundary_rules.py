"""The boundary depends on the boundary alone, and corners stay."""

from __future__ import annotations

import pytest
import torch
from geometry_meshes import mixed_grid
from helpers import DOUBLE, grid_faces, split_quads, wavy_grid
from subdivision_reference import lattice, lattice_corners

from torchfair import Topology
from torchfair.subdivision import catmull_clark, hybrid, loop, midpoint, refine

each_boundary = pytest.mark.parametrize("boundary", ["curve", "interpolate", "polyline"])


@each_boundary
@pytest.mark.parametrize("scheme", [catmull_clark, hybrid])
def test_the_boundary_depends_on_the_boundary_alone(scheme, boundary: str) -> None:
    topology = mixed_grid()[1]
    fine = scheme(topology, boundary=boundary)
    on_rim = topology.is_boundary_vertex.numpy()
    rows = fine.matrix[fine.topology.is_boundary_vertex.numpy()]
    assert abs(rows[:, ~on_rim]).sum() == 0


def test_the_boundary_is_a_cubic_spline_whatever_the_faces() -> None:
    """The same polygon around triangles, quads or one face: the same fine boundary."""
    vertices, quads = wavy_grid(3, 3)
    rim = quads.boundary_loops()[0]
    meshes = [quads, Topology.from_faces(split_quads(grid_faces(3, 3))), Topology.from_faces([rim.tolist()], 9)]
    curves = [hybrid(topology).apply(vertices) for topology in meshes]
    curves = [curve[hybrid(m).topology.boundary_loops()[0]] for curve, m in zip(curves, meshes, strict=True)]
    polygon = vertices[rim]
    expected = (polygon.roll(1, 0) + 6 * polygon + polygon.roll(-1, 0)) / 8
    for curve in curves:
        torch.testing.assert_close(curve[::2], expected)
        torch.testing.assert_close(curve[1::2], (polygon + polygon.roll(-1, 0)) / 2)


@each_boundary
@pytest.mark.parametrize("scheme", ["loop", "catmull_clark", "hybrid"])
def test_corners_stay_exactly_through_all_levels(scheme: str, boundary: str) -> None:
    vertices, topology = wavy_grid(4, 4, triangles=True)
    corners = torch.zeros(16, dtype=torch.bool)
    corners[[0, 2, 5, 15]] = True  # two ends of the boundary, a vertex on a side, an interior vertex
    fine = refine(topology, scheme, 3, boundary=boundary, corners=corners)
    assert torch.equal(fine.apply(vertices)[:16][corners], vertices[corners])


def test_interpolated_boundaries_keep_their_vertices_and_reproduce_cubics() -> None:
    vertices, topology = wavy_grid(9, 3)
    x = torch.arange(9.0, dtype=DOUBLE).repeat_interleave(3)
    vertices[:, 2] = x**3 - 4 * x**2 + x
    vertices[:, 0] = x
    fine = hybrid(topology, boundary="interpolate")
    new = fine.apply(vertices)
    assert torch.equal(new[:27][topology.is_boundary_vertex], vertices[topology.is_boundary_vertex])
    u, _, height = new.unbind(-1)
    rim = fine.topology.is_boundary_vertex & (u > 1) & (u < 7)
    assert rim.sum() > 15
    torch.testing.assert_close(height[rim], (u**3 - 4 * u**2 + u)[rim])


def test_interpolated_boundaries_between_corners_reproduce_quadratics() -> None:
    vertices, topology = lattice(6, 5, triangles=True)
    x, y, _ = vertices.unbind(-1)
    values = torch.stack([x, y, x**2 + x * y - y**2], dim=-1)
    fine = loop(topology, boundary="interpolate", corners=lattice_corners(topology, 5))
    u, v, height = fine.apply(values)[fine.topology.is_boundary_vertex].unbind(-1)
    torch.testing.assert_close(height, u**2 + u * v - v**2)


def test_polylines_stay() -> None:
    vertices, topology = mixed_grid()
    fine = hybrid(topology, boundary="polyline")
    rim = fine.topology.is_boundary_vertex
    torch.testing.assert_close(fine.apply(vertices)[rim], midpoint(topology).apply(vertices)[rim])
