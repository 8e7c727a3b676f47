"""Creases are the sharp edges inside a mesh; chains cover them once, from corner to corner."""

from __future__ import annotations

import itertools
import math

import pytest
import torch
from helpers import DOUBLE, cube, grid_faces, random_rotation, split_quads, tetrahedron
from torch import Tensor

from torchfair import MeshError, ShapeError, Topology
from torchfair.creases import CreaseChain, crease_chains, crease_corners, crease_edges
from torchfair.errors import SettingsError
from torchfair.geometry import dihedral_angles

FORTY = math.radians(40.0)


def chains_of(vertices: Tensor, topology: Topology, angle: float = FORTY, corner: float = FORTY) -> list[CreaseChain]:
    edges = crease_edges(vertices, topology, angle)
    return crease_chains(topology, edges, crease_corners(vertices, topology, edges, corner))


def ridge(slope: float = 1.0, n: int = 5) -> tuple[Tensor, Topology]:
    """A roof over a grid of unit steps whose ridge is the row 2 n ... 3 n - 1."""
    x, y = torch.meshgrid(torch.arange(5, dtype=DOUBLE), torch.arange(n, dtype=DOUBLE), indexing="ij")
    vertices = torch.stack([x, y, -slope * (x - 2).abs()], -1).reshape(-1, 3)
    return vertices, Topology.from_faces(split_quads(grid_faces(5, n)))


def tube(sides: int = 20) -> tuple[Tensor, Topology]:
    """A closed prism over a regular polygon, with fans as caps."""
    turn = 2.0 * math.pi * torch.arange(sides, dtype=DOUBLE) / sides
    rims = [torch.stack([turn.cos(), turn.sin(), torch.full_like(turn, z)], 1) for z in (0.0, 2.0)]
    vertices = torch.cat([*rims, torch.tensor([[0.0, 0, 0], [0, 0, 2]], dtype=DOUBLE)])
    faces: list[list[int]] = []
    for i in range(sides):
        j = (i + 1) % sides
        faces += [[i, j, sides + j, sides + i], [j, i, 2 * sides], [sides + i, sides + j, 2 * sides + 1]]
    return vertices, Topology.from_faces(faces)


@pytest.mark.parametrize("slope", [0.2, 1.0, 5.0])
def test_a_ridge_is_a_crease_from_where_its_angle_is_that_of_its_slopes(slope: float) -> None:
    vertices, topology = ridge(slope)
    bend = 2.0 * math.atan(slope)
    assert not len(crease_edges(vertices, topology, bend + 1e-9))
    assert topology.edges[crease_edges(vertices, topology, bend - 1e-9)].tolist() == [[i, i + 1] for i in range(10, 14)]
    valley = vertices * torch.tensor([1.0, 1.0, -1.0], dtype=DOUBLE)
    assert len(crease_edges(valley @ random_rotation().T * 1e3, topology, bend - 1e-9)) == 4
    assert not len(crease_edges(vertices, topology, 0.0))  # switched off, not everything


def test_a_crease_meets_the_boundary_in_corners() -> None:
    vertices, topology = ridge()
    (chain,) = chains_of(vertices, topology)
    assert chain.vertices.tolist() == [10, 11, 12, 13, 14]
    assert not chain.closed
    edges = crease_edges(vertices, topology, FORTY)
    assert torch.nonzero(crease_corners(vertices, topology, edges, math.pi)).squeeze(1).tolist() == [10, 14]
    ends = crease_corners(vertices, topology, edges[1:3], math.pi)  # and ends inside in others
    assert torch.nonzero(ends).squeeze(1).tolist() == [11, 13]


def test_the_rims_of_a_tube_are_closed_and_the_edges_of_a_cube_meet_in_threes() -> None:
    vertices, topology = tube()
    below, above = chains_of(vertices, topology)
    assert below.closed
    assert sorted(below.vertices.tolist()) == list(range(20))
    assert sorted(above.vertices.tolist()) == list(range(20, 40))
    steps = (above.vertices.roll(-1) - above.vertices).abs()
    assert set(steps.tolist()) == {1, 19}  # in order around
    for vertices, topology, count in ((*cube(), 12), (*tetrahedron(), 6)):
        chains = chains_of(vertices, topology)
        assert len(chains) == count
        assert all(len(chain.vertices) == 2 and not chain.closed for chain in chains)


