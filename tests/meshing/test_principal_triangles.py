"""Triangle lattices: valences, principal edges, and what comes of them."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from creased_shapes import box
from helpers import random_rotation
from meshing_tools import MonkeySaddle, ellipsoid, irregular, side_by_side

from torchfair.formfinding import principal_symmetric
from torchfair.meshing import MeshingSettings, TriangleMesh, principal_triangles
from torchfair.meshing.components import read_surface
from torchfair.meshing.cut_cells import cut_cells
from torchfair.meshing.row_distances import EQUILATERAL, row_distance, rows_across
from torchfair.meshing.verification import shape_of
from torchfair.shapes import PrincipalParaboloid, Torus

SADDLE = PrincipalParaboloid(1.0, -0.5, (0.8, 0.8))


def inner_valences(mesh: TriangleMesh) -> dict[int, int]:
    inner = ~mesh.topology.is_boundary_vertex
    values, counts = mesh.topology.valences[inner].unique(return_counts=True)
    return dict(zip(values.tolist(), counts.tolist(), strict=True))


def test_a_torus_has_valence_six_throughout() -> None:
    vertices, topology = irregular(Torus(), 1500)
    found = principal_triangles(vertices, topology, count=800)
    assert inner_valences(found) == {6: found.topology.num_vertices}
    assert shape_of(found.topology) == shape_of(topology)
    assert found.principal.exceptions.numel() == 0
    assert int(found.principal.mask.sum()) * 3 == found.topology.num_edges
    assert found.report["angle_mean_degrees"] < 1
    assert abs(found.report["faces"] / 800 - 1) < 0.15
    stars = found.principal.stars()
    assert len(stars.vertices) == found.topology.num_vertices
    assert found.notes == []


def test_an_ellipsoid_has_four_vertices_of_valence_three() -> None:
    found = principal_triangles(*ellipsoid(), count=800)
    valences = inner_valences(found)
    assert valences.pop(3) == 4
    assert valences.keys() == {6}
    assert found.report["singular"] == {"0.5": 4}
    assert found.report["total_index"] == 2
    at = (found.vertices[:, None] == found.singular_points).all(-1).any(1)
    assert found.topology.valences[at].tolist() == [3] * 4
    assert found.principal.exceptions.numel() == 0


def test_a_monkey_saddle_has_one_vertex_of_valence_nine() -> None:
    found = principal_triangles(*irregular(MonkeySaddle(), 1200), count=600)
    assert found.report["singular"] == {"-0.5": 1}
    at = (found.vertices[:, None] == found.singular_points).all(-1).any(1)
    assert found.topology.valences[at].tolist() == [9]


def test_rows_are_half_shifted_and_lie_along_the_smaller_curvature() -> None:
    """On z = (x^2 - y^2/2)/2 rows lie along y; in them vertices of one row are in the middle of those of the next."""
    found = principal_triangles(*irregular(SADDLE, 2000), count=600)
    assert found.principal.exceptions.numel() == 0
    stars = found.principal.stars()
    centre = found.vertices[stars.vertices]
    principal = found.vertices[stars.principal] - centre[:, None]
    assert (principal[..., 1].abs() > 5 * principal[..., 0].abs()).all()
    others = found.vertices[stars.cospherical] - centre[:, None]
    half = (others[..., 1].abs() / principal[..., 1].abs().mean(1, keepdim=True)).median()
    assert float(half) == pytest.approx(0.5, abs=0.03)
    assert found.report["row_distance"] == pytest.approx(np.sqrt(1 / 3 / (2 * 0.15)), abs=0.1)
    assert found.report["variation_over_curvature"] < 1.2


def test_energy_of_the_lattice_is_that_of_the_closed_form() -> None:
    """E per area is |a| + |b| + |a| / (2 ratio^2): with that share of C the ratio is chosen."""
    found = principal_triangles(*irregular(SADDLE, 3000), count=2500)
    share, ratio = 1 / 3, found.report["row_distance"]
    boundary = 1 - 2 / np.sqrt(found.report["faces"])  # edges there carry none
    expected = 1 + share / (2 * ratio**2)
    assert found.report["variation_over_curvature"] == pytest.approx(expected * boundary, rel=0.04)


def test_principal_symmetric_starts_from_it() -> None:
    found = principal_triangles(*irregular(Torus(), 1500), count=500)
    result = principal_symmetric(found.vertices, found.principal, levels=0)
    after = result.levels[-1].after
    assert max(after["largest_cospherical"], after["largest_coplanar"]) < 1e-8
    assert after["saddle_side_share"] == 1.0


def test_components() -> None:
    found = principal_triangles(*side_by_side(irregular(SADDLE), irregular(Torus())), count=800)
    assert found.report["components"] == 2
    assert found.report["euler_number"] == 1


def test_types_come_back() -> None:
    vertices, topology = irregular(SADDLE)
    found = principal_triangles(vertices.float(), topology, spacing=0.2, settings=MeshingSettings(align_boundary=False))
    assert found.vertices.dtype == torch.float32
    assert found.topology.is_triangular


def test_cells_are_cut_forward() -> None:
    positions = np.array([[0.0, 0, 0], [1, 0, 0], [0.5, 1, 0], [-0.5, 1, 0]])
    forward = [[0, 1, 2], [0, 2, 3]]
    assert cut_cells(positions, [[0, 1, 2, 3]], {(0, 1), (2, 3)}) == forward
    turned = cut_cells(positions, [[2, 3, 0, 1]], {(0, 1), (2, 3)})  # half a turn: the same diagonal
    assert {frozenset(t) for t in turned} == {frozenset(t) for t in forward}
    other = cut_cells(positions, [[1, 2, 3, 0]], {(0, 1), (2, 3)})
    assert {frozenset(t) for t in other} == {frozenset(t) for t in forward}
    back = cut_cells(positions, [[0, 1, 2, 3]], {(1, 2), (0, 3)})  # rows the other way: the other diagonal
    assert {frozenset(t) for t in back} == {frozenset({1, 2, 3}), frozenset({0, 1, 3})}


def test_clipped_cells_are_cut_without_turning_triangles_over() -> None:
    bent = np.array([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [1, 0.2, 0], [0, 2, 0]])
    triangles = cut_cells(bent, [[0, 1, 2, 3, 4]], set())
    assert len(triangles) == 3
    areas = [np.cross(bent[b] - bent[a], bent[c] - bent[a])[2] / 2 for a, b, c in triangles]
    assert min(areas) > 0
    assert sum(areas) == pytest.approx(2.2)


@pytest.mark.parametrize("lines", [2, 13])
def test_boxes_have_rows_lengthwise_and_keep_their_edges(lines: int) -> None:
    """Directions have four half turns on a box, but creases at right angles pull them both ways in every side."""
    vertices, topology = box(lines)
    found = principal_triangles(vertices, topology, count=700 if lines > 2 else 300)
    assert found.report["singular"] == {"0.5": 4}
    assert shape_of(found.topology) == shape_of(topology)
    assert found.report["crease_edges"] >= 36
    assert found.report["variation_over_curvature"] == pytest.approx(1, abs=1e-6)
    corners = vertices[(vertices * (1 - vertices) == 0).all(1)]
    assert (corners[:, None] == found.vertices).all(-1).any(1).all()
    assert not any("creases" in note for note in found.notes)


def triangulations(polygon: list[int]) -> list[list[list[int]]]:
    """All of a convex polygon, naively."""
    if len(polygon) < 3:
        return [[]]
    return [
        [*left, [polygon[0], polygon[k], polygon[-1]], *right]
        for k in range(1, len(polygon) - 1)
        for left in triangulations(polygon[: k + 1])
        for right in triangulations(polygon[k:])
    ]


def smallest_angle(positions: np.ndarray, triangles: list[list[int]]) -> float:
    corners = positions[np.array(triangles)]
    ahead, back = np.roll(corners, -1, axis=1) - corners, np.roll(corners, 1, axis=1) - corners
    cosines = (ahead * back).sum(2) / np.linalg.norm(ahead, axis=2) / np.linalg.norm(back, axis=2)
    return float(np.arccos(np.clip(cosines, -1, 1)).min())


@pytest.mark.parametrize("seed", range(5))
def test_clipped_cells_are_cut_with_the_largest_smallest_angle(seed: int) -> None:
    around = np.sort(np.random.default_rng(seed).uniform(0, 2 * np.pi, 6))
    positions = np.stack([np.cos(around), 0.5 * np.sin(around), 0 * around], axis=1)
    best = max(smallest_angle(positions, of) for of in triangulations(list(range(6))))
    assert len(triangulations(list(range(6)))) == 14
    assert smallest_angle(positions, cut_cells(positions, [list(range(6))], set())) == pytest.approx(best)


def test_nodes_on_a_straight_side_make_no_triangle_of_their_own() -> None:
    """Rounding gives such a triangle an area of 1e-17: corners of 0.0 degrees came out on boxes."""
    positions = np.array([[0.0, 0, 0], [0.1, 0.3, 0], [0.2, 0.6, 0], [0.3, 0.9, 0], [-1, 1, 0]])
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    for shift in range(5):
        face = np.roll(np.arange(5), shift).tolist()
        assert smallest_angle(positions @ turn, cut_cells(positions @ turn, [face], set())) > 0.1


@pytest.mark.parametrize(("lines", "count"), [(2, 100), (13, 100), (13, 300)])
def test_boxes_have_the_count_asked_for_and_no_corner_without_an_angle(lines: int, count: int) -> None:
    vertices, topology = box(lines, (1.0, 0.8, 0.6))
    found = principal_triangles(3 * vertices @ random_rotation(5).T + 1, topology, count=count)
    assert abs(found.report["faces"] / count - 1) <= 0.15
    assert found.report["smallest_angle_degrees"] > 1


def test_rounding_is_no_curvature() -> None:
    """Rows on a box were 0.96 or 1.28 spacings apart, by curvatures of 1e-15."""
    vertices, topology = box(13, (1.0, 0.8, 0.6))
    surface = read_surface(vertices @ random_rotation(2).T, topology, MeshingSettings())
    assert row_distance(surface.frames, surface.directions) == EQUILATERAL
    assert not rows_across(surface.frames, surface.directions)
