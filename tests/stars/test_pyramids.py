"""Normal pyramids: order, perimeter, winding, self-intersections, and the theorem on good saddles."""

from __future__ import annotations

import math
from itertools import combinations

import numpy as np
import pytest
import torch
from geometry_meshes import DEGENERATE, GENERIC, icosphere, random_polytope, torus
from helpers import DOUBLE, cube, random_rotation, tetrahedron, wavy_grid
from hypothesis import given, settings
from hypothesis import strategies as st
from star_tools import random_arms, star_of, stars_of

from torchfair import MeshError, Topology
from torchfair.geometry import dihedral_angles, face_normals
from torchfair.stars import (
    arc_crossings,
    classify_stars,
    normal_pyramid,
    pyramid_perimeters,
    pyramid_self_intersections,
    pyramid_windings,
)


def slow_crossings(points: np.ndarray) -> int:
    """Pairs of arcs of a small closed polygon that cross, found in the plane that touches the sphere at its mean."""
    axis = points.sum(0) / np.linalg.norm(points.sum(0))
    right = np.cross(np.eye(3)[np.abs(axis).argmin()], axis)
    x = points @ right / (points @ axis)
    y = points @ np.cross(axis, right) / (points @ axis)
    z = x + 1j * y  # great circles became lines
    arcs = list(zip(z, np.roll(z, -1), strict=True))
    found = 0
    for (a, b), (c, d) in combinations(arcs, 2):
        across = ((b - a).conjugate() * (d - c)).imag
        if across == 0:
            continue
        t = ((c - a).conjugate() * (d - c)).imag / across  # a + t (b - a) = c + s (d - c)
        s = ((c - a).conjugate() * (b - a)).imag / across
        found += 1e-9 < t < 1 - 1e-9 and 1e-9 < s < 1 - 1e-9
    return found


def on_circle(degrees: list[float], height: float = 0.8) -> torch.Tensor:
    angles = torch.tensor(degrees, dtype=DOUBLE).deg2rad()
    radius = math.sqrt(1 - height**2)
    return torch.stack([radius * angles.cos(), radius * angles.sin(), torch.full_like(angles, height)], dim=-1)


# ---- Prop. 1 -------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_good_saddles_have_no_self_intersecting_pyramid() -> None:
    seen = 0
    for seed, (height, saddle) in enumerate([(0.1, 0.4), (0.1, 0.8), (0.3, 1.5), (0.6, 3), (0.05, 0.5), (0.02, 0.05)]):
        vertices, topology = stars_of(random_arms(4400, 6, seed, height=height, saddle=saddle))
        good = classify_stars(vertices, topology).good
        assert not bool(pyramid_self_intersections(vertices, topology)[good].any())
        seen += int(good.sum())
    assert seen >= 10_000


def test_other_stars_do_have_self_intersections() -> None:
    """So the theorem above says something."""
    vertices, topology = stars_of(random_arms(1000, 6, 0, height=0.3, saddle=0.3))
    classes = classify_stars(vertices, topology)
    others = classes.kinds == 2
    assert int(others.sum()) > 50
    assert int((pyramid_self_intersections(vertices, topology)[others] > 0).sum()) > 30


@pytest.mark.parametrize("valence", [4, 5, 7, 8])
def test_prop_1_holds_for_other_valences(valence: int) -> None:
    vertices, topology = stars_of(random_arms(2000, valence, 1, height=0.2, saddle=0.6))
    good = classify_stars(vertices, topology).good
    assert int(good.sum()) > 400
    assert not bool(pyramid_self_intersections(vertices, topology)[good].any())


# ---- self-intersections --------------------------------------------------------------------------------


@pytest.mark.parametrize("valence", [4, 5, 6, 8])
def test_equals_the_slow_count_in_the_plane(valence: int) -> None:
    vertices, topology = stars_of(random_arms(300, valence, 2, height=0.2, saddle=0.2))
    counts = pyramid_self_intersections(vertices, topology)[:: valence + 1].tolist()
    for star, count in enumerate(counts):
        pyramid = normal_pyramid(vertices, topology, star * (valence + 1))
        assert count == slow_crossings(pyramid.numpy()), star
    assert max(counts) > 0


