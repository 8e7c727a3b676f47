"""Closest points on a reference surface are exact: against rational arithmetic, closed forms and each other."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from closest_reference import exact_squared_distance, measure_every_piece, ridge, same, soup
from geometry_meshes import icosphere
from helpers import DOUBLE, cube, grid_faces, random_rotation, tetrahedron, wavy_grid
from hypothesis import given, settings
from hypothesis import strategies as st

from torchfair import MeshError, ShapeError, Topology
from torchfair.geometry import _closest_search, _closest_tracker
from torchfair.geometry.closest_point import ReferenceSurface

EPS = torch.finfo(DOUBLE).eps


# ---- exactness -------------------------------------------------------------------------------------------

TRIANGLE = torch.tensor([[[0.0, 0, 0], [4, 0, 0], [0, 3, 0]]], dtype=DOUBLE)


@pytest.mark.parametrize(
    ("point", "position", "weights"),
    [
        ([1, 1, 2], [1, 1, 0], [5 / 12, 1 / 4, 1 / 3]),  # inside
        ([1, 1, -2], [1, 1, 0], [5 / 12, 1 / 4, 1 / 3]),  # inside, below
        ([1, -3, 4], [1, 0, 0], [3 / 4, 1 / 4, 0]),  # edges
        ([5, 4, 0], [2.72, 0.96, 0], [0, 0.68, 0.32]),
        ([-2, 1, 0], [0, 1, 0], [2 / 3, 0, 1 / 3]),
        ([-1, -2, 2], [0, 0, 0], [1, 0, 0]),  # corners
        ([9, -1, 0], [4, 0, 0], [0, 1, 0]),
        ([-1, 6, 0], [0, 3, 0], [0, 0, 1]),
    ],
)
def test_face_edge_and_corner_regions_of_a_triangle(point, position, weights):
    found = soup(TRIANGLE).closest(torch.tensor([point], dtype=DOUBLE))
    assert found.positions[0].tolist() == pytest.approx(position, abs=2 * EPS)
    assert found.weights[0].tolist() == pytest.approx(weights, abs=2 * EPS)
    assert found.distances.item() == pytest.approx(math.dist(point, position), rel=4 * EPS)
    assert found.normals[0].tolist() == [0, 0, 1]


small = st.integers(-4, 4).map(float)
general = st.floats(-2, 2, width=32)


@pytest.mark.parametrize("coordinate", [small, general], ids=["ties, duplicates and zero areas", "general"])
def test_distances_agree_with_rational_arithmetic(coordinate):
    triple = st.tuples(coordinate, coordinate, coordinate)

    @settings(max_examples=60, deadline=None)
    @given(st.lists(st.tuples(triple, triple, triple), min_size=1, max_size=9), st.lists(triple, max_size=4))
    def check(triangles, points):
        surface = soup(torch.tensor(triangles, dtype=DOUBLE))
        queries = torch.tensor(points, dtype=DOUBLE).reshape(-1, 3)
        found = surface.closest(queries)
        for row, point in enumerate(points):
            squared = [exact_squared_distance(point, t) for t in triangles]
            assert found.distances[row].item() == pytest.approx(math.sqrt(min(squared)), rel=1e-14, abs=1e-14)
            face = found.faces[row].item()
            assert math.sqrt(squared[face]) == pytest.approx(math.sqrt(min(squared)), rel=1e-14, abs=1e-14)
        assert not any(x.isnan().any() for x in found)

    check()


@pytest.mark.parametrize("thinness", [1e-3, 1e-6, 1e-9, 1e-12, 1e-14, 1e-15])
def test_distances_to_needles_are_right_to_rounding(thinness):
    generator = np.random.default_rng(5)
    frames = np.stack([random_rotation(seed).numpy() for seed in range(20)])
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [0.45, thinness, 0]])
    needles = flat @ frames.transpose(0, 2, 1) + generator.normal(size=(20, 1, 3))
    inside = np.einsum("k,nkd->nd", [0.3, 0.3, 0.4], needles)
    across = thinness * generator.normal(size=(20, 1)) * frames[:, :, 1]
    for height in (0.0, thinness, 1e-5, 1.0):
        points = inside + height * frames[:, :, 2] + across
        for needle, point in zip(needles, points, strict=True):
            distance = soup(torch.from_numpy(needle[None])).closest(torch.from_numpy(point[None])).distances.item()
            exact = math.sqrt(exact_squared_distance(point.tolist(), needle.tolist()))
            assert distance == pytest.approx(exact, rel=8 * EPS, abs=8 * EPS)


@pytest.mark.parametrize("offset", [0.0, 0.05, 0.7, 30.0])
@pytest.mark.parametrize("seed", range(3))
def test_the_search_finds_what_measuring_every_piece_finds_bit_for_bit(offset, seed):
    vertices, topology = wavy_grid(13, 11, seed=seed)
    surface = ReferenceSurface(vertices, topology)
    generator = torch.Generator().manual_seed(seed)
    points = vertices.repeat(2, 1)
    points = points + offset * torch.randn(points.shape, dtype=DOUBLE, generator=generator)
    found = surface.closest(points)
    distances, pieces = measure_every_piece(surface, points)
    assert torch.equal(found.distances, distances)
    assert torch.equal(found.pieces, pieces)


def test_triangles_of_very_different_sizes_and_far_points():
    generator = np.random.default_rng(1)
    sizes = 10.0 ** generator.uniform(-4, 2, size=(300, 1, 1))
    triangles = torch.from_numpy(generator.normal(size=(300, 1, 3)) + sizes * generator.normal(size=(300, 3, 3)))
    surface = soup(triangles)
    points = torch.from_numpy(generator.normal(size=(200, 3)) * 10.0 ** generator.uniform(-3, 6, size=(200, 1)))
    distances, pieces = measure_every_piece(surface, points)
    found = surface.closest(points)
    assert torch.equal(found.distances, distances)
    assert torch.equal(found.pieces, pieces)


def test_equally_far_from_everything(monkeypatch):
    """At the centre of the icosahedron all faces are candidates; also when pairs have to be taken in small parts."""
    vertices, topology = icosphere(0)
    surface = ReferenceSurface(vertices, topology)
    points = 1e-9 * torch.randn(50, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    points[0] = 0
    found = surface.closest(points)
    distances, pieces = measure_every_piece(surface, points)
    assert torch.equal(found.distances, distances)
    assert torch.equal(found.pieces, pieces)
    for module in (_closest_search, _closest_tracker):
        monkeypatch.setattr(module, "PAIRS", 7)
    assert same(surface.closest(points), found)
    tracker = surface.tracker()
    assert same(tracker.closest(points), found)
    assert same(tracker.closest(points), found)


# ---- points on the surface -------------------------------------------------------------------------------


@pytest.mark.parametrize("mesh", [ridge, cube, tetrahedron, lambda: wavy_grid(7, 9)])
def test_vertices_edges_and_pieces_are_on_the_surface(mesh):
    vertices, topology = mesh()
    vertices = vertices @ random_rotation(3).T
    surface = ReferenceSurface(vertices, topology)
    used = topology.corners.unique()
    found = surface.closest(vertices[used])
    assert torch.equal(found.distances, torch.zeros(used.shape[0], dtype=DOUBLE))
    assert torch.equal(found.positions, vertices[used])
    weights = torch.rand(200, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    weights[:50, 0] = 0
    weights = weights / weights.sum(1, keepdim=True)
    pieces = torch.arange(200) % surface.pieces.shape[0]
    points = (weights[:, :, None] * surface.points[surface.pieces[pieces]]).sum(1)
    assert surface.closest(points).distances.max() < 1e-13


def test_corners_of_any_triangle_are_on_it_to_the_last_bit():
    triangles = torch.randn(500, 3, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    corners = triangles.reshape(-1, 3)
    found = soup(triangles).closest(corners)
    assert torch.equal(found.distances, torch.zeros(1500, dtype=DOUBLE))
    assert torch.equal(found.positions, corners)


def test_isolated_vertices_are_not_on_the_surface():
    vertices, topology = ridge()
    assert ReferenceSurface(vertices, topology).closest(vertices[-1:]).distances.item() > 5


def test_weights_rebuild_the_position_and_faces_own_the_pieces():
    vertices, topology = ridge()
    surface = ReferenceSurface(vertices, topology)
    points = 3 * torch.randn(300, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(1)) + 1
    found = surface.closest(points)
    assert (found.weights >= 0).all()
    torch.testing.assert_close(found.weights.sum(1), torch.ones(300, dtype=DOUBLE), rtol=0, atol=4 * EPS)
    rebuilt = (found.weights[:, :, None] * surface.points[surface.pieces[found.pieces]]).sum(1)
    torch.testing.assert_close(rebuilt, found.positions, rtol=0, atol=1e-14)
    torch.testing.assert_close((points - found.positions).norm(dim=1), found.distances, rtol=1e-14, atol=1e-14)
    assert torch.equal(found.faces, surface.piece_faces[found.pieces])
    assert torch.equal(surface.piece_faces.unique_consecutive(), torch.arange(3))
    # Five pieces of the pentagon, four of the quad, the triangle itself.
    assert surface.piece_faces.bincount().tolist() == [5, 4, 1]


def test_distance_of_the_sphere_from_an_inscribed_icosahedron():
    """Largest above the centres of the faces: 1 - inradius; zero at the vertices."""
    vertices, topology = icosphere(0)
    surface = ReferenceSurface(vertices, topology)
    inradius = math.sqrt((5 + 2 * math.sqrt(5)) / 15)
    points = torch.randn(2000, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    points = torch.cat([points, vertices[topology.triangles].mean(1)])
    points = points / points.norm(dim=1, keepdim=True)
    found = surface.closest(points)
    assert found.distances.max().item() == pytest.approx(1 - inradius, rel=1e-14)
    assert torch.equal(found.faces[-20:], torch.arange(20))
    torch.testing.assert_close(found.distances[-20:], torch.full((20,), 1 - inradius, dtype=DOUBLE), rtol=1e-13, atol=0)


# ---- invariances -----------------------------------------------------------------------------------------


def test_rigid_motions_and_scaling():
    vertices, topology = ridge()
    points = 3 * torch.randn(100, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(2))
    found = ReferenceSurface(vertices, topology).closest(points)
    turn, shift = random_rotation(4), torch.tensor([3.0, -2, 7], dtype=DOUBLE)
    moved = ReferenceSurface(vertices @ turn.T + shift, topology).closest(points @ turn.T + shift)
    torch.testing.assert_close(moved.distances, found.distances, rtol=1e-13, atol=1e-13)
    torch.testing.assert_close(moved.positions, found.positions @ turn.T + shift, rtol=1e-12, atol=1e-12)
    torch.testing.assert_close(moved.smooth_normals, found.smooth_normals @ turn.T, rtol=1e-11, atol=1e-11)
    for power in (-100, 60):
        scaled = ReferenceSurface(vertices * 2.0**power, topology).closest(points * 2.0**power)
        assert torch.equal(scaled.distances, found.distances * 2.0**power)
        assert torch.equal(scaled.pieces, found.pieces)
        torch.testing.assert_close(scaled.normals, found.normals, rtol=0, atol=4 * EPS)


def test_far_from_the_origin_no_digit_is_lost():
    """Coordinates of 25 binary digits are exact before and after the shift, and so are all differences."""
    generator = torch.Generator().manual_seed(0)
    points, corners = (torch.randint(2**25, (n, 3), generator=generator).double() * 2.0**-30 for n in (300, 120))
    near, far = (soup((corners + s).reshape(-1, 3, 3)).closest(points + s) for s in (0.0, 2.0**20))
    assert torch.equal(near.distances, far.distances)
    assert torch.equal(near.pieces, far.pieces)


def test_the_order_of_faces_does_not_change_distances():
    vertices, topology = wavy_grid(6, 7, triangles=True)
    points = vertices + 0.2 * torch.randn(vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(2))
    order = torch.randperm(topology.num_faces, generator=torch.Generator().manual_seed(3))
    shuffled = Topology.from_faces(topology.triangles[order])
    a = ReferenceSurface(vertices, topology).closest(points)
    b = ReferenceSurface(vertices, shuffled).closest(points)
    assert torch.equal(a.distances, b.distances)


# ---- edges of the domain ---------------------------------------------------------------------------------


def test_no_points_and_single_precision():
    vertices, topology = cube()
    surface = ReferenceSurface(vertices.float(), topology)
    for closest in (surface.closest, surface.tracker().closest):
        none = closest(torch.zeros(0, 3))
        assert none.positions.shape == none.weights.shape == (0, 3)
        assert none.distances.shape == none.faces.shape == (0,)
    points = torch.tensor([[2.0, 0.25, 0.5]], requires_grad=True)
    found = surface.closest(points)
    assert {x.dtype for x in found} == {torch.float32, torch.int64}
    assert found.distances.tolist() == [1.0]
    assert not any(x.requires_grad for x in found)


def test_input_that_cannot_be_measured_is_refused():
    vertices, topology = cube()
    surface = ReferenceSurface(vertices, topology)
    points = torch.zeros(4, 3, dtype=DOUBLE)
    points[2, 1] = math.nan
    with pytest.raises(MeshError, match=r"points: 1 point\(s\) are not finite.*row 2.*Remove"):
        surface.closest(points)
    with pytest.raises(MeshError, match="row 2"):
        surface.tracker().closest(points)
    with pytest.raises(MeshError, match="beyond"):
        surface.closest(torch.full((1, 3), 1e80, dtype=DOUBLE))
    with pytest.raises(ShapeError, match="points"):
        surface.closest(torch.zeros(4, 2))
    with pytest.raises(ShapeError, match="points"):
        surface.closest(torch.zeros(4, 3, dtype=torch.int64))
    with pytest.raises(ShapeError, match="points"):
        surface.closest([[0.0, 0, 0]])
    with pytest.raises(ShapeError, match="vertices"):
        ReferenceSurface(vertices[None], topology)
    with pytest.raises(ShapeError, match="vertices"):
        ReferenceSurface(vertices[1:], topology)
    with pytest.raises(MeshError, match=r"vertices.*row 0"):
        ReferenceSurface(vertices / 0, topology)
    with pytest.raises(MeshError, match="no faces"):
        ReferenceSurface(torch.zeros(3, 3), Topology.from_faces(np.zeros((0, 3), int), 3))


def test_the_surface_keeps_its_own_copy():
    vertices, topology = cube()
    surface = ReferenceSurface(vertices, topology)
    vertices += 5
    assert surface.closest(torch.full((1, 3), 0.5, dtype=DOUBLE)).distances.item() == 0.5


def test_large_meshes_are_searched_in_blocks():
    """More points than one block, on a grid in the plane: the distance is the height."""
    faces = grid_faces(40, 40)
    x, y = np.meshgrid(np.arange(40.0), np.arange(40.0), indexing="ij")
    vertices = torch.from_numpy(np.stack([x.ravel(), y.ravel(), np.zeros(1600)], axis=1))
    surface = ReferenceSurface(vertices, Topology.from_faces(faces))
    points = torch.rand(5000, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(0)) * 39
    found = surface.closest(points)
    assert torch.equal(found.distances, points[:, 2])
    assert torch.equal(found.faces, points[:, 0].long() * 39 + points[:, 1].long())
