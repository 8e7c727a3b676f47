"""Meshes whose faces touch in a vertex: what needs edges works, what needs fans refuses."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import pytest
import torch
from helpers import DOUBLE, grid_faces, split_quads, wavy_grid
from mesh_shelf import SHELF
from torch import Tensor

from torchfair import MeshError, Topology, energies, geometry, mesh_polylines, reflection, repair_mesh, stars
from torchfair.repair import RepairedMesh

# Two grids that share one corner, and two closed pillows that share a vertex.
GRIDS = [*grid_faces(3, 3).tolist(), *(grid_faces(3, 3) + 8).tolist()]
PILLOWS = [[0, 1, 2], [0, 2, 1], [0, 3, 4], [0, 4, 3]]
CASES = {"boundaries that touch": (GRIDS, [8]), "closed ones that touch": (PILLOWS, [0])}
each_case = pytest.mark.parametrize(("faces", "touching"), CASES.values(), ids=CASES)


def places(count: int) -> Tensor:
    return torch.linspace(0, 40, 3 * count, dtype=DOUBLE).sin().view(-1, 3)


def apart(vertices: Tensor, topology: Topology) -> RepairedMesh:
    """The same with a vertex for each fan."""
    return repair_mesh(vertices, topology.face_lists(), weld=0.0)


WITH_EDGES: dict[str, Callable[[Tensor, Topology], Tensor]] = {
    "E": energies.normal_variation,
    "E'": energies.angle_variation,
    "mean curvature": energies.total_mean_curvature,
    "areas": lambda v, t: geometry.face_areas(v, t).sum(),
    "lengths": lambda v, t: geometry.edge_lengths(v, t).sum(),
    "reflection variation": lambda v, t: reflection.reflection_variation(v, t).sum(),
}
WITH_FANS: dict[str, Callable[[Tensor, Topology], object]] = {
    "C": energies.total_absolute_curvature,
    "C2": energies.total_frobenius_curvature,
    "Willmore": energies.willmore_energy,
    "polylines": energies.polyline_fairness,
    "pyramids": stars.pyramid_penalty,
    "saddles": stars.saddle_penalty,
    "module": lambda v, t: stars.PyramidPenalty(t)(v),
    "mesh polylines": lambda v, t: mesh_polylines(t),
    "loops": lambda v, t: t.boundary_loops(),
    "rings": lambda v, t: t.ring_offsets,
}


@each_case
@pytest.mark.parametrize("name", WITH_EDGES)
def test_what_needs_edges_is_that_of_the_fans_apart(faces: list[list[int]], touching: list[int], name: str) -> None:
    topology = Topology.from_faces(faces, manifold="edges")
    vertices = places(topology.num_vertices).requires_grad_()
    other = apart(vertices.detach(), topology)
    assert len(other.vertices) > topology.num_vertices
    value = WITH_EDGES[name](vertices, topology)
    cut = Topology.from_faces(other.faces, len(other.vertices))
    torch.testing.assert_close(value.detach(), WITH_EDGES[name](other.vertices, cut))
    (slope,) = torch.autograd.grad(value, vertices)
    assert slope.isfinite().all()


@each_case
@pytest.mark.parametrize("name", WITH_FANS)
def test_what_needs_fans_names_where_they_are_missing(faces: list[list[int]], touching: list[int], name: str) -> None:
    topology = Topology.from_faces(faces, manifold="edges")
    for kept in (topology, pickle.loads(pickle.dumps(topology)), Topology.join([topology])):
        with pytest.raises(MeshError, match=rf"more than one fan: vertices {touching[0]}\. Duplicate such a vertex"):
            WITH_FANS[name](places(topology.num_vertices), kept)
    with pytest.raises(MeshError, match="more than one fan"):
        topology.require_fans()


@each_case
def test_vertices_and_edges_are_counted_as_ever(faces: list[list[int]], touching: list[int]) -> None:
    topology = Topology.from_faces(faces, manifold="edges")
    ends = [set() for _ in range(topology.num_vertices)]  # type: ignore[var-annotated]
    for v, w in topology.edges.tolist():
        ends[v].add(w)
        ends[w].add(v)
    assert topology.valences.tolist() == [len(others) for others in ends]
    rim = set(topology.boundary_edges.flatten().tolist())
    assert topology.is_boundary_vertex.nonzero().flatten().tolist() == sorted(rim)


@pytest.mark.parametrize("name", SHELF)
def test_manifolds_lose_nothing(name: str) -> None:
    lenient, strict = Topology.from_faces(SHELF[name], manifold="edges"), Topology.from_faces(SHELF[name])
    assert lenient == strict
    for table in ("ring_vertices", "ring_offsets", "loop_vertices", "loop_offsets", "valences", "is_boundary_vertex"):
        assert torch.equal(getattr(lenient, table), getattr(strict, table))
    lenient.require_fans()


def test_edges_must_be_manifold_all_the_same() -> None:
    with pytest.raises(MeshError, match="more than two faces"):
        Topology.from_faces([[0, 1, 2], [0, 1, 3], [1, 0, 4]], manifold="edges")
    with pytest.raises(MeshError, match="traversed twice"):
        Topology.from_faces([[0, 1, 2], [0, 1, 3]], manifold="edges")
    with pytest.raises(MeshError, match='manifold must be "vertices" or "edges"'):
        Topology.from_faces([[0, 1, 2]], manifold="faces")  # type: ignore[arg-type]


@pytest.mark.parametrize("size", [5, 16, 17, 18, 40])
def test_fans_of_any_size_are_found(size: int) -> None:
    """Vertices of many faces are judged in another way than those of few."""
    wheel = [[0, 1 + i, 1 + (i + 1) % size] for i in range(size)]
    Topology.from_faces(wheel).require_fans()
    more = size + 1
    for second in ([[0, more, more + 1]], [[0, more, more + 1], [0, more + 1, more + 2], [0, more + 2, more]]):
        with pytest.raises(MeshError, match="more than one fan: vertices 0"):
            Topology.from_faces(wheel + second)
        with pytest.raises(MeshError, match="more than one fan: vertices 0"):
            Topology.from_faces(second + wheel)


def test_tables_made_inside_transforms_are_ordinary_ones() -> None:
    """Rings are made when first asked for, which may be under ``vmap`` of ``grad``: they must outlive that."""
    vertices, _ = wavy_grid(4, 4)
    fresh = Topology.from_faces(split_quads(grid_faces(4, 4)), manifold="edges")
    torch.func.vmap(torch.func.grad(lambda v: energies.total_absolute_curvature(v, fresh)))(torch.stack([vertices] * 2))
    expected = Topology.from_faces(split_quads(grid_faces(4, 4)))
    assert torch.equal(fresh.ring_vertices, expected.ring_vertices)
    assert fresh.ring_vertices.numpy().size
    value = energies.polyline_fairness(vertices.requires_grad_(), fresh)
    torch.testing.assert_close(value, energies.polyline_fairness(vertices, expected))
