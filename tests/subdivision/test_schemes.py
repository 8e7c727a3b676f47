"""Theorems that hold for every scheme, and closed forms."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import torch
from geometry_meshes import capped_prism, icosphere, mixed_grid, torus, with_isolated
from helpers import DOUBLE, cube, split_quads, tetrahedron, wavy_grid
from subdivision_reference import lattice, lattice_corners

from torchfair import MeshError, ShapeError, Topology, TorchfairError
from torchfair.geometry import angle_defects
from torchfair.subdivision import catmull_clark, hybrid, loop, midpoint, refine

SCHEMES = {"loop": loop, "catmull_clark": catmull_clark, "hybrid": hybrid, "midpoint": midpoint}
MESHES = {
    "closed triangles": tetrahedron,
    "open triangles": lambda: wavy_grid(5, 4, triangles=True),
    "closed quads": torus,
    "closed polygons": lambda: capped_prism(5),
    "open polygons and an isolated vertex": lambda: with_isolated(mixed_grid()),
}
CASES = [
    pytest.param(scheme, mesh, id=f"{scheme.__name__}, {name}")
    for scheme in SCHEMES.values()
    for name, mesh in MESHES.items()
    if scheme is not loop or "triangles" in name
]
each_case = pytest.mark.parametrize(("scheme", "mesh"), CASES)
each_boundary = pytest.mark.parametrize("boundary", ["curve", "interpolate", "polyline"])


# ---- every scheme ----------------------------------------------------------------------------------------


@each_case
def test_rows_sum_to_one_and_hold_no_zeros(scheme, mesh) -> None:
    matrix = scheme(mesh()[1]).matrix
    np.testing.assert_allclose(matrix.sum(axis=1), 1, rtol=0, atol=1e-15)
    assert (matrix.data != 0).all()


@each_case
def test_weights_are_positive(scheme, mesh) -> None:
    """So fine vertices lie in the convex hull of the coarse ones."""
    assert scheme(mesh()[1]).matrix.min() >= 0


@each_case
def test_commutes_with_affine_maps(scheme, mesh) -> None:
    vertices, topology = mesh()
    matrix = torch.from_numpy(np.random.default_rng(0).normal(size=(3, 3)))
    fine = scheme(topology)
    torch.testing.assert_close(fine.apply(vertices @ matrix + 2), fine.apply(vertices) @ matrix + 2)


@each_case
def test_planar_stays_planar(scheme, mesh) -> None:
    vertices, topology = mesh()
    vertices[:, 2] = vertices[:, 0] - 3 * vertices[:, 1] + 1
    x, y, z = scheme(topology).apply(vertices).unbind(-1)
    torch.testing.assert_close(z, x - 3 * y + 1)


@each_case
def test_counts_and_euler_characteristic(scheme, mesh) -> None:
    coarse = mesh()[1]
    fine = scheme(coarse).topology
    centred = {loop: 0, catmull_clark: coarse.num_faces}.get(scheme, int((coarse.face_sizes > 3).sum()))
    quarters = coarse.num_faces - centred
    assert fine.num_vertices == coarse.num_vertices + coarse.num_edges + centred
    assert fine.num_faces == coarse.corners.numel() + quarters
    assert characteristic(fine) == characteristic(coarse)
    assert [len(loop) for loop in fine.boundary_loops()] == [2 * len(loop) for loop in coarse.boundary_loops()]
    assert int((fine.face_sizes == 4).sum()) == coarse.corners.numel() - 3 * quarters


def characteristic(topology: Topology) -> int:
    return topology.num_vertices - topology.num_edges + topology.num_faces


@each_case
def test_boundary_loops_keep_their_order_and_old_vertices(scheme, mesh) -> None:
    coarse = mesh()[1]
    fine = scheme(coarse)
    for old, new in zip(coarse.boundary_loops(), fine.topology.boundary_loops(), strict=True):
        assert torch.equal(new[::2], old)
        edges = coarse.edges[new[1::2] - coarse.num_vertices]
        assert torch.equal(edges, torch.stack([old, old.roll(-1)], dim=1))


@each_case
def test_orientation_is_kept(scheme, mesh) -> None:
    coarse = mesh()[1]
    turned = Topology.from_faces([face[::-1] for face in coarse.face_lists()], coarse.num_vertices)
    one, other = scheme(coarse), scheme(turned)
    # Interior edges are numbered alike; boundary edges are sorted by another end, so compare positions.
    vertices = mesh()[0]
    faces = [one.apply(vertices)[face] for face in one.topology.face_lists()]
    reversed_faces = [other.apply(vertices)[face] for face in other.topology.face_lists()]
    key = lambda face: sorted(tuple(round(x, 9) for x in row) for row in face.tolist())  # noqa: E731
    for face, back in zip(sorted(faces, key=key), sorted(reversed_faces, key=key), strict=True):
        start = int((back - face[0]).norm(dim=1).argmin())
        torch.testing.assert_close(back.roll(-start - 1, 0).flip(0), face)


def test_isolated_vertices_stay() -> None:
    vertices, topology = with_isolated(mixed_grid())
    for scheme in (catmull_clark, hybrid, midpoint):
        fine = scheme(topology)
        last = topology.num_vertices - 1
        assert torch.equal(fine.apply(vertices)[last], vertices[last])
        assert fine.topology.valences[last] == 0


def test_meshes_without_faces() -> None:
    empty = Topology.from_faces([], num_vertices=2)
    vertices = torch.rand(2, 3)
    for scheme in SCHEMES.values():
        fine = scheme(empty)
        assert fine.topology.num_vertices == 2
        assert torch.equal(fine.apply(vertices), vertices)
        assert fine.then(scheme(fine.topology)).edge_parallels.shape == (0, 2)


# ---- closed forms ----------------------------------------------------------------------------------------


def test_catmull_clark_of_the_cube_by_hand() -> None:
    vertices, topology = cube()
    vertices = 2 * vertices - 1  # from -1 to 1
    fine = catmull_clark(topology).apply(vertices)
    torch.testing.assert_close(fine[:8], vertices * 5 / 9)
    middles = vertices[topology.edges].mean(1)  # one coordinate is 0, the others are -1 or 1
    torch.testing.assert_close(fine[8:20], middles * 3 / 4)
    centres = torch.stack([vertices[face].mean(0) for face in topology.face_lists()])
    torch.testing.assert_close(fine[20:], centres)


def test_loop_of_the_tetrahedron_by_hand() -> None:
    vertices, topology = tetrahedron()
    middles = vertices[topology.edges].mean(1)
    for weights in ("loop", "warren"):  # both 3/16
        fine = loop(topology, weights=weights).apply(vertices)
        torch.testing.assert_close(fine[:4], vertices / 4)  # 7/16 of v, 3/16 of neighbours, whose sum is -v
        torch.testing.assert_close(fine[4:], middles / 2)  # 3/4 of the middle, 1/4 of the opposite one, its negative


@pytest.mark.parametrize("valence", [3, 4, 5, 6, 7, 12])
def test_weights_of_loop_and_warren(valence: int) -> None:
    """The tip of a pyramid of height 1 over a regular polygon around the origin keeps 1 - n b of its height."""
    rim = [[v, v % valence + 1, 0] for v in range(1, valence + 1)]
    turns = torch.arange(valence, dtype=DOUBLE) * 2 * math.pi / valence
    rows = torch.stack([turns.cos(), turns.sin(), torch.zeros_like(turns)], dim=1)
    vertices = torch.cat([torch.tensor([[0.0, 0, 1]], dtype=DOUBLE), rows])
    of_loop = 3 / 8 + (3 / 8 + math.cos(2 * math.pi / valence) / 4) ** 2
    of_warren = 7 / 16 if valence == 3 else 5 / 8
    for weights, height in (("loop", of_loop), ("warren", of_warren)):
        tip = loop(Topology.from_faces(rim), weights=weights).apply(vertices)[0]
        torch.testing.assert_close(tip, torch.tensor([0, 0, height], dtype=DOUBLE))


@each_boundary
@pytest.mark.parametrize("triangles", [True, False])
def test_linear_functions_on_regular_lattices_are_reproduced(triangles: bool, boundary: str) -> None:
    vertices, topology = lattice(6, 5, triangles=triangles)
    fine = hybrid(topology, boundary=boundary, corners=lattice_corners(topology, 5))
    torch.testing.assert_close(fine.apply(vertices), midpoint(topology).apply(vertices))


def test_linear_functions_are_reproduced_where_squares_meet_triangles_of_the_same_height() -> None:
    kinds, columns = "qqttqtq", 7
    points, faces, shift = [], [], 0.0
    for row in range(len(kinds) + 1):
        points += [[i + shift, row, 0.0] for i in range(columns)]
        shift += 0.5 * (row < len(kinds) and kinds[row] == "t")
    for row, kind in enumerate(kinds):
        for a in range(row * columns, (row + 1) * columns - 1):
            quad = [a, a + 1, a + 1 + columns, a + columns]
            faces += [quad] if kind == "q" else [quad[:2] + quad[3:], quad[1:]]
    topology, vertices = Topology.from_faces(faces), torch.tensor(points, dtype=DOUBLE)
    fine = hybrid(topology, boundary="polyline")
    torch.testing.assert_close(fine.apply(vertices), midpoint(topology).apply(vertices))


@pytest.mark.parametrize("triangles", [True, False])
def test_second_differences_of_quadratic_data_quarter(triangles: bool) -> None:
    """Box splines: the fine data of a quadratic polynomial are its values and a constant."""
    vertices, topology = lattice(12, 12, triangles=triangles)
    x, y, _ = vertices.unbind(-1)
    step = hybrid(topology)
    fine = step.apply((x**2 - 0.7 * x * y + 0.4 * y**2 + 3 * x)[:, None])[:, 0]
    u, v, _ = midpoint(topology).apply(vertices).unbind(-1)
    moved = (fine - (u**2 - 0.7 * u * v + 0.4 * v**2 + 3 * u))[~step.topology.is_boundary_vertex]
    torch.testing.assert_close(moved, moved[:1].expand_as(moved))  # the same constant everywhere


# ---- limits ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", ["loop", "catmull_clark", "hybrid"])
@pytest.mark.parametrize("mesh", [tetrahedron, cube])
def test_limits_are_smooth(scheme: str, mesh) -> None:
    """Largest angle defects shrink from level to level; midpoints leave them as they are."""
    vertices, topology = mesh()
    if scheme == "loop" and not topology.is_triangular:
        topology = Topology.from_faces(split_quads(np.array(topology.face_lists())))
    largest = []
    for levels in range(2, 6):
        fine = refine(topology, scheme, levels)
        largest.append(float(angle_defects(fine.apply(vertices), fine.topology).abs().max()))
    assert all(after < 0.75 * before for before, after in itertools.pairwise(largest))
    flat = refine(topology, "midpoint", 3)
    corners = angle_defects(flat.apply(vertices), flat.topology)[: topology.num_vertices]
    torch.testing.assert_close(corners, angle_defects(vertices, topology))


def test_the_icosahedron_tends_to_nearly_a_sphere() -> None:
    vertices, topology = icosphere(0)
    radii = refine(topology, "loop", 4).apply(vertices).norm(dim=-1)
    solid = math.sqrt((5 + 2 * math.sqrt(5)) / 15)  # inner over outer radius of the icosahedron: 0.79
    assert 1 - float(radii.min() / radii.max()) < (1 - solid) / 10


# ---- errors ----------------------------------------------------------------------------------------------


def test_errors_name_cause_and_remedy() -> None:
    quads = cube()[1]
    with pytest.raises(MeshError, match=r"6 face\(s\) have more corners: faces 0, .* Use hybrid or catmull_clark"):
        loop(quads)
    pillow = Topology.from_faces([[0, 1, 2], [0, 2, 1]])
    for scheme in (loop, hybrid, midpoint):
        with pytest.raises(MeshError, match=r"around vertices 0, 1, 2\. Use catmull_clark"):
            scheme(pillow)
    assert catmull_clark(pillow).topology.num_faces == 6
    with pytest.raises(TorchfairError, match='boundary: expected one of "curve", "interpolate", "polyline"'):
        hybrid(quads, boundary="smooth")
    with pytest.raises(TorchfairError, match='weights: expected "loop" or "warren"'):
        loop(tetrahedron()[1], weights="modified")
    with pytest.raises(TorchfairError, match='scheme: expected one of "loop", "catmull_clark"'):
        refine(quads, "doo_sabin")
    with pytest.raises(TorchfairError, match="levels: expected 0 or more, got -1"):
        refine(quads, levels=-1)
    for corners in ([0, 1], torch.ones(8), torch.ones(7, dtype=torch.bool)):
        with pytest.raises(ShapeError, match=r"corners: expected a bool tensor \(8,\)"):
            hybrid(quads, corners=corners)


@pytest.mark.parametrize("scheme", ["hybrid", "midpoint", "catmull_clark"])
def test_levels_that_no_machine_holds_are_refused_by_the_faces_they_make(scheme: str) -> None:
    """The number that is named is that of a smaller level times four for each level more."""
    _, mixed = mixed_grid()
    faces = refine(mixed, scheme, 2).topology.num_faces * 4**12
    with pytest.raises(TorchfairError, match=f"levels: 14 make {faces} faces of {mixed.num_faces}"):
        refine(mixed, scheme, 14)