@pytest.mark.parametrize("turn", [10.0, 60.0, 150.0])
def test_a_crease_has_a_corner_where_it_turns_by_more(turn: float) -> None:
    """Two edges of a grid that meet at its middle vertex, turned in space by a given angle."""
    x, y = torch.meshgrid(torch.arange(3, dtype=DOUBLE), torch.arange(3, dtype=DOUBLE), indexing="ij")
    vertices = torch.stack([x, y, torch.zeros_like(x)], -1).reshape(-1, 3)
    vertices[7] = torch.tensor([1.0 + math.cos(math.radians(turn)), 1.0, math.sin(math.radians(turn))])
    topology = Topology.from_faces(grid_faces(3, 3))
    edges = torch.tensor([number for number, ends in enumerate(topology.edges.tolist()) if ends in ([1, 4], [4, 7])])
    for factor, expected in ((0.999, True), (1.001, False)):
        assert bool(crease_corners(vertices, topology, edges, math.radians(factor * turn))[4]) is expected


def test_chains_hold_every_crease_edge_once() -> None:
    """On a random surface where creases end and branch everywhere."""
    generator = torch.Generator().manual_seed(1)
    x, y = torch.meshgrid(torch.arange(9, dtype=DOUBLE), torch.arange(9, dtype=DOUBLE), indexing="ij")
    vertices = torch.stack([x, y, 0.6 * torch.randn(9, 9, dtype=DOUBLE, generator=generator)], -1).reshape(-1, 3)
    topology = Topology.from_faces(split_quads(grid_faces(9, 9)))
    edges = crease_edges(vertices, topology, FORTY)
    assert torch.equal(edges, torch.nonzero(dihedral_angles(vertices, topology).abs() > FORTY).squeeze(1))
    corners = crease_corners(vertices, topology, edges, FORTY)
    found, inside = [], []
    for vertices_along, closed in crease_chains(topology, edges, corners):
        walk = vertices_along.tolist()
        around = [*walk, walk[0]] if closed else walk
        found += [sorted(pair) for pair in itertools.pairwise(around)]
        inside += walk if closed else walk[1:-1]
        assert closed or bool(corners[walk[0]] & corners[walk[-1]])
    assert sorted(found) == sorted(topology.edges[edges].tolist())
    assert len(set(inside)) == len(inside)
    assert not bool(corners[torch.tensor(inside, dtype=torch.int64)].any())


def test_a_loop_with_one_corner_starts_and_ends_there() -> None:
    vertices, topology = tube()
    edges = crease_edges(vertices, topology, FORTY)
    corners = torch.zeros(42, dtype=torch.bool)
    corners[5] = True
    loop, other = crease_chains(topology, edges, corners)
    assert (loop.closed, other.closed) == (False, True)
    assert loop.vertices[0] == loop.vertices[-1] == 5
    assert len(loop.vertices) == 21


def test_what_cannot_be_is_refused() -> None:
    vertices, topology = cube()
    with pytest.raises(SettingsError, match="radians"):
        crease_edges(vertices, topology, 40.0)
    with pytest.raises(ShapeError, match="one mesh"):
        crease_edges(vertices[None], topology, FORTY)
    with pytest.raises(MeshError, match="0 to 11"):
        crease_corners(vertices, topology, torch.tensor([12]), FORTY)
    with pytest.raises(ShapeError, match="two meet"):
        crease_chains(topology, torch.arange(12), torch.zeros(8, dtype=torch.bool))


def test_an_edge_of_just_the_crease_angle_is_no_crease() -> None:
    tent = torch.tensor([[0.0, 0, 0], [0, 1, 0], [1, 0, 1], [-1, 0, 1]], dtype=DOUBLE)
    topology = Topology.from_faces([[0, 2, 1], [0, 1, 3]])
    angle = float(dihedral_angles(tent, topology).abs().max())
    assert not len(crease_edges(tent, topology, angle))
    assert len(crease_edges(tent, topology, math.nextafter(angle, 0.0))) == 1


def test_straight_on_is_no_corner_of_an_angle_of_zero() -> None:
    x, y = torch.meshgrid(torch.arange(3, dtype=DOUBLE), torch.arange(3, dtype=DOUBLE), indexing="ij")
    vertices = torch.stack([x, y, -(x - 1).abs()], -1).reshape(-1, 3)
    topology = Topology.from_faces(grid_faces(3, 3))
    corners = crease_corners(vertices, topology, crease_edges(vertices, topology, 0.5), 0.0)
    assert torch.nonzero(corners).squeeze(1).tolist() == [3, 5]
