"""Ready-made terms against the quantities they stand for."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, cube, random_rotation, tetrahedron, wavy_grid
from torch import Tensor

from torchfair import Topology, constraints
from torchfair.boundary import boundary_corners, boundary_pieces
from torchfair.constraints.closeness import TangentPlanes
from torchfair.constraints.lifted_normal_variation import lifted_normal_variation_blocks, lifted_normal_variation_terms
from torchfair.constraints.normal_variation import edge_stencils
from torchfair.energies import normal_variation
from torchfair.geometry import corner_angles, dihedral_angles, dual_edge_lengths, edge_lengths, face_areas
from torchfair.geometry.closest_point import ReferenceSurface
from torchfair.geometry.spline_curves import SplineCurves
from torchfair.projection import ElementTerm


def hybrid() -> tuple[Tensor, Topology]:
    """Triangles, quads and pentagons around an interior vertex and along interior edges, generic position."""
    faces = [[0, 1, 4, 3], [1, 2, 5, 4], [3, 4, 7, 6], [4, 5, 8], [4, 8, 7], [2, 9, 10, 11, 5], [5, 11, 8]]
    points = torch.tensor(
        [[0, 0, 0], [1, 0, 0.1], [2, 0, 0], [0, 1, 0.2], [1, 1, 0.5], [2, 1, 0.2], [0, 2, 0], [1, 2, 0.3], [2, 2, 0],
         [3, -0.3, 0], [3.6, 0.4, 0.1], [3, 1, -0.2]],
        dtype=DOUBLE,
    )  # fmt: skip
    noise = 0.1 * torch.randn(points.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(3))
    return points + noise, Topology.from_faces(faces)


MESHES = {
    "cube": cube,
    "tetrahedron": tetrahedron,
    "triangles": lambda: wavy_grid(triangles=True),
    "quads": wavy_grid,
    "hybrid": hybrid,
}


def values(term: ElementTerm, vertices: Tensor) -> Tensor:
    return term.values(term.arguments({"vertices": vertices}))


@pytest.mark.parametrize("name", MESHES)
def test_edge_stencils_hold_both_faces(name: str) -> None:
    _, topology = MESHES[name]()
    faces = topology.face_lists()
    found = 0
    for (k, m), rows in edge_stencils(topology).items():
        for row in rows.tolist():
            left, right = row[:k], [row[1], row[0], *row[k:]]
            assert len(right) == m
            for polygon in (left, right):
                assert any(sorted(polygon) == sorted(f) and _same_cycle(polygon, f) for f in faces)
            found += 1
    assert found == topology.num_interior_edges


def _same_cycle(a: list[int], b: list[int]) -> bool:
    shift = b.index(a[0])
    return a == b[shift:] + b[:shift]


@pytest.mark.parametrize("name", MESHES)
def test_residuals_of_normal_variation_are_l_times_dual_l(name: str) -> None:
    vertices, topology = MESHES[name]()
    terms = constraints.normal_variation_terms(topology, smoothing=1e-12)
    norms = torch.cat([torch.linalg.vector_norm(values(term, vertices), dim=1) for term in terms])
    expected = edge_lengths(vertices, topology)[: topology.num_interior_edges] * dual_edge_lengths(vertices, topology)
    assert norms.sort().values.allclose(expected.sort().values, atol=1e-12)
    merit = sum(float(t.contributions(a := t.arguments({"vertices": vertices}), t.values(a)).sum()) for t in terms)
    assert merit == pytest.approx(float(normal_variation(vertices, topology)), rel=1e-9)


def test_bend_residual_has_the_sign_of_the_dihedral_angle_and_passes_smoothly_through_zero() -> None:
    vertices, topology = wavy_grid(triangles=True)
    (term,) = constraints.normal_variation_terms(topology, smoothing=1e-2)
    assert torch.equal(values(term, vertices)[:, 0].sign(), dihedral_angles(vertices, topology).sign())
    flat = vertices * torch.tensor([1.0, 1.0, 0.0], dtype=DOUBLE)
    residuals, jacobians = term.linearised(term.arguments({"vertices": flat}))
    assert (residuals.abs() < 1e-14).all()
    assert torch.isfinite(jacobians).all()
    assert (jacobians.flatten(1).abs().amax(1) > 0.1).all()  # a flat edge still feels its bending


def test_polygon_twist_vanishes_for_planar_faces_only() -> None:
    vertices, topology = cube()
    (term,) = constraints.normal_variation_terms(topology, smoothing=1e-2)
    assert (values(term, vertices)[:, 1].abs() < 1e-14).all()
    vertices, topology = wavy_grid()
    (term,) = constraints.normal_variation_terms(topology, smoothing=1e-2)
    assert (values(term, vertices)[:, 1].abs() > 1e-6).any()


def test_planarity_is_the_distance_of_the_diagonals() -> None:
    quad = torch.tensor([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=DOUBLE)
    topology = Topology.from_faces([[0, 1, 2, 3]])
    (term,) = constraints.planarity_terms(topology, torch.tensor([0]), weight=1.0)
    assert float(values(term, quad)) == 0.0
    lifted = quad + torch.tensor([[0, 0, 0.3], [0, 0, 0], [0, 0, 0.3], [0, 0, 0]], dtype=DOUBLE)
    assert abs(float(values(term, lifted))) == pytest.approx(0.3)
    assert abs(float(values(term, lifted @ random_rotation().T + 5.0))) == pytest.approx(0.3)


def test_planarity_of_polygons_vanishes_exactly_when_all_corners_lie_in_a_plane() -> None:
    angle = torch.arange(6, dtype=DOUBLE) * math.pi / 3
    hexagon = torch.stack([angle.cos(), angle.sin(), torch.zeros(6, dtype=DOUBLE)], 1) @ random_rotation(2).T
    topology = Topology.from_faces([list(range(6))])
    (term,) = constraints.planarity_terms(topology, torch.tensor([0]), weight=1.0)
    assert (values(term, hexagon).abs() < 1e-15).all()
    hexagon[4] += 0.01
    assert (values(term, hexagon).abs() > 1e-4).any()


def test_triangles_need_no_planarity_term() -> None:
    _, topology = tetrahedron()
    assert constraints.planarity_terms(topology, torch.arange(4), weight=1.0) == []


def test_barriers_see_corner_angles_and_area_ratios() -> None:
    vertices, topology = hybrid()
    angles, areas = corner_angles(vertices, topology), face_areas(vertices, topology)
    safe = torch.full_like(angles, math.pi)
    (term,) = constraints.corner_angle_terms(topology, 0.0, safe, weight=1.0)
    expected = 1.1 * math.pi / (angles + 0.1 * math.pi) - 1
    assert values(term, vertices)[:, 0].allclose(expected)
    terms = constraints.face_area_terms(topology, 2.0 * areas, smallest=0.2, safe=0.8, weight=1.0)
    for term in terms:
        assert values(term, vertices).allclose(torch.tensor(0.66 / 0.36 - 1, dtype=DOUBLE))


def test_fairness_vanishes_on_regular_lattices_and_acts_on_every_interior_vertex() -> None:
    for triangles in (False, True):
        vertices, topology = wavy_grid(7, 6, triangles=triangles)
        regular = vertices.round() * torch.tensor([1.0, 1.0, 0.0], dtype=DOUBLE)
        terms = constraints.interior_fairness_terms(topology, weight=1.0)
        assert all(float(values(term, regular).abs().max()) < 1e-14 for term in terms)
        felt = torch.cat([term.stencil[0][1].flatten() for term in terms]).unique()
        assert torch.isin(torch.nonzero(~topology.is_boundary_vertex).squeeze(1), felt).all()


def fan(sizes: list[int]) -> tuple[Tensor, Topology]:
    """Vertex 0 with faces of these sizes around it, its neighbours 1, 2, ... first; generic position."""
    count, faces = 1 + len(sizes), []
    for number, size in enumerate(sizes):
        outer = list(range(count, count + size - 3))
        count += len(outer)
        faces.append([0, 1 + number, *outer, 1 + (number + 1) % len(sizes)])
    points = torch.randn(count, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(7))
    return points, Topology.from_faces(faces)


@pytest.mark.parametrize(
    "sizes", [[4, 4, 4, 4], [4, 4, 4, 3], [4, 4, 3, 4, 4], [4, 4, 3, 4, 4, 3], [4, 4, 4], [3, 3, 3, 3], [4, 4, 4, 5]]
)
def test_second_differences_stand_for_umbrellas_between_exactly_four_quads_only(sizes: list[int]) -> None:
    """A vertex with four quads and triangles besides lies on no grid: without its umbrella nothing would hold it."""
    points, topology = fan(sizes)
    found = [
        value for term in constraints.interior_fairness_terms(topology, weight=1.0) for value in values(term, points)
    ]
    ring = points[1 : 1 + len(sizes)]
    if sizes == [4, 4, 4, 4]:
        expected = [0.5 * (ring[0] + ring[2]) - points[0], 0.5 * (ring[1] + ring[3]) - points[0]]
    else:
        expected = [ring.mean(0) - points[0]]
    assert len(found) == len(expected)
    assert all(any(value.allclose(other) for value in found) for other in expected)


def test_boundary_fairness_leaves_corners_alone() -> None:
    vertices, topology = wavy_grid()
    flat = vertices.round() * torch.tensor([1.0, 1.0, 0.0], dtype=DOUBLE)
    corners = boundary_corners(flat, topology, math.radians(40))
    assert int(corners.sum()) == 4
    (term,) = constraints.boundary_fairness_terms(topology, corners, weight=1.0)
    assert not torch.isin(term.stencil[0][1][:, 1], torch.nonzero(corners).squeeze(1)).any()
    assert float(values(term, flat).abs().max()) < 1e-14


def test_closeness_is_the_distance_and_points_away_from_the_surface() -> None:
    """Residual squared and its gradient are those of the true squared distance, also past the boundary."""
    vertices, topology = cube()
    planes = TangentPlanes(ReferenceSurface(vertices, topology))
    points = torch.tensor([[0.5, 0.5, 1.4], [1.3, 1.4, 0.5], [0.5, 0.4, 0.9], [-0.3, -0.4, -1.0]], dtype=DOUBLE)
    (term,) = constraints.closeness_terms(planes, torch.arange(4), weight=1.0)
    residuals, jacobians = term.linearised(term.arguments({"vertices": points}))
    expected = torch.tensor([0.4, 0.5, 0.1, math.sqrt(0.09 + 0.16 + 1.0)], dtype=DOUBLE)
    assert residuals[:, 0].abs().allclose(expected)
    feet = torch.tensor([[0.5, 0.5, 1.0], [1.0, 1.0, 0.5], [0.5, 0.4, 1.0], [0, 0, 0]], dtype=DOUBLE)
    assert (residuals[:, :, None] * jacobians)[:, 0].allclose(points - feet)


def test_planes_of_all_vertices_in_order_are_not_copied() -> None:
    vertices, topology = wavy_grid()
    planes, every = TangentPlanes(ReferenceSurface(vertices * 1.01, topology)), torch.arange(topology.num_vertices)
    state, known = {"vertices": vertices}, planes({"vertices": vertices})

    def data(chosen: Tensor) -> tuple[Tensor, ...]:
        (term,) = constraints.closeness_terms(planes, chosen, weight=1.0)
        return term.arguments_at(state).data

    for mine, whole in zip(data(every), planes(state), strict=True):
        assert mine.data_ptr() == whole.data_ptr()
    for chosen in (every.flip(0), every[:-1], every[1:], every[3:4]):
        for mine, whole in zip(data(chosen), known, strict=True):
            assert torch.equal(mine, whole[chosen])


def test_closeness_on_the_surface_uses_the_vertex_normal() -> None:
    vertices, topology = cube()
    planes = TangentPlanes(ReferenceSurface(vertices, topology))
    _, normals = planes({"vertices": vertices})
    assert normals.allclose((vertices - 0.5) / math.sqrt(0.75))


def test_terms_that_see_the_same_state_search_once(monkeypatch: pytest.MonkeyPatch) -> None:
    vertices, topology = wavy_grid()
    planes = TangentPlanes(ReferenceSurface(vertices, topology))
    searched = []
    closest = planes._closest
    monkeypatch.setattr(planes, "_closest", lambda points: (searched.append(points), closest(points))[1])
    limits = torch.ones(topology.num_vertices, dtype=DOUBLE)
    terms = [
        *constraints.closeness_terms(planes, torch.arange(topology.num_vertices), weight=1.0),
        *constraints.distance_limit_terms(planes, limits, weight=1.0),
    ]
    state = {"vertices": vertices + 0.1}
    near, limited = (term.arguments(state) for term in terms)
    assert len(searched) == 1
    assert torch.equal(near[1], limited[1])
    state["vertices"] += 0.1  # the same tensor with other values
    again = terms[0].arguments(state)
    assert len(searched) == 2
    assert not torch.equal(again[1], near[1])
    with torch.inference_mode():  # where torch does not count changes
        inferred = {"vertices": vertices + 0.1}
        first = terms[0].arguments(inferred)[1]
        inferred["vertices"] += 0.1
        assert torch.equal(first, near[1])
        assert torch.equal(terms[0].arguments(inferred)[1], again[1])


def test_distance_limit_is_a_wall() -> None:
    vertices, topology = cube()
    planes = TangentPlanes(ReferenceSurface(vertices, topology))
    limits = torch.full((1,), 0.2, dtype=DOUBLE)
    (term,) = constraints.distance_limit_terms(planes, limits, weight=1.0)
    for height, expected in ((1.05, 0.0), (1.2, 10.0), (1.21, math.inf), (0.79, math.inf)):
        value = float(values(term, torch.tensor([[0.5, 0.5, height]], dtype=DOUBLE)))
        assert value == pytest.approx(expected, abs=1e-9)


def test_gliding_is_free_along_the_curve_and_stops_at_its_ends() -> None:
    line = torch.tensor([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]], dtype=DOUBLE)
    curves = SplineCurves([line], [False])
    feet = constraints.CurveFeet(curves, torch.arange(3), torch.zeros(3, dtype=torch.int64))
    (term,) = constraints.gliding_terms(feet, weight=1.0)
    points = torch.tensor([[0.7, 0.3, 0.4], [2.6, 0.8, 0.0], [-0.8, 0.0, 0.6]], dtype=DOUBLE)
    residuals, jacobians = term.linearised(term.arguments({"vertices": points}))
    assert torch.linalg.vector_norm(residuals, dim=1).allclose(torch.tensor([0.5, 1.0, 1.0], dtype=DOUBLE))
    assert (jacobians[0, :, 0].abs() < 1e-14).all()
    assert jacobians[1:].allclose(torch.eye(3, dtype=DOUBLE))


def test_boundary_pieces_and_gliding_need_no_boundary() -> None:
    vertices, topology = cube()
    assert boundary_pieces(topology, boundary_corners(vertices, topology, 0.5)) == []
    assert constraints.handle_terms(torch.zeros(0, dtype=torch.int64), torch.zeros(0, 3), weight=1.0) == []


@pytest.mark.parametrize("name", ["cube", "triangles", "quads", "hybrid"])
def test_lifted_variables_satisfy_their_constraints_and_carry_the_energy(name: str) -> None:
    vertices, topology = MESHES[name]()
    planar = topology.face_sizes == 3 if name != "cube" else torch.ones(topology.num_faces, dtype=torch.bool)
    state = {"vertices": vertices, **lifted_normal_variation_blocks(vertices, topology)}
    terms = lifted_normal_variation_terms(vertices, topology, planar, weight=1.0, constraint_weight=10.0)
    for term in terms[:-1]:
        assert term.weight == 10.0
        assert float(term.values(term.arguments(state)).abs().max()) < 1e-13, term.name
    target = terms[-1]
    arguments = target.arguments(state)
    energy = float(target.contributions(arguments, target.values(arguments)).sum())
    assert energy == pytest.approx(float(normal_variation(vertices, topology)), rel=1e-12)
    unknowns = sum(block.numel() for block in state.values())
    assert unknowns == 3 * topology.num_vertices + 3 * topology.num_faces + 4 * topology.num_interior_edges
