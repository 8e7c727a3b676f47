"""Faces that noise has flipped."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE, grid_faces, split_quads, wavy_grid
from noisy_meshes import angles, box, noisy

from torchfair import Topology
from torchfair.formfinding.denoise.neighbourhoods import Neighbourhoods
from torchfair.formfinding.denoise.unfolding import Sides, missing_area, missing_area_gradient
from torchfair.geometry import face_areas, face_normals
from torchfair.projection import guided_projection


def sides(vertices: torch.Tensor, topology: Topology) -> Sides:
    return Sides.of(vertices, topology, Neighbourhoods.of(topology))


def flat(n: int = 8) -> tuple[torch.Tensor, Topology]:
    i, j = torch.meshgrid(torch.arange(n, dtype=DOUBLE), torch.arange(n, dtype=DOUBLE), indexing="ij")
    vertices = torch.stack([i.flatten(), j.flatten(), torch.zeros(n * n, dtype=DOUBLE)], dim=1)
    return vertices, Topology.from_faces(split_quads(grid_faces(n, n)).tolist())


@pytest.mark.parametrize("size", [3, 4, 6])
def test_missing_area_and_its_gradient(size: int) -> None:
    torch.manual_seed(size)
    x, normal = torch.randn(5, size, 3, dtype=DOUBLE, requires_grad=True), torch.randn(5, 3, dtype=DOUBLE)
    least = torch.rand(5, dtype=DOUBLE)
    topology = Topology.from_faces(torch.arange(5 * size).view(5, size).tolist())
    vectors = face_normals(x.detach().flatten(0, 1), topology) * face_areas(x.detach().flatten(0, 1), topology)[:, None]
    value = missing_area(x, normal, least)
    torch.testing.assert_close(value.detach(), least - (vectors * normal).sum(1))
    (gradient,) = torch.autograd.grad(value.sum(), x)
    torch.testing.assert_close(missing_area_gradient(x.detach(), normal, least), gradient.flatten(1))


def test_a_vertex_pulled_over_its_neighbours_flips_the_faces_behind_it() -> None:
    vertices, topology = flat()
    assert not bool(sides(vertices, topology).flipped(vertices, topology).any())
    vertices[27, 0] += 1.4
    against = face_normals(vertices, topology)[:, 2] < 0.0
    assert int(against.sum()) > 0
    assert sides(vertices, topology).flipped(vertices, topology).equal(against)


def test_sides_follow_the_orientation_of_the_faces() -> None:
    vertices, topology = box(6)
    turned = Topology.from_faces(topology.corners.view(-1, 3).flip(1).tolist())
    for some in (topology, turned):
        found = sides(vertices, some)
        assert not bool(found.flipped(vertices, some).any())
        assert bool(((found.normals * face_normals(vertices, some)).sum(1) > 0.5).all())


def test_flipped_faces_are_those_that_are_flipped_against_the_clean_mesh() -> None:
    mesh = box(14)
    vertices = noisy(mesh, "all", 0.3)
    found, true = sides(vertices, mesh[1]).flipped(vertices, mesh[1]), angles(vertices, mesh) > 90.0
    assert int(true.sum()) > 50
    assert int((true & found).sum()) > 0.85 * int(true.sum())
    assert int((found & ~true).sum()) < 0.3 * int(true.sum())  # those along edges of the box that stand upright


def test_nothing_is_said_where_both_sides_of_a_thin_plate_meet() -> None:
    """Two square sheets sewn together along their boundary: the sides cancel beside the seam, not farther in."""
    n = 12
    sheet, topology = flat(n)
    corners = topology.corners.view(-1, 3)
    cut = (topology.valences[corners] > 2).all(1)  # without ears, which would be sewn to themselves
    topology = Topology.from_faces(corners[cut], num_vertices=n * n)
    inside = (topology.valences > 0) & ~topology.is_boundary_vertex
    below = torch.arange(n * n)
    below[inside] = n * n + torch.arange(int(inside.sum()))
    faces = topology.corners.view(-1, 3)
    pillow = Topology.from_faces(torch.cat([faces, below[faces].flip(1)]).tolist())
    depth = torch.tensor([0.0, 0.0, 1e-3], dtype=DOUBLE)
    vertices = torch.cat([sheet, sheet[inside] - depth])
    found = sides(vertices, pillow)
    silent = (found.normals == 0.0).all(1)
    sewn = torch.cat([~inside, inside.new_zeros(int(inside.sum()))])[pillow.corners.view(-1, 3)]
    assert bool(silent[sewn.sum(1) == 2].all())
    assert bool((found.normals[:, 2].abs() > 0.99)[~silent].all())
    assert 0 < int(silent.sum()) < 0.6 * len(silent)
    assert not bool(found.flipped(vertices, pillow).any())


@pytest.mark.parametrize("triangles", [True, False])
def test_terms_vanish_where_nothing_is_folded_and_turn_back_what_is(triangles: bool) -> None:
    vertices, topology = wavy_grid(7, 7, triangles=triangles)
    start = vertices.clone()
    start[24, :2] += (1.5 if triangles else 2.5) * (vertices[25, :2] - vertices[24, :2])
    found = sides(start, topology)
    assert bool(found.flipped(start, topology).any())
    terms = found.unfolding_terms(start, topology, 0.3, weight=100.0)
    result = guided_projection({"vertices": start}, terms)
    assert result.history[0].merit > 0.0
    assert not bool(found.flipped(result.blocks["vertices"], topology).any())
    settled = guided_projection({"vertices": vertices}, found.unfolding_terms(vertices, topology, 0.3, weight=100.0))
    assert settled.history[0].merit == 0.0
    assert found.unfolding_terms(start, topology, 0.3, weight=0.0) == []


def test_slender_faces_are_asked_for_less() -> None:
    vertices, topology = flat()
    squeezed = vertices * torch.tensor([1.0, 0.01, 1.0], dtype=DOUBLE)  # faces of area 0.005, edges of about 1
    terms = sides(squeezed, topology).unfolding_terms(squeezed, topology, 1e-4, weight=1.0)
    asked = terms[0].data[1]
    assert asked.max() == pytest.approx(0.5e-4, rel=1e-2)  # half the noise times the longest edge
    terms = sides(vertices, topology).unfolding_terms(vertices, topology, 0.3, weight=1.0)
    torch.testing.assert_close(terms[0].data[1], torch.full((98,), 0.05, dtype=DOUBLE))  # a tenth of a half
