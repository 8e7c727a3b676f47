"""Singular vertices lie where a map has room for them."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch
from helpers import grid_faces
from meshing_tools import irregular, nearest
from torch import Tensor

from torchfair import Topology
from torchfair.fields import (
    Directions,
    FaceFrames,
    direction_field,
    directions_of,
    loop_charges,
    matchings,
    vertex_charges,
)
from torchfair.fields.frames import Floats, Ints
from torchfair.fields.matchings import QUARTER, differences
from torchfair.fields.merging import carried_charges
from torchfair.meshing import principal_quads
from torchfair.meshing.node_room import with_room
from torchfair.shapes import PrincipalParaboloid

SMOOTHING = 0.05
Field = tuple[FaceFrames, Directions, Floats, Ints]


def field_of(vertices: Tensor, topology: Topology) -> Field:
    frames = FaceFrames.of(vertices, topology)
    directions = directions_of(frames)
    angles = direction_field(frames, directions, SMOOTHING, 4)
    return frames, directions, angles, matchings(frames, angles)


def with_charges(field: Field, charges: dict[int, int]) -> Field:
    """The field of a surface without singular vertices, with some of these charges, which sum to zero, along edges."""
    frames, directions, angles, matched = field
    left = dict(charges)
    ends = sorted(left)
    for a, b in itertools.pairwise(ends):
        matched = carried_charges(frames, matched, [(v, w, -left[a]) for v, w in path_between(frames, a, b)])
        left[b] += left[a]
    return frames, directions, angles, matched


def path_between(frames: FaceFrames, start: int, end: int) -> list[tuple[int, int]]:
    """Edges inside from a vertex towards another, the straightest way."""
    inner = frames.edges[~frames.is_boundary[frames.edges].any(1)]
    before, layer = {start: start}, [start]
    while end not in before:
        layer = [
            int(w)
            for v in layer
            for w in inner[(inner == v).any(1)].sum(1) - v
            if int(w) not in before and before.setdefault(int(w), v) == v
        ]
    walk = [end]
    while walk[-1] != start:
        walk.append(before[walk[-1]])
    return list(zip(walk[:0:-1], walk[-2::-1], strict=True))


def checkered(lines: int) -> tuple[Tensor, Topology]:
    """A square cut by diagonals that alternate: vertices have 4 and 8 triangles in turn, that in the middle 4."""
    steps = torch.linspace(-1, 1, lines + 1, dtype=torch.float64)
    x, y = (of.reshape(-1) for of in torch.meshgrid(steps, steps, indexing="ij"))
    quads = torch.from_numpy(grid_faces(lines + 1, lines + 1))
    odd = (torch.arange(lines)[:, None] + torch.arange(lines)).reshape(-1) % 2 == 1
    turned = torch.where(odd[:, None], quads, quads.roll(1, 1))
    faces = torch.cat([turned[:, [0, 1, 2]], turned[:, [0, 2, 3]]])
    return torch.stack([x, y, 0 * x], 1), Topology.from_faces(faces)


@pytest.fixture(scope="module")
def saddle() -> Field:
    """Without singular vertices, cut by diagonals that alternate."""
    vertices, topology = checkered(16)
    x, y, _ = vertices.T
    return field_of(torch.stack([x, y, x**2 - 0.5 * y**2], 1), topology)


MIDDLE = 144  # of 17 x 17 vertices


def test_a_vertex_of_few_triangles_hands_its_index_to_a_neighbour_of_more(saddle: Field) -> None:
    frames, directions, angles, matched = with_charges(saddle, {MIDDLE: -1, MIDDLE + 5: 1})
    before = vertex_charges(frames, angles, matched)
    assert {int(v): int(before[v]) for v in np.flatnonzero(before)} == {MIDDLE: -1, MIDDLE + 5: 1}
    angles, matched = with_room(frames, angles, matched, directions, SMOOTHING, 0.5)
    after = vertex_charges(frames, angles, matched)
    assert after[MIDDLE] == 0
    assert after[MIDDLE + 5] == 1  # three quarters by eight triangles: it stays
    goal = int(np.flatnonzero(after == -1)[0])
    assert (frames.edges == sorted([MIDDLE, goal])).all(1).any()
    assert frames.topology.valences[goal] == 8
    assert after.sum() + round(loop_charges(frames, angles, matched).sum()) == 4
    turning = differences(frames, angles) - QUARTER * matched
    assert np.abs(turning).max() < QUARTER  # angles have followed the matchings


def test_it_goes_where_directions_are_trusted_least_and_no_index_is(saddle: Field) -> None:
    frames, directions, angles, matched = with_charges(saddle, {MIDDLE: -1, MIDDLE + 1: -1, MIDDLE + 5: 2})
    trust = np.ones(len(directions.confidence))
    for vertex, least in ((MIDDLE + 1, 0.0), (MIDDLE + 17, 0.5)):
        trust[(frames.triangles == vertex).any(1)] = least
    unsure = replace(directions, confidence=trust)
    angles, matched = with_room(frames, angles, matched, unsure, SMOOTHING, 0.5)
    after = vertex_charges(frames, angles, matched)
    assert {int(v): int(after[v]) for v in np.flatnonzero(after)} == {MIDDLE + 17: -1, MIDDLE + 1: -1, MIDDLE + 5: 2}


def test_six_triangles_are_enough_for_six_quarters_beside_seven() -> None:
    field = field_of(*irregular(PrincipalParaboloid(1.0, -0.5)))
    valences, inner = field[0].topology.valences.numpy(), ~field[0].is_boundary
    a, b = field[0].edges.T
    vertex = int(a[(valences[a] == 6) & (valences[b] == 7) & inner[a] & inner[b]][0])
    far = nearest(torch.from_numpy(field[0].points), (0.5, 0.5))[0]
    frames, directions, angles, matched = with_charges(field, {vertex: -2, far: 2})
    assert with_room(frames, angles, matched, directions, SMOOTHING, 0.5)[1] is matched


def test_four_triangles_are_enough_for_four_quarters_and_eight_for_eight(saddle: Field) -> None:
    for vertex, charge in ((MIDDLE, 1), (MIDDLE + 1, -4)):
        frames, directions, angles, matched = with_charges(saddle, {vertex: charge, MIDDLE + 5: -charge})
        same = with_room(frames, angles, matched, directions, SMOOTHING, 0.5)
        assert vertex_charges(frames, *same)[vertex] == charge


def test_singular_vertices_stay_without_a_radius_and_on_corners(saddle: Field) -> None:
    frames, directions, angles, matched = with_charges(saddle, {MIDDLE: -1, MIDDLE + 5: 1})
    same = with_room(frames, angles, matched, directions, SMOOTHING, 0.0)
    assert same[0] is angles
    assert same[1] is matched
    corners = np.arange(len(frames.points)) == MIDDLE
    assert with_room(frames, angles, matched, directions, SMOOTHING, 0.5, 4, corners)[1] is matched


def test_a_corner_takes_the_nearest_index_of_the_other_sign() -> None:
    field = field_of(*irregular(PrincipalParaboloid(1.0, -0.5)))
    at = nearest(torch.from_numpy(field[0].points), (0, 0), (0.25, 0), (-0.6, 0), (0, 0.2), (0, 0.8))
    charges = dict(zip(at, (1, -1, -1, 1, 0), strict=True))
    frames, directions, angles, matched = with_charges(field, charges)
    corners = np.arange(len(frames.points)) == at[0]

    def charged(radius: float, stay: np.ndarray | None) -> list[int]:
        found = with_room(frames, angles, matched, directions, SMOOTHING, radius, 4, stay)
        after = vertex_charges(frames, *found)
        assert after.sum() == 0
        return after[at[:4]].tolist()

    assert charged(0.9, corners) == [0, 0, -1, 1]
    assert charged(0.15, corners) == [1, -1, -1, 1]
    assert charged(0.9, None) == [1, -1, -1, 1]


def test_five_lines_meet_where_four_triangles_do() -> None:
    """Eight quarters were to go around four triangles, until directions were smoothed over four edges."""
    vertices, topology = checkered(24)
    x, y, _ = vertices.T
    vertices = torch.stack([x, y, 0.5 * (x**4 - 6 * x**2 * y**2 + y**4)], 1)
    assert topology.valences[25 * 12 + 12] == 4
    found = principal_quads(vertices, topology, count=100)
    assert found.report["singular"] == {"-1": 1}
    assert found.report["angle_mean_degrees"] < 2
    assert abs(found.report["faces"] / 100 - 1) < 0.08
    assert not any("smoothed" in note for note in found.notes)
