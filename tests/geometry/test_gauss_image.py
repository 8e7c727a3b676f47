from __future__ import annotations

import torch
from geometry_meshes import mixed_grid
from helpers import cube

from torchfair.geometry import dihedral_angles, dual_edge_lengths, face_normals, gauss_image


def test_arcs_join_the_normals_of_neighbours():
    vertices, topology = mixed_grid()
    image = gauss_image(vertices, topology)
    torch.testing.assert_close(image.points, face_normals(vertices, topology))
    assert image.arcs.tolist() == topology.interior_edge_faces.tolist()
    first, second = image.points[image.arcs].unbind(1)
    torch.testing.assert_close((first - second).norm(dim=-1), dual_edge_lengths(vertices, topology))
    torch.testing.assert_close((first * second).sum(-1), dihedral_angles(vertices, topology).cos())


def test_of_a_cube_is_an_octahedron():
    image = gauss_image(*cube())
    assert image.arcs.shape == (12, 2)
    assert (torch.bincount(image.arcs.flatten()) == 4).all()
    assert image.points.abs().sum(0).tolist() == [2.0, 2.0, 2.0]


def test_batch_shares_the_arcs():
    vertices, topology = cube()
    image = gauss_image(vertices.expand(2, 5, 8, 3), topology)
    assert image.points.shape == (2, 5, 6, 3)
    assert image.arcs.shape == (12, 2)
