from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE, cube, grid_faces, tetrahedron, wavy_grid

from torchfair import Topology
from torchfair.cameras import Camera
from torchfair.geometry import dihedral_angles, edge_vectors
from torchfair.reflection import face_mirror_directions
from torchfair.viewing.camera import fit_camera
from torchfair.viewing.shading import (
    BACK,
    FRONT,
    STRIPES_DARK,
    STRIPES_LIGHT,
    shade_faces,
    stripe_colors,
    stripe_frequency,
    towards_viewer,
)

ASLANT = torch.tensor([1.0, -2, 1.5], dtype=DOUBLE)
UP = torch.tensor([0.0, 0, 1], dtype=DOUBLE)


def camera_for(vertices: torch.Tensor, field_of_view: float = 0.0) -> Camera:
    return fit_camera(vertices, towards_eye=ASLANT, up=UP, width=64, height=48, field_of_view=field_of_view)[0]


def flat_grid() -> tuple[torch.Tensor, Topology]:
    vertices, _ = wavy_grid(5, 6)
    return vertices * torch.tensor([1.0, 1, 0], dtype=DOUBLE), Topology.from_faces(grid_faces(5, 6))


def test_a_flat_mesh_has_one_colour() -> None:
    vertices, topology = flat_grid()
    colors = shade_faces(vertices, topology, camera_for(vertices))
    assert torch.allclose(colors, colors[:1].expand_as(colors), atol=1e-12)


def test_colours_do_not_depend_on_orientation_of_a_roof() -> None:
    vertices, topology = flat_grid()
    turned = Topology.from_faces([face[::-1] for face in topology.face_lists()])
    camera = camera_for(vertices)
    assert torch.allclose(shade_faces(vertices, topology, camera), shade_faces(vertices, turned, camera))


def test_front_and_back_of_a_tube_differ() -> None:
    """Where both sides are seen about equally, the orientation decides which is the front."""
    vertices, topology = cube()
    open_box = Topology.from_faces(topology.face_lists()[:-1], 8)
    for mesh, expected in ((topology, True), (open_box, True)):
        _, to_eye, main = towards_viewer(vertices, mesh, camera_for(vertices))
        facing = (torch.linalg.cross(*corner_edges(vertices, mesh)) * to_eye).sum(-1) > 0
        assert torch.equal(main, facing if expected else ~facing)


def corner_edges(vertices: torch.Tensor, topology: Topology) -> tuple[torch.Tensor, torch.Tensor]:
    corners = vertices[topology.corners.view(-1, 4)]
    return corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 1]


def test_colours_are_linear_in_the_face_colour_and_in_range() -> None:
    vertices, topology = wavy_grid()
    camera = camera_for(vertices, 30.0)
    black, grey = (shade_faces(vertices, topology, camera, torch.full((3,), c, dtype=DOUBLE)) for c in (0.0, 0.5))
    white = shade_faces(vertices, topology, camera, torch.ones(topology.num_faces, 3, dtype=DOUBLE))
    inside = white < 1
    assert torch.allclose((black + white)[inside], 2 * grey[inside])
    assert black.min() >= 0
    assert white.max() <= 1
    assert FRONT != BACK


def test_mirrored_directions_differ_by_twice_the_sine_of_the_fold() -> None:
    """|r_f - r_f'| = 2 |sin a| sin(angle between sight and edge), exactly, for a distant eye."""
    for vertices, topology in (wavy_grid(triangles=True), tetrahedron(), cube()):
        camera = camera_for(vertices)
        left, right = face_mirror_directions(vertices, topology, camera)[0][topology.interior_edge_faces].unbind(1)
        edges = torch.nn.functional.normalize(edge_vectors(vertices, topology)[: topology.num_interior_edges], dim=1)
        across = torch.linalg.vector_norm(torch.linalg.cross(edges, camera.axes[0, 2].expand_as(edges)), dim=1)
        expected = 2 * dihedral_angles(vertices, topology).sin().abs() * across
        assert torch.allclose(torch.linalg.vector_norm(left - right, dim=1), expected, atol=1e-12)


def test_mirrors_are_sign_blind_and_keep_length() -> None:
    vertices, topology = wavy_grid()
    turned = Topology.from_faces([face[::-1] for face in topology.face_lists()])
    camera = camera_for(vertices, 40.0)
    mirrored = face_mirror_directions(vertices, topology, camera)[0]
    assert torch.allclose(mirrored, face_mirror_directions(vertices, turned, camera)[0])
    assert torch.allclose(torch.linalg.vector_norm(mirrored, dim=1), torch.ones(topology.num_faces, dtype=DOUBLE))


def test_faces_without_area_have_finite_colours_and_reflect_nothing() -> None:
    vertices = torch.tensor([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0]], dtype=DOUBLE)
    topology = Topology.from_faces([[0, 1, 2], [0, 2, 3]])
    camera = camera_for(vertices)
    assert bool(torch.isfinite(shade_faces(vertices, topology, camera)).all())
    assert torch.allclose(face_mirror_directions(vertices, topology, camera)[0][0], camera.axes[0, 2])


def test_colours_of_stripes_run_from_dark_to_light() -> None:
    colors = stripe_colors(torch.tensor([0.0, 0.5, 1.0]))
    assert colors.shape == (3, 3)
    assert torch.allclose(colors[[0, 2]], torch.tensor([STRIPES_DARK, STRIPES_LIGHT]))
    assert torch.allclose(colors[1], colors[[0, 2]].mean(0))


def test_stripe_frequency_follows_spread_and_steps() -> None:
    topology = Topology.from_faces(grid_faces(101, 2))
    fine = torch.linspace(0, 0.5, topology.num_faces, dtype=DOUBLE)
    assert stripe_frequency(fine, topology, stripes=6) == pytest.approx(6 / 0.45)
    coarse = 0.45 * (torch.arange(topology.num_faces) % 2).to(DOUBLE)  # neighbours as different as can be
    assert stripe_frequency(coarse, topology) == pytest.approx(1 / 0.45)
    assert stripe_frequency(torch.zeros(topology.num_faces), topology) == 1.0
    assert stripe_frequency(torch.zeros(0), Topology.from_faces([])) == 1.0
