"""Normals at closest points: of the flat piece, and interpolated."""

from __future__ import annotations

import torch
from closest_reference import soup
from helpers import DOUBLE, wavy_grid

from torchfair import Topology
from torchfair.geometry.closest_point import ReferenceSurface
from torchfair.geometry.normals import face_normals, vertex_normals

EPS = torch.finfo(DOUBLE).eps


def test_normals_are_those_of_faces_and_vertices():
    vertices, topology = wavy_grid(6, 7, triangles=True)
    surface = ReferenceSurface(vertices, topology)
    found = surface.closest(vertices[topology.triangles].mean(1))
    assert torch.equal(found.faces, torch.arange(topology.num_faces))
    assert torch.equal(found.normals, face_normals(vertices, topology))
    at_vertices = surface.closest(vertices).smooth_normals
    torch.testing.assert_close(at_vertices, vertex_normals(vertices, topology), rtol=0, atol=4 * EPS)


def test_the_smooth_normal_at_the_centre_of_a_fan_is_that_of_the_face():
    vertices, topology = wavy_grid(6, 7)
    centres = vertices[topology.faces_by_size[4][1]].mean(1)
    found = ReferenceSurface(vertices, topology).closest(centres)
    torch.testing.assert_close(found.smooth_normals, face_normals(vertices, topology), rtol=0, atol=1e-13)


def test_smooth_normals_do_not_jump_across_edges():
    vertices, topology = wavy_grid(6, 7)
    surface = ReferenceSurface(vertices, topology)
    middle = vertices[topology.interior_edges].mean(1)
    across = torch.linalg.cross(
        vertices[topology.interior_edges[:, 1]] - vertices[topology.interior_edges[:, 0]],
        vertex_normals(vertices, topology)[topology.interior_edges[:, 0]],
    )
    one, other = (surface.closest(middle + sign * 1e-7 * across) for sign in (1, -1))
    assert (one.faces != other.faces).all()
    assert (one.smooth_normals - other.smooth_normals).norm(dim=1).max() < 1e-5
    assert (one.normals - other.normals).norm(dim=1).max() > 0.1


def test_a_piece_without_area_borrows_the_normal_of_its_corners():
    """A strip of two triangles ends in one whose corners lie on a line; it still can be closest."""
    vertices = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [2, -1, 0]], dtype=DOUBLE)
    surface = ReferenceSurface(vertices, Topology.from_faces([[0, 1, 2], [1, 3, 2]]))
    found = surface.closest(torch.tensor([[3.0, -1, 2]], dtype=DOUBLE))
    assert found.faces.item() == 1
    assert found.normals[0].tolist() == found.smooth_normals[0].tolist() == [0, 0, 1]
    alone = soup(torch.tensor([[[0.0, 0, 0], [1, 0, 0], [2, 0, 0]]], dtype=DOUBLE))
    found = alone.closest(torch.tensor([[1.5, 3, 4]], dtype=DOUBLE))
    assert found.distances.item() == 5
    assert found.normals[0].tolist() == found.smooth_normals[0].tolist() == [0, 0, 0]