def test_star_polygons_and_touching_arcs() -> None:
    assert int(arc_crossings(on_circle([0, 72, 144, 216, 288])).sum()) == 0
    assert int(arc_crossings(on_circle([0, 144, 288, 72, 216])).sum()) == 2 * 5  # the pentagram
    assert int(arc_crossings(on_circle([0, 180, 90, 270])).sum()) == 2  # a bow tie
    pole = torch.tensor([[0.0, 0, 1]], dtype=DOUBLE)
    touching = torch.cat([on_circle([0, 120]), pole, on_circle([240]), pole])  # two lobes that meet in the pole
    assert int(arc_crossings(touching).sum()) == 0
    doubled = on_circle([0, 0, 120, 240, 240])
    assert int(arc_crossings(doubled).sum()) == 0
    there_and_back = on_circle([0, 90, 0, 90])
    assert int(arc_crossings(there_and_back).sum()) == 0
    opposite = torch.tensor([[1.0, 0, 0], [-1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=DOUBLE)
    assert int(arc_crossings(opposite).sum()) == 0
    assert int(arc_crossings(torch.zeros(5, 3)).sum()) == 0


def test_far_side_of_the_sphere_does_not_count() -> None:
    """The great circles of these two arcs meet, but one arc lies where the other's opposite points are."""
    a = on_circle([0, 180], 0.9)
    b = -on_circle([90, 270], 0.9)
    assert int(arc_crossings(torch.cat([a, b])).sum()) == 0


@settings(max_examples=20, deadline=None)
@given(st.integers(4, 8), st.integers(0, 10**6), st.floats(1e-3, 1e3), st.booleans(), st.booleans())
def test_invariance(valence: int, seed: int, scale: float, mirrored: bool, reversed_faces: bool) -> None:
    vertices, topology = stars_of(random_arms(10, valence, seed, height=0.3, saddle=0.3))
    moved = scale * (vertices @ random_rotation(seed).T + 0.7)
    if mirrored:
        moved = moved * torch.tensor([1.0, -1, 1], dtype=DOUBLE)
    other = topology
    if reversed_faces:
        other = Topology.from_faces([face[::-1] for face in topology.face_lists()])
    before, after = (pyramid_self_intersections(*mesh) for mesh in ((vertices, topology), (moved, other)))
    assert torch.equal(before, after)
    perimeters = pyramid_perimeters(vertices, topology), pyramid_perimeters(moved, other)
    torch.testing.assert_close(*perimeters, rtol=1e-7, atol=1e-9)


def test_rounding_makes_no_crossings() -> None:
    """A plane and a cylinder in single precision have normals whose order is noise."""
    x, y = torch.meshgrid(torch.linspace(0.5, 1.5, 30), torch.linspace(0, 1, 30), indexing="ij")
    index = torch.arange(900).view(30, 30)
    corners = index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]
    a, b, c, d = (corner.reshape(-1) for corner in corners)
    topology = Topology.from_faces(torch.cat([torch.stack([a, b, c], 1), torch.stack([a, c, d], 1)]))
    for z in (0.3 * x - 0.2 * y + 10, (1 - (x - 1) ** 2).sqrt()):
        vertices = torch.stack([x, y, z], dim=-1).reshape(-1, 3).to(torch.float32)
        assert int(pyramid_self_intersections(vertices, topology).sum()) == 0


@pytest.mark.parametrize("distance", [30.0, 1000.0])
def test_rounding_of_places_far_from_the_origin_makes_no_crossings(distance: float) -> None:
    """In single precision a place loses digits with its distance, and small faces turn the more."""
    vertices, topology = wavy_grid(30, 30, triangles=True)
    flat = 0.1 * vertices * torch.tensor([1.0, 1.0, 0.0], dtype=DOUBLE) @ random_rotation(1).T
    far = (flat + distance * torch.tensor([1.0, 0.7, -0.4], dtype=DOUBLE)).float()
    assert int(pyramid_self_intersections(far.double(), topology).sum()) > 0  # if these were the exact places
    assert int(pyramid_self_intersections(far, topology).sum()) == 0


# ---- order, perimeter, winding -------------------------------------------------------------------------


@pytest.mark.parametrize("make", [tetrahedron, cube, lambda: random_polytope(2), lambda: torus(9, 7)])
def test_pyramid_runs_through_the_faces_in_the_order_of_the_ring(make: object) -> None:
    vertices, topology = make()  # type: ignore[operator]
    faces = topology.face_lists()
    normals = face_normals(vertices, topology)
    for vertex in range(0, topology.num_vertices, 3):
        start, stop = topology.ring_offsets[vertex : vertex + 2].tolist()
        ring = topology.ring_vertices[start:stop].tolist()
        expected = []
        for first, second in zip(ring, ring[1:] + ring[:1], strict=True):
            sector = {first, vertex, second}
            expected.append(next(f for f, face in enumerate(faces) if sector <= set(face)))
        torch.testing.assert_close(normal_pyramid(vertices, topology, vertex), normals[expected])


def test_only_inner_vertices_have_a_pyramid() -> None:
    vertices, topology = star_of(random_arms(1, 5, 0)[0])
    for vertex in (1, 6, -1):
        with pytest.raises(MeshError, match="no normal pyramid"):
            normal_pyramid(vertices, topology, vertex)


@pytest.mark.parametrize("make", GENERIC.values(), ids=GENERIC)
def test_perimeters_sum_up_unsigned_angles(make: object) -> None:
    vertices, topology = make()  # type: ignore[operator]
    expected = torch.zeros(topology.num_vertices, dtype=DOUBLE)
    angles = dihedral_angles(vertices, topology).abs()
    for (v, w), angle in zip(topology.interior_edges.tolist(), angles, strict=True):
        expected[v] += angle
        expected[w] += angle
    expected[topology.is_boundary_vertex] = 0
    torch.testing.assert_close(pyramid_perimeters(vertices, topology), expected)


def test_perimeter_of_convex_pyramids_is_below_a_great_circle() -> None:
    for seed in range(5):
        vertices, topology = random_polytope(seed)
        assert float(pyramid_perimeters(vertices, topology).max()) < 2 * math.pi
    corners = pyramid_perimeters(*cube())
    torch.testing.assert_close(corners, torch.full_like(corners, 1.5 * math.pi))  # an octant


def test_windings() -> None:
    for mesh in (tetrahedron(), cube(), icosphere(1)):
        assert bool((pyramid_windings(*mesh) == 1).all())
    angles = np.arange(12) * math.pi / 6
    for waves in (0, 2, 3, 4):  # the plane meets the star in 2 * waves segments
        heights = 0.3 * np.cos(waves * angles + 0.1)
        vertices, topology = star_of(np.stack([np.cos(angles), np.sin(angles), heights], axis=1))
        assert int(pyramid_windings(vertices, topology)[0]) == 1 - waves
        reverse = Topology.from_faces([face[::-1] for face in topology.face_lists()])
        assert int(pyramid_windings(vertices, reverse)[0]) == 1 - waves


@pytest.mark.parametrize("make", DEGENERATE.values(), ids=DEGENERATE)
def test_degenerate_input_has_finite_answers(make: object) -> None:
    vertices, topology = make()  # type: ignore[operator]
    for dtype in (torch.float32, DOUBLE):
        points = vertices.to(dtype).requires_grad_()
        perimeters = pyramid_perimeters(points, topology)
        assert bool(torch.isfinite(perimeters).all())
        perimeters.sum().backward()
        assert points.grad is not None
        assert bool(torch.isfinite(points.grad).all())
        assert bool((pyramid_self_intersections(points, topology) >= 0).all())
        assert pyramid_windings(points, topology).shape == points.shape[:-1]


def test_batches() -> None:
    vertices, topology = stars_of(random_arms(8, 6, 4, height=0.3, saddle=0.2))
    batch = torch.stack([vertices, 2 * vertices, vertices.flip(-1)])
    for function in (pyramid_self_intersections, pyramid_windings, pyramid_perimeters):
        torch.testing.assert_close(function(batch, topology), torch.stack([function(v, topology) for v in batch]))
