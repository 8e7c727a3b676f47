"""Crossings in the whole Gauss image, against all pairs of arcs."""

from __future__ import annotations

import pytest
import torch
from geometry_meshes import DEGENERATE, icosphere, random_polytope, torus
from helpers import DOUBLE, wavy_grid
from star_tools import random_arms, stars_of

from torchfair import MeshError, ShapeError, Topology
from torchfair.geometry import gauss_image
from torchfair.stars import gauss_overlaps, pyramid_self_intersections


def all_pairs(vertices: torch.Tensor, topology: Topology) -> int:
    """Crossings of all pairs of arcs: the two planes meet in a line; is it inside both arcs on one side?"""
    points, arcs = gauss_image(vertices, topology)
    a, b = points[arcs].unbind(1)
    normals = torch.linalg.cross(a, b)
    lines = torch.linalg.cross(normals[:, None], normals[None])
    found = torch.zeros(len(arcs), len(arcs), dtype=torch.bool)
    for line in (lines, -lines):
        line = line / torch.linalg.vector_norm(line, dim=-1, keepdim=True)

        def inside(line: torch.Tensor, start: torch.Tensor, stop: torch.Tensor, n: torch.Tensor) -> torch.Tensor:
            after = (torch.linalg.cross(start.expand_as(line), line) * n).sum(-1)
            before = (torch.linalg.cross(line, stop.expand_as(line)) * n).sum(-1)
            return torch.minimum(after, before) > 1e-12

        found |= inside(line, a[:, None], b[:, None], normals[:, None]) & inside(line, a[None], b[None], normals[None])
    shared = (arcs[:, None, :, None] == arcs[None, :, None, :]).flatten(2).any(-1)
    return int((found & ~shared).sum()) // 2


@pytest.mark.parametrize("triangles", [False, True])
@pytest.mark.parametrize("seed", [0, 1])
def test_equals_all_pairs(triangles: bool, seed: int) -> None:
    vertices, topology = wavy_grid(9, 8, triangles=triangles, seed=seed)
    for height in (0.1, 1.0):
        flatter = vertices * torch.tensor([1, 1, height], dtype=DOUBLE)
        overlaps = gauss_overlaps(flatter, topology)
        assert overlaps.crossings == all_pairs(flatter, topology) > 0
        # Arcs of stars at the boundary belong to no pyramid.
        assert overlaps.within_pyramids == int(pyramid_self_intersections(flatter, topology).sum())


def test_within_pyramids_are_their_self_intersections() -> None:
    vertices, topology = stars_of(random_arms(60, 6, 2, height=0.2, saddle=0.2))
    overlaps = gauss_overlaps(vertices, topology)
    assert overlaps.within_pyramids == int(pyramid_self_intersections(vertices, topology).sum()) > 0
    assert overlaps.between_stars == overlaps.crossings - overlaps.within_pyramids > 0


@pytest.mark.parametrize("valence", [4, 5, 7])
def test_long_arcs_are_found_wherever_they_cross(valence: int) -> None:
    """Of crumpled stars arcs reach over half of the sphere; far from their middles they cross too."""
    for height in (1.0, 3.0):
        vertices, topology = stars_of(random_arms(40, valence, 3, height=height))
        overlaps = gauss_overlaps(vertices, topology)
        assert overlaps.crossings == all_pairs(vertices, topology)
        assert overlaps.within_pyramids == int(pyramid_self_intersections(vertices, topology).sum()) > 0


def test_open_stars_at_the_boundary_have_crossings_but_no_pyramid() -> None:
    vertices, closed = stars_of(random_arms(30, 9, 5, height=1.0))
    opened = Topology.from_faces([face for number, face in enumerate(closed.face_lists()) if number % 9])
    assert bool(opened.is_boundary_vertex.all())
    overlaps = gauss_overlaps(vertices, opened)
    assert overlaps.crossings == all_pairs(vertices, opened) > 0
    assert overlaps.within_pyramids == 0
    assert gauss_overlaps(vertices, closed).within_pyramids > 0


def test_convex_surfaces_have_none_and_a_torus_some_between_stars() -> None:
    for mesh in (icosphere(2), random_polytope(1, 40)):
        assert gauss_overlaps(*mesh) == (0, 0)
    vertices, topology = torus(14, 9)
    bent = vertices + 0.02 * vertices.roll(1, -1) ** 2  # symmetric ones only touch
    overlaps = gauss_overlaps(bent, topology)
    assert overlaps.between_stars > 50


@pytest.mark.parametrize("make", DEGENERATE.values(), ids=DEGENERATE)
def test_degenerate_meshes_have_an_answer(make: object) -> None:
    assert gauss_overlaps(*make()).crossings >= 0  # type: ignore[operator]


def test_the_limit_is_half_of_the_pairs_that_are_told_in_both_orders() -> None:
    vertices, topology = wavy_grid(9, 8)
    with pytest.raises(MeshError, match="most_pairs") as told:
        gauss_overlaps(vertices, topology, most_pairs=0)
    pairs = int(str(told.value).split(" pairs of arcs")[0].split()[-1])
    gauss_overlaps(vertices, topology, most_pairs=-(-pairs // 2))
    with pytest.raises(MeshError, match=f"has {pairs} pairs"):
        gauss_overlaps(vertices, topology, most_pairs=-(-pairs // 2) - 1)


def test_refusals() -> None:
    vertices, topology = wavy_grid(9, 8)
    with pytest.raises(MeshError, match="most_pairs"):
        gauss_overlaps(vertices, topology, most_pairs=10)
    with pytest.raises(ShapeError, match="not a batch"):
        gauss_overlaps(vertices[None], topology)
