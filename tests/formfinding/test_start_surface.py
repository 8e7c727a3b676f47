"""Start surfaces: no folds, even triangles, as many as asked for, whatever the rims are."""

from __future__ import annotations

import math

import pytest
import torch
from form_boundaries import TURN, cone_distance, ring, wave
from torch import Tensor

from torchfair import Topology
from torchfair.curves import ClosedCurve
from torchfair.errors import MeshError
from torchfair.formfinding import FormRecipe, start_surface
from torchfair.geometry import corner_angles, dihedral_angles, face_area_vectors, face_areas
from torchfair.self_intersections import self_intersections

DOUBLE = torch.float64


def polygon(*rows: tuple[float, ...]) -> ClosedCurve:
    return ClosedCurve(torch.tensor([(*row, 0.0)[:3] for row in rows], dtype=DOUBLE))


def circle(radius: float, height: float, x: float = 0.0, *, tilt: float = 0.0) -> ClosedCurve:
    def function(t: Tensor) -> Tensor:
        a = math.tau * t
        return torch.stack([x + radius * a.cos(), radius * a.sin(), height + tilt * a.cos()], 1)

    return ClosedCurve.from_function(function)


def star(count: int, outer: float, inner: float, rise: float) -> ClosedCurve:
    rows = []
    for i in range(2 * count):
        radius, angle = (inner if i % 2 else outer), math.pi * i / count
        rows.append((radius * math.cos(angle), radius * math.sin(angle), -rise if i % 2 else rise))
    return polygon(*rows)


def spiral(turns: float, width: float, rise: float, growth: float = 1.0) -> ClosedCurve:
    steps = 60
    sides: list[list[tuple[float, float, float]]] = [[], []]
    for i in range(steps + 1):
        angle = math.tau * turns * i / steps
        for side, sign in zip(sides, (1, -1), strict=True):
            radius = 1.0 + growth * angle / math.tau + sign * width / 2
            side.append((radius * math.cos(angle), radius * math.sin(angle), rise * angle))
    return polygon(*sides[0], *sides[1][::-1])


ELL = ((0, 0), (8, 0), (8, 3), (3, 3), (3, 8), (0, 8))
YOU = ((0, 0), (9, 0), (9, 8), (6, 8), (6, 3), (3, 3), (3, 8), (0, 8))
RIMS: dict[str, list[ClosedCurve]] = {
    "an L": [polygon(*ELL)],
    "a bent L": [polygon(*((x, y, 0.024 * x * y) for x, y in ELL))],
    "a U": [polygon(*YOU)],
    "a star": [star(5, 2.0, 0.8, 0.3)],
    "a strip of 1 : 30": [polygon((0, 0), (30, 0), (30, 1), (0, 1))],
    "a spiral": [spiral(1.75, 0.6, 0.05)],
    "a ramp that winds over itself": [spiral(1.5, 1.0, 0.35, growth=0.0)],
    "a hole out of the middle": [circle(2.0, 0.0), circle(0.5, 0.4, 1.1)],
    "two Ls": [polygon(*ELL), polygon(*((x, y, 4.0) for x, y in ELL))],
    "a star around a hole": [star(5, 2.0, 1.2, 0.0), circle(0.4, 0.9)],
    "a circle and one that leans": [circle(1.0, 0.0), circle(1.0, 2.0, tilt=0.8)],
    "two holes": [circle(3.0, 0.0), circle(0.6, 0.4, -1.2), circle(0.6, 0.4, 1.2)],
    "trousers": [circle(1.0, 0.0, -1.5), circle(1.0, 0.0, 1.5), circle(1.2, 4.0)],
}


def assert_good(curves: list[ClosedCurve], vertices: Tensor, topology: Topology, count: int) -> None:
    assert topology.num_vertices == pytest.approx(count, rel=0.1)
    assert topology.num_vertices - topology.num_edges + topology.num_faces == 2 - len(curves)
    assert len(topology.boundary_loops()) == len(curves)
    assert math.degrees(float(corner_angles(vertices, topology).min())) >= 15.0
    assert math.degrees(float(dihedral_angles(vertices, topology).abs().max())) < 100.0
    assert not len(self_intersections(vertices, topology))
    rim = vertices[topology.is_boundary_vertex]
    nearest = torch.stack([(curve.at(curve.parameters_of(rim)) - rim).norm(dim=1) for curve in curves]).amin(0)
    assert float(nearest.max()) < 1e-6
    for curve in curves:  # corners are vertices
        if len(curve.corners):
            assert float((curve.at(curve.corners)[:, None] - rim).norm(dim=2).min(1).values.max()) < 1e-9


@pytest.mark.parametrize("name", RIMS)
def test_starts_have_no_folds_and_even_triangles(name: str) -> None:
    curves = RIMS[name]
    vertices, topology = start_surface(curves, 300)
    assert_good(curves, vertices, topology, 300)


@pytest.mark.slow
@pytest.mark.parametrize("count", [150, 1000])
@pytest.mark.parametrize("name", RIMS)
def test_starts_are_good_at_any_size(name: str, count: int) -> None:
    curves = RIMS[name]
    vertices, topology = start_surface(curves, count)
    assert_good(curves, vertices, topology, count)


