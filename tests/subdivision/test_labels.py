"""Labels pass from a mesh to its refinements."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from geometry_meshes import icosphere, mixed_grid
from helpers import cube, grid_faces, split_quads, wavy_grid
from mesh_shelf import torus_faces
from torch import Tensor

from torchfair import ShapeError, Topology
from torchfair.boundary import boundary_corners
from torchfair.subdivision import Origin, catmull_clark, hybrid, loop, midpoint, refine

SCHEMES = {"loop": loop, "catmull_clark": catmull_clark, "hybrid": hybrid, "midpoint": midpoint}


def closed_loop_length(topology: Topology, labelled: Tensor) -> int:
    """Number of edges of the only closed loop that labelled edges form; fails if they form anything else."""
    around: dict[int, list[int]] = {}
    for v, w in topology.edges[labelled].tolist():
        around.setdefault(v, []).append(w)
        around.setdefault(w, []).append(v)
    assert all(len(neighbours) == 2 for neighbours in around.values())
    start = previous = next(iter(around))
    vertex, steps = around[start][0], 1
    while vertex != start:
        previous, vertex = vertex, next(w for w in around[vertex] if w != previous)
        steps += 1
    assert steps == len(around)
    return steps


@pytest.mark.parametrize("scheme", SCHEMES)
def test_children_of_a_closed_edge_loop_are_a_closed_edge_loop_of_twice_the_length(scheme: str) -> None:
    topology = icosphere(1)[1]
    rings = [set(ring.tolist()) for ring in topology.rings_by_valence[6][1]]
    labels = torch.tensor([set(edge) <= rings[0] for edge in topology.edges.tolist()])
    length = closed_loop_length(topology, labels)
    assert length == 6
    for levels in (1, 2):
        fine = refine(topology, scheme, levels)
        assert closed_loop_length(fine.topology, fine.carry_edge_labels(labels)) == 2**levels * length


@pytest.mark.parametrize("scheme", ["catmull_clark", "hybrid", "midpoint"])
def test_boundary_edges_stay_boundary_edges(scheme: str) -> None:
    topology = mixed_grid()[1]
    number = torch.arange(topology.num_edges)
    fine = refine(topology, scheme, 2)
    carried = fine.carry_edge_labels(number >= topology.num_interior_edges)
    assert torch.equal(carried, torch.arange(fine.topology.num_edges) >= fine.topology.num_interior_edges)
    numbers = fine.carry_edge_labels(number, fill=-1)
    assert torch.equal(numbers, fine.edge_parents)
    assert torch.equal(numbers[numbers >= 0].bincount(), torch.full((topology.num_edges,), 4))


@pytest.mark.parametrize("scheme", ["loop", "hybrid"])
def test_a_family_of_a_triangle_lattice_stays_a_family(scheme: str) -> None:
    """Two opposite edges at every vertex, on all levels, as principal edges must be."""
    topology = Topology.from_faces(split_quads(torus_faces(5, 4)))
    v, w = topology.edges.unbind(1)
    labels = (v // 4 == w // 4) & ((v - w).abs() % 4 != 0)  # along the columns
    for levels in range(3):
        step = refine(topology, scheme, levels)
        family = step.carry_edge_labels(labels, parallel=True)
        pairs = {frozenset(edge) for edge in step.topology.edges[family].tolist()}
        vertices, rings = step.topology.rings_by_valence[6]
        marked = torch.tensor(
            [
                [frozenset((a, b)) in pairs for b in ring]
                for a, ring in zip(vertices.tolist(), rings.tolist(), strict=True)
            ]
        )
        assert (marked.sum(1) == 2).all()
        assert torch.equal(marked, marked.roll(3, 1))
    assert refine(topology, scheme, 1).carry_edge_labels(labels).sum() == 2 * labels.sum()


@pytest.mark.parametrize("levels", [1, 2, 3])
@pytest.mark.parametrize("triangles", [True, False])
def test_parallels_are_parallel(triangles: bool, levels: int) -> None:
    faces = grid_faces(4, 4)
    topology = Topology.from_faces(split_quads(faces) if triangles else faces)
    grid = torch.tensor([[i, j, 0.0] for i in range(4) for j in range(4)])
    step = refine(topology, "midpoint", levels)

    def directions(mesh: Topology, points: Tensor) -> Tensor:
        x, y, _ = (points[mesh.edges[:, 1]] - points[mesh.edges[:, 0]]).abs().unbind(-1)
        return (x > 0).long() + 2 * (y > 0).long()  # 1: along x, 2: along y, 3: diagonal

    expected = directions(step.topology, step.apply(grid))
    assert torch.equal(step.carry_edge_labels(directions(topology, grid), parallel=True), expected)
    assert (step.edge_parallels >= 0).all()


def test_a_quad_passes_on_what_its_opposite_sides_agree_on() -> None:
    topology = Topology.from_faces([[0, 1, 2, 3]])
    sides = [tuple(sorted(edge)) for edge in topology.edges.tolist()]
    value = {(0, 1): 5, (2, 3): 5, (1, 2): 7, (0, 3): 8}
    step = midpoint(topology)
    carried = step.carry_edge_labels(torch.tensor([value[side] for side in sides]), parallel=True, fill=-1)
    inner = step.edge_parents < 0
    assert sorted(carried[inner].tolist()) == [-1, -1, 5, 5]
    assert (step.edge_parallels[inner].sort(1).values.diff(dim=1) > 0).all()


def test_inner_edges_of_other_cuts_have_no_parallels() -> None:
    for step in (catmull_clark(icosphere(0)[1]), midpoint(Topology.from_faces([[0, 1, 2, 3, 4]]))):
        twice = step.then(midpoint(step.topology))
        for refinement in (step, twice):
            inner = refinement.edge_parents < 0
            parallels = refinement.edge_parallels
            assert ((parallels >= 0).all(1) | (parallels == -1).all(1)).all()
            assert torch.equal((parallels < 0).any(1), inner)


def test_carrying_through_two_levels_is_carrying_twice() -> None:
    topology = mixed_grid()[1]
    random = np.random.default_rng(0)
    of_edges, of_faces = (torch.from_numpy(random.integers(0, 2, n)) for n in (topology.num_edges, topology.num_faces))
    of_vertices = torch.from_numpy(random.integers(0, 3, topology.num_vertices))
    first = hybrid(topology)
    second = hybrid(first.topology)
    both = first.then(second)
    for keywords in ({}, {"fill": 9}, {"parallel": True}, {"parallel": True, "fill": 9}):
        once = first.carry_edge_labels(of_edges, **keywords)
        assert torch.equal(both.carry_edge_labels(of_edges, **keywords), second.carry_edge_labels(once, **keywords))
    assert torch.equal(both.carry_face_labels(of_faces), second.carry_face_labels(first.carry_face_labels(of_faces)))
    along = of_edges.bool()
    once = first.carry_vertex_labels(of_vertices, along=along, fill=-1)
    twice = second.carry_vertex_labels(once, along=first.carry_edge_labels(along), fill=-1)
    assert torch.equal(both.carry_vertex_labels(of_vertices, along=along, fill=-1), twice)


def test_corner_masks_stay_on_the_corners() -> None:
    vertices, topology = wavy_grid(5, 4)
    corners = boundary_corners(vertices, topology, 1.0)
    assert corners.any()
    fine = refine(topology, "catmull_clark", 2)
    assert torch.equal(fine.carry_vertex_labels(corners).nonzero(), corners.nonzero())


def test_labels_pass_along_labelled_edges_whose_ends_agree() -> None:
    topology = mixed_grid()[1]
    rim = topology.is_boundary_vertex
    edges = torch.arange(topology.num_edges) >= topology.num_interior_edges
    fine = refine(topology, "hybrid", 2)
    assert torch.equal(fine.carry_vertex_labels(rim, along=edges), fine.topology.is_boundary_vertex)
    number = torch.arange(topology.num_vertices)  # ends never agree
    carried = fine.carry_vertex_labels(number, along=edges, fill=-1)
    old = fine.vertex_origins[:, 0] == Origin.VERTEX
    assert torch.equal(carried[old], number)
    assert (carried[~old] == -1).all()


def test_labels_of_any_shape_and_dtype() -> None:
    topology = cube()[1]
    step = catmull_clark(topology)
    of_vertices, of_edges, of_faces = (torch.rand(n, 2, 3) for n in (8, 12, 6))
    assert step.carry_vertex_labels(of_vertices, along=torch.ones(12, dtype=torch.bool)).shape == (26, 2, 3)
    assert step.carry_face_labels(of_faces).shape == (24, 2, 3)
    carried = step.carry_edge_labels(of_edges, parallel=True, fill=0.5)
    assert carried.shape == (48, 2, 3)
    assert carried.dtype == torch.float32
    assert step.carry_edge_labels(torch.ones(12, dtype=torch.bool)).dtype == torch.bool


def test_wrong_shapes() -> None:
    step = catmull_clark(cube()[1])
    with pytest.raises(ShapeError, match=r"labels: expected a tensor \(8, \.\.\.\), the first dimension V"):
        step.carry_vertex_labels(torch.zeros(7))
    with pytest.raises(ShapeError, match=r"labels: expected a tensor \(12, \.\.\.\), the first dimension E"):
        step.carry_edge_labels(torch.zeros(()))
    with pytest.raises(ShapeError, match=r"labels: expected a tensor \(6, \.\.\.\), the first dimension F"):
        step.carry_face_labels([0] * 6)
    with pytest.raises(ShapeError, match=r"along: expected a bool tensor \(12,\)"):
        step.carry_vertex_labels(torch.zeros(8), along=torch.zeros(12))
