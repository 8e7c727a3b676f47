"""Fast against slow: the schemes give what the book says, vertex by vertex and face by face."""

from __future__ import annotations

import hypothesis.strategies as st
import numpy as np
import pytest
import torch
from geometry_meshes import Mesh, capped_prism, icosphere, mixed_grid, random_polytope, split_faces, with_isolated
from helpers import grid_faces, wavy_grid
from hypothesis import given, settings
from mesh_shelf import each_mesh
from subdivision_reference import reference_faces, reference_positions, turned

from torchfair import MeshError, Topology
from torchfair.subdivision import Refinement, catmull_clark, hybrid, loop, midpoint

SCHEMES = {"loop": loop, "catmull_clark": catmull_clark, "hybrid": hybrid}
RULES = ["curve", "interpolate", "polyline"]
MESHES = {
    "closed triangles": lambda: random_polytope(3),
    "open triangles": lambda: wavy_grid(5, 4, triangles=True),
    "closed polygons": lambda: capped_prism(5),
    "polygons, one isolated vertex": lambda: with_isolated(mixed_grid()),
    "closed, triangles and quads": lambda: partly_split(capped_prism(4), 1),
    "icosphere": lambda: icosphere(1),
}


def partly_split(mesh: Mesh, seed: int) -> Mesh:
    """About half of the faces cut into triangles."""
    vertices, topology = mesh
    random = np.random.default_rng(seed)
    faces = []
    for face in topology.face_lists():
        if random.uniform() < 0.5:
            faces.append(face)
        else:
            alone = Topology.from_faces([face], num_vertices=topology.num_vertices)
            faces += split_faces((vertices, alone), int(random.integers(100)))[1].face_lists()
    return vertices, Topology.from_faces(faces, num_vertices=topology.num_vertices)


def assert_by_the_book(vertices: torch.Tensor, fine: Refinement, scheme: str, rule: str, corners=None) -> None:
    expected = reference_positions(vertices, fine.coarse, scheme, rule, corners)
    np.testing.assert_allclose(fine.apply(vertices).numpy(), expected, rtol=0, atol=1e-13 * np.abs(expected).max())
    children: list[set[tuple[int, ...]]] = [set() for _ in range(fine.coarse.num_faces)]
    for parent, face in zip(fine.face_parents.tolist(), fine.topology.face_lists(), strict=True):
        children[parent].add(turned(tuple(face)))
    assert children == reference_faces(fine.coarse, scheme)


@pytest.mark.parametrize("rule", RULES)
@pytest.mark.parametrize("mesh", MESHES.values(), ids=MESHES)
@pytest.mark.parametrize("scheme", SCHEMES)
def test_by_the_book(scheme: str, mesh, rule: str) -> None:
    vertices, topology = mesh()
    if scheme == "loop" and not topology.is_triangular:
        with pytest.raises(MeshError, match="Use hybrid or catmull_clark, or cut"):
            loop(topology)
        return
    corners = torch.arange(topology.num_vertices) % 5 == 0
    assert_by_the_book(vertices, SCHEMES[scheme](topology, boundary=rule), scheme, rule)
    assert_by_the_book(vertices, SCHEMES[scheme](topology, boundary=rule, corners=corners), scheme, rule, corners)


@each_mesh
def test_catmull_clark_of_small_meshes(faces: list[list[int]]) -> None:
    topology = Topology.from_faces(faces)
    vertices = torch.from_numpy(np.random.default_rng(0).normal(size=(topology.num_vertices, 3)))
    assert_by_the_book(vertices, catmull_clark(topology), "catmull_clark", "curve")


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 6), st.integers(2, 6), st.sampled_from(RULES))
def test_random_mixtures_with_boundary(seed: int, rows: int, columns: int, rule: str) -> None:
    vertices, _ = wavy_grid(rows, columns, seed=seed)
    vertices, topology = partly_split((vertices, Topology.from_faces(grid_faces(rows, columns))), seed)
    corners = torch.from_numpy(np.random.default_rng(seed).uniform(size=topology.num_vertices) < 0.3)
    for scheme in ("catmull_clark", "hybrid"):
        fine = SCHEMES[scheme](topology, boundary=rule, corners=corners)
        assert_by_the_book(vertices, fine, scheme, rule, corners)


def test_hybrid_is_loop_on_triangles_and_catmull_clark_on_quads() -> None:
    for topology, scheme in [(wavy_grid(triangles=True)[1], loop), (wavy_grid()[1], catmull_clark)]:
        one, other = hybrid(topology), scheme(topology)
        assert abs(one.matrix - other.matrix).sum() == 0.0
        assert one.topology.face_lists() == other.topology.face_lists()


def test_hybrid_splits_linearly_and_averages_where_triangles_meet_quads() -> None:
    """Stam and Loop: 1/(1 + n/2 + q/4) times the vertex, half of its neighbours, a quarter across its q quads."""
    vertices, topology = partly_split(wavy_grid(7, 7), 5)
    linear = midpoint(topology)
    points, fine = linear.apply(vertices).numpy(), linear.topology
    total, weight = points.copy(), np.ones(len(points))
    for v, w in fine.edges.tolist():
        for here, there in ((v, w), (w, v)):
            total[here] += points[there] / 2
            weight[here] += 1 / 2
    sees = {"triangle": np.zeros(len(points), bool), "quad": np.zeros(len(points), bool)}
    for face in fine.face_lists():
        sees["quad" if len(face) == 4 else "triangle"][face] = True
        if len(face) == 4:
            for here, there in zip(face, face[2:] + face[:2], strict=True):
                total[here] += points[there] / 4
                weight[here] += 1 / 4
    mixed = sees["triangle"] & sees["quad"] & ~fine.is_boundary_vertex.numpy()
    assert mixed.sum() > 20
    smooth = hybrid(topology).apply(vertices).numpy()
    np.testing.assert_allclose(smooth[mixed], (total / weight[:, None])[mixed], atol=1e-14)
