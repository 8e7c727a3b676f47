"""Polar duals: platonic pairs, an involution, planar faces, and the theorem about pyramids."""

from __future__ import annotations

import pytest
import torch
from geometry_meshes import icosphere, random_polytope
from helpers import DOUBLE, cube, wavy_grid

from torchfair import MeshError, ShapeError, Topology
from torchfair.geometry import edge_lengths, face_areas, planarity
from torchfair.shapes import Paraboloid, PrincipalParaboloid, irregular_triangles, principal_triangles
from torchfair.stars import StarKind, classify_stars, polar_dual, pyramid_self_intersections

BELOW = torch.tensor([0.0, 0, -5], dtype=DOUBLE)


def test_platonic_pairs() -> None:
    vertices, topology = cube()
    octahedron = polar_dual(vertices, topology, torch.full((3,), 0.5, dtype=DOUBLE))
    assert octahedron.topology.is_triangular
    assert octahedron.topology.num_faces == 8
    expected = torch.cat([torch.eye(3), -torch.eye(3)]).to(DOUBLE) * 2 + 0.5  # planes at distance 1/2
    assert torch.cdist(octahedron.vertices, expected).amin(1).max() < 1e-12
    dodecahedron = polar_dual(*icosphere(0))
    assert dodecahedron.topology.face_sizes.unique().tolist() == [5]
    lengths = edge_lengths(dodecahedron.vertices, dodecahedron.topology)
    torch.testing.assert_close(lengths, lengths[:1].expand_as(lengths))
    assert dodecahedron.one_sided.all()


@pytest.mark.parametrize("centre", [None, torch.tensor([0.1, -0.05, 0.02], dtype=DOUBLE)])
def test_the_dual_of_the_dual_is_the_mesh(centre: torch.Tensor | None) -> None:
    for vertices, topology in (icosphere(2), random_polytope(1)):
        dual = polar_dual(vertices, topology, centre)
        assert planarity(dual.vertices, dual.topology).max() < 1e-9
        back = polar_dual(dual.vertices, dual.topology, centre)
        torch.testing.assert_close(back.vertices, vertices[dual.mesh_vertices], rtol=1e-9, atol=1e-9)
        faces = {frozenset(dual.mesh_vertices[face].tolist()) for face in back.topology.face_lists()}
        assert faces == {frozenset(face) for face in topology.face_lists()}


def test_planes_of_faces_are_polar_to_vertices() -> None:
    mesh = irregular_triangles(Paraboloid(), 150)
    dual = polar_dual(mesh.vertices, mesh.topology, BELOW)
    assert dual.one_sided.all()
    assert polar_dual(mesh.vertices, mesh.topology, -BELOW).one_sided.all()
    between = polar_dual(mesh.vertices, mesh.topology, torch.tensor([0.31, 0.17, 0.02], dtype=DOUBLE)).one_sided
    assert between.any()
    assert not between.all()
    inner = ~mesh.topology.is_boundary_vertex
    assert sorted(dual.mesh_vertices.tolist()) == torch.nonzero(inner).squeeze(1).tolist()
    for face, vertex in zip(dual.topology.face_lists(), dual.mesh_vertices.tolist(), strict=True):
        products = (dual.vertices[face] - BELOW) @ (mesh.vertices[vertex] - BELOW)
        torch.testing.assert_close(products, torch.ones_like(products))
        assert len(face) == mesh.topology.valences[vertex]


def crosses_itself(corners: torch.Tensor) -> bool:
    """Whether a planar polygon does: two sides without a common corner that cross, by areas in its plane."""
    centred = corners - corners.mean(0)
    frame = torch.linalg.svd(centred).Vh[:2]
    points = (centred @ frame.T).tolist()
    count = len(points)

    def left(a: int, b: int, c: int) -> bool:
        (ax, ay), (bx, by), (cx, cy) = points[a], points[b], points[c]
        return (bx - ax) * (cy - ay) - (by - ay) * (cx - ax) > 0

    sides = [(i, (i + 1) % count) for i in range(count)]
    return any(
        left(*first, second[0]) != left(*first, second[1]) and left(*second, first[0]) != left(*second, first[1])
        for i, first in enumerate(sides)
        for second in sides[i + 1 :]
        if not set(first) & set(second)
    )


def test_one_sided_faces_cross_themselves_exactly_where_pyramids_do() -> None:
    found = {True: 0, False: 0}
    for b in (-0.5, -0.1):
        mesh = irregular_triangles(Paraboloid(1.0, b), 250)
        dual = polar_dual(mesh.vertices, mesh.topology, BELOW)
        crossings = pyramid_self_intersections(mesh.vertices, mesh.topology)[dual.mesh_vertices] > 0
        good = classify_stars(mesh.vertices, mesh.topology).good[dual.mesh_vertices]
        for face, crossed, is_good in zip(dual.topology.face_lists(), crossings.tolist(), good.tolist(), strict=True):
            assert crosses_itself(dual.vertices[face]) == crossed
            assert not (crossed and is_good)  # Prop. 1, in the dual
            found[crossed] += 1
    assert min(found.values()) > 20


def test_good_saddles_have_simple_hexagons_that_go_round_the_other_way() -> None:
    mesh = principal_triangles(PrincipalParaboloid(1.0, -1.0), 8, 10)
    dual = polar_dual(mesh.vertices, mesh.topology, BELOW)
    classes = classify_stars(mesh.vertices, mesh.topology)
    assert classes.good[dual.mesh_vertices].all()
    assert classes.is_kind(StarKind.SADDLE)[dual.mesh_vertices].all()
    assert dual.topology.face_sizes[dual.topology.face_sizes > 0].unique().tolist() == [6]
    assert not any(crosses_itself(dual.vertices[face]) for face in dual.topology.face_lists())
    assert face_areas(dual.vertices, dual.topology).min() > 0


def test_unused_faces_may_lie_anywhere() -> None:
    """Only the four faces around the inner vertex count."""
    vertices, topology = wavy_grid(3, 3)
    assert polar_dual(vertices, topology, BELOW).topology.num_faces == 1
    more = Topology.from_faces([*topology.face_lists(), [9, 10, 11]], 12)
    line = torch.tensor([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]], dtype=DOUBLE)
    dual = polar_dual(torch.cat([vertices, line]), more, BELOW)
    assert dual.vertices.isfinite().all()
    assert dual.topology.valences[4] == 0


def test_refusals() -> None:
    vertices, topology = cube()
    with pytest.raises(MeshError, match=r"planes of 3 face\(s\) pass through the centre.*faces \[0, 2, 4\].*another"):
        polar_dual(vertices, topology)
    with pytest.raises(MeshError, match="no inner vertex"):
        polar_dual(torch.eye(3, dtype=DOUBLE), Topology.from_faces([[0, 1, 2]]))
    for centre in (torch.zeros(2), torch.tensor([0.0, 0, float("nan")])):
        with pytest.raises(ShapeError, match="centre"):
            polar_dual(vertices, topology, centre)
    with pytest.raises(ShapeError, match="not a batch"):
        polar_dual(vertices[None], topology)
