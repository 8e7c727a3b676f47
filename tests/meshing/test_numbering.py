"""The order of vertices and faces decides nothing."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
import torch
from creased_shapes import box
from helpers import grid_faces, random_rotation
from hypothesis import given, settings
from hypothesis import strategies as st
from meshing_tools import Mesh, ellipsoid, irregular, punched, shuffled, side_by_side

from torchfair import Topology
from torchfair.meshing import principal_quads, principal_triangles
from torchfair.meshing.numbering import numbered_by_geometry, triangles_by_geometry
from torchfair.meshing.surface import components_of
from torchfair.shapes import FreeFormPatch, PrincipalParaboloid, Torus, builtin_mesh, icosphere
from torchfair.shapes import principal_quads as analytic_quads
from torchfair.triangulation import triangulate

SADDLE = PrincipalParaboloid(1.0, -0.5, (0.8, 0.8))


def sphere() -> Mesh:
    ball = icosphere(2)
    return ball.vertices, ball.topology


SHAPES: dict[str, Callable[[], Mesh]] = {
    "saddle": lambda: irregular(SADDLE, 120),
    "torus": lambda: irregular(Torus(), 600),
    "sphere": sphere,
    "ellipsoid": lambda: ellipsoid(2),
    "cube": lambda: box(2),
    "box": lambda: box(4, (1.0, 0.8, 0.6)),
}


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6))
@pytest.mark.parametrize("name", SHAPES)
def test_the_order_is_the_same_for_all_numberings(name: str, seed: int) -> None:
    vertices, topology = SHAPES[name]()
    order, triangles = numbered_by_geometry(vertices, topology.triangles)
    assert order.sort().values.tolist() == list(range(len(vertices)))
    given_ones = {tuple(sorted(map(tuple, vertices[face].tolist()))) for face in topology.triangles}
    assert {tuple(sorted(map(tuple, vertices[order][face].tolist()))) for face in triangles} == given_ones
    again, other = shuffled(vertices, topology, seed)
    renumbered, as_before = numbered_by_geometry(again, other.triangles)
    assert torch.equal(again[renumbered], vertices[order])
    assert torch.equal(as_before, triangles)


@pytest.mark.parametrize("name", ["saddle", "ellipsoid", "torus"])
def test_without_symmetries_it_is_that_of_all_motions_and_scales(name: str) -> None:
    vertices, topology = SHAPES[name]()
    if name == "torus":  # its symmetries are broken by the triangles alone
        vertices, topology = irregular(Torus(), 600, seed=3)
    order, triangles = numbered_by_geometry(vertices, topology.triangles)
    again, other = shuffled(vertices, topology, 5)
    moved = 7 * again @ random_rotation(3).T + torch.tensor([3.0, -1.0, 20.0])
    renumbered, as_before = numbered_by_geometry(moved, other.triangles)
    if name == "ellipsoid":  # half a turn brings it to itself, with its triangles
        assert torch.equal(as_before, triangles)
    else:
        assert torch.equal(again[renumbered], vertices[order])


@pytest.mark.parametrize("seed", range(3))
def test_polygons_are_cut_alike(seed: int) -> None:
    """Both diagonals of a parallelogram leave triangles of the same area: the first corner decided, or rounding."""
    quads = analytic_quads(Torus(), 12, 8)
    for vertices, topology in ((quads.vertices, quads.topology), builtin_mesh("hybrid_roof")):
        (found,), (again,) = (components_of(*of) for of in ((vertices, topology), shuffled(vertices, topology, seed)))
        assert torch.equal(found.vertices, again.vertices)
        assert torch.equal(found.topology.triangles, again.topology.triangles)
    (moved,) = components_of(3 * vertices @ random_rotation(seed).T - 5, topology)
    assert torch.equal(moved.topology.triangles, found.topology.triangles)
    assert torch.equal(moved.numbers, found.numbers)


def test_quads_are_cut_so_that_the_smaller_triangle_is_as_large_as_it_can_be() -> None:
    points = torch.tensor([[0.0, 0, 0], [2, 0, 0], [2, 2, 0], [1.5, 0.5, 0], [0, 1, 0], [1, 3, 0]], dtype=torch.float64)
    for corners, diagonal in (([0, 1, 2, 3], {1, 3}), ([0, 1, 5, 4], {1, 4})):
        for shift in range(4):
            numbers = torch.tensor(corners[shift:] + corners[:shift])
            topology = Topology.from_faces([[0, 1, 2, 3]])
            cut = triangles_by_geometry(points[numbers], topology)
            shared = set(numbers[cut[0]].tolist()) & set(numbers[cut[1]].tolist())
            assert shared == diagonal
            same = triangulate(points[numbers], topology).triangles
            assert {frozenset(of) for of in cut.tolist()} == {frozenset(of) for of in same.tolist()}


def cuts(points: list[list[float]], faces: list[list[int]]) -> set[frozenset[frozenset[int]]]:
    """All ways in which faces are cut, wherever the first of them starts."""
    vertices = torch.tensor([[x, y, 0.0] for x, y in points], dtype=torch.float64)
    found = set()
    for shift in range(len(faces[0])):
        turned = [faces[0][shift:] + faces[0][:shift], *faces[1:]]
        cut = triangles_by_geometry(vertices, Topology.from_faces(turned, len(vertices)))
        found.add(frozenset(frozenset(of) for of in cut.tolist()))
    return found


def test_parallelograms_are_cut_along_the_shorter_diagonal() -> None:
    (cut,) = cuts([[0, 0], [2, 0], [3, 1], [1, 1]], [[0, 1, 2, 3]])
    assert cut == {frozenset({0, 1, 3}), frozenset({1, 2, 3})}


def test_rectangles_are_cut_from_the_corner_that_is_farthest_from_the_middle_of_the_mesh() -> None:
    """Sizes, diagonals and largest coordinates are the same either way."""
    (cut,) = cuts([[0, 0], [1, 0], [1, 1], [0, 1], [-3, -0.5]], [[0, 1, 2, 3], [0, 3, 4]])
    assert cut == {frozenset({0, 1, 2}), frozenset({0, 2, 3}), frozenset({0, 3, 4})}


@pytest.mark.parametrize("size", [1e-3, 1.0, 1e3])
@pytest.mark.parametrize("before", [False, True])
def test_what_else_is_in_a_mesh_decides_nothing(before: bool, size: float) -> None:
    """Rectangles of squares are cut by ties, wherever the other component lies; components stay in order."""
    x, y = torch.meshgrid(*(torch.arange(5, dtype=torch.float64),) * 2, indexing="ij")
    plane = torch.stack([x, y, 0 * x], -1).reshape(-1, 3), Topology.from_faces(grid_faces(5, 5))
    (alone,) = components_of(*plane)
    patch = irregular(SADDLE, 60)
    other = size * patch[0] + torch.tensor([9.0, -70.0, 4.0], dtype=torch.float64), patch[1]
    first, second = (other, plane) if before else (plane, other)
    offset = len(first[0])
    faces = [*first[1].corners.view(first[1].num_faces, -1).tolist()]
    faces += (second[1].corners.view(second[1].num_faces, -1) + offset).tolist()
    unused = torch.full((1, 3), 1e5, dtype=torch.float64)
    vertices = torch.cat([first[0], second[0], unused])
    part = components_of(vertices, Topology.from_faces(faces, len(vertices)))[int(before)]
    assert torch.equal(part.vertices, alone.vertices)
    assert torch.equal(part.topology.triangles, alone.topology.triangles)


@pytest.mark.parametrize("size", [5, 6, 8])
def test_regular_polygons_are_cut_alike_wherever_they_start(size: int) -> None:
    angles = [2 * math.pi * k / size + 0.1 for k in range(size)]
    assert len(cuts([[math.cos(angle), math.sin(angle)] for angle in angles], [list(range(size))])) == 1


def test_components_keep_the_numbers_that_were_given() -> None:
    vertices, topology = punched(*side_by_side(irregular(SADDLE, 120), ellipsoid(2)), 40)
    for part in components_of(vertices, topology):
        assert torch.equal(part.vertices, vertices[part.numbers])


@pytest.mark.parametrize("seed", range(2))
def test_quads_are_the_same_to_the_last_bit(seed: int) -> None:
    """The hybrid roof had 92, 105, 93, 94 or 91 panels, as it was numbered."""
    vertices, topology = builtin_mesh("hybrid_roof")
    found = principal_quads(vertices, topology, count=100)
    again = principal_quads(*shuffled(vertices, topology, seed), count=100)
    assert torch.equal(again.vertices, found.vertices)
    assert torch.equal(again.topology.edges, found.topology.edges)
    assert torch.equal(again.singular_points, found.singular_points)
    assert again.notes == found.notes


def test_triangles_are_the_same_to_the_last_bit() -> None:
    vertices, topology = irregular(FreeFormPatch(), 700)
    found = principal_triangles(vertices, topology, count=300)
    again = principal_triangles(*shuffled(vertices, topology, 1), count=300)
    assert torch.equal(again.vertices, found.vertices)
    assert torch.equal(again.principal.mask, found.principal.mask)