def test_a_flat_rim_that_is_not_convex_is_filled_exactly() -> None:
    """No face is turned over and none lies outside: areas add up, to that of an L."""
    vertices, topology = start_surface([polygon(*ELL)], 300)
    assert bool((face_area_vectors(vertices, topology)[:, 2] > 0.0).all())
    assert float(face_areas(vertices, topology).sum()) == pytest.approx(39.0, rel=1e-12)


@pytest.mark.parametrize("name", ["an L", "a hole out of the middle", "trousers"])
def test_faces_run_with_the_first_curve(name: str) -> None:
    first, *others = RIMS[name]
    for curve in (first, ClosedCurve(first.at(first.spaced(120)).flip(0))):
        vertices, topology = start_surface([curve, *others], 200)
        for loop in topology.boundary_loops():
            places = curve.parameters_of(vertices[loop])
            if float((curve.at(places) - vertices[loop]).norm(dim=1).max()) < 1e-3:
                ahead = torch.remainder(places.roll(-1) - places + 0.5, 1.0) - 0.5
                assert bool((ahead > 0.0).all())
                break
        else:
            pytest.fail("no loop lies on the first curve")


def test_narrow_rims_have_several_rows() -> None:
    """Sizes follow the width: a row of inner vertices fits into the neck of a dumbbell, which is half an edge wide."""
    dumbbell = polygon(
        (0, 0), (4, 0), (4, 1.9), (6, 1.9), (6, 0), (10, 0), (10, 4), (6, 4), (6, 2.1), (4, 2.1), (4, 4), (0, 4)
    )
    vertices, topology = start_surface([dumbbell], 600)
    assert_good([dumbbell], vertices, topology, 600)
    inner = vertices[~topology.is_boundary_vertex]
    neck = (inner[:, 0] > 4.2) & (inner[:, 0] < 5.8)
    assert int(neck.sum()) >= 8


def test_rims_that_cross_or_come_twice_are_refused_by_place() -> None:
    eight = polygon((0, 0), (2, 2), (2, 0), (0, 2))
    with pytest.raises(MeshError, match=r"the curve crosses itself near \((0.9|1)"):
        start_surface([eight])
    with pytest.raises(MeshError, match="curves 0 and 1 are the same"):
        start_surface([circle(1.0, 0.0), circle(1.0, 0.0)])
    with pytest.raises(MeshError, match="curves 0 and 1 are the same"):
        start_surface([circle(1.0, 0.0), ClosedCurve(circle(1.0, 0.0).at(torch.arange(50).double().flip(0) / 50))])
    with pytest.raises(MeshError, match="cross or touch near"):
        start_surface([circle(1.0, 0.0), circle(1.0, 0.0, 1.5)])


def test_curves_that_no_surface_is_found_between_are_named() -> None:
    chain = [circle(1.0, 0.0), circle(0.2, 0.0, 3.0), circle(0.2, 0.5, 0.0), circle(0.2, -0.5, 0.0)]
    with pytest.raises(MeshError, match="between these 4 curves"):
        start_surface(chain, 300)


def test_a_start_that_has_to_run_through_itself_says_so() -> None:
    """No disk without self-intersections is bounded by a knot."""

    def trefoil(t: Tensor) -> Tensor:
        a = math.tau * t
        radius = 2.0 + (3.0 * a).cos()
        return torch.stack([radius * (2.0 * a).cos(), radius * (2.0 * a).sin(), (3.0 * a).sin()], 1)

    recipe = FormRecipe(*start_surface([ClosedCurve.from_function(trefoil)], 90))
    assert recipe.before()["self_intersections"] > 0
    assert [note for note in recipe.notes if "runs through itself" in note]
    disk = FormRecipe(*start_surface([circle(1.0, 0.0)], 61))
    disk.before()
    assert not disk.notes


@pytest.mark.parametrize("count", [7, 57, 1000])
def test_start_disks_have_valence_six_and_good_faces(count: int) -> None:
    vertices, topology = start_surface([wave()], count)
    assert topology.num_vertices == pytest.approx(count, rel=0.1)
    assert topology.num_vertices - topology.num_edges + topology.num_faces == 1
    assert set(topology.valences[~topology.is_boundary_vertex].tolist()) <= {6}
    assert bool((face_areas(vertices, topology) > 0).all())


def test_start_annuli_join_curves_of_either_direction() -> None:
    back = ClosedCurve.from_function(
        lambda t: torch.stack([0.5 * torch.cos(1.0 - TURN * t), 0.5 * torch.sin(1.0 - TURN * t), 1.0 + 0 * t], 1)
    )
    vertices, topology = start_surface([ring(1.0, 0.0), back], 500)
    assert topology.num_vertices - topology.num_edges + topology.num_faces == 0
    assert len(topology.boundary_loops()) == 2
    # Straight lines between nearest places: the cone itself.
    assert cone_distance(vertices, 1.0, 0.5, 1.0) < 0.02


def test_start_surfaces_refuse_what_they_cannot_join() -> None:
    with pytest.raises(MeshError, match="got none"):
        start_surface([])
    with pytest.raises(MeshError, match="at least 7"):
        start_surface([wave()], 3)
