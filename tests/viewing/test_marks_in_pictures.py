"""Numbers of vertices, rings at crossings, rims without gaps, close-ups."""

from __future__ import annotations

from pathlib import Path

import torch
from helpers import cube, wavy_grid
from star_tools import random_arms, stars_of

from torchfair._names import Names
from torchfair.shapes import icosphere
from torchfair.stars import normal_pyramid, pyramid_self_intersections
from torchfair.viewing import EdgeStyle, MeshView, chosen_view, fit_camera, picture_edges, picture_labels
from torchfair.viewing.captions import four_digits
from torchfair.viewing.close_up import part_around, worst_place
from torchfair.viewing.picture_edges import _comparable
from torchfair.viewing.picture_labels import _chosen, _seen
from torchfair.viewing.picture_pyramids import arc_crossings
from torchfair.viewing.sheet import Sheet


def view_of(vertices: torch.Tensor, topology: object) -> MeshView:
    towards_eye, up = chosen_view(vertices, topology, "z", (30.0, 20.0))  # type: ignore[arg-type]
    camera, size = fit_camera(vertices, towards_eye=towards_eye, up=up, width=200)
    return MeshView(vertices, topology, camera, size)  # type: ignore[arg-type]


def test_numbers_stand_at_vertices_that_are_seen() -> None:
    """Of a cube seven corners are seen from outside, all but the one farthest away."""
    vertices, topology = cube()
    view = view_of(vertices, topology)
    numbers = torch.arange(8)
    seen = _seen(view, numbers)
    farthest = int((vertices @ chosen_view(vertices, topology, "z", (30.0, 20.0)).towards_eye).argmin())
    assert (~seen).nonzero().flatten().tolist() == [farthest]


def test_small_meshes_have_all_numbers_and_large_ones_those_of_the_worst() -> None:
    assert len(_chosen(*cube())) == 8
    mesh = wavy_grid(20, 20)
    assert len(_chosen(*mesh)) <= 40


def test_labels_lie_over_pictures(tmp_path: Path) -> None:
    sheet = Sheet(120, 60)
    sheet.image(torch.zeros(60, 120, 3), 0, 0)
    assert sheet.pixels().max() == 0
    sheet.label("17", 60, 30)
    pixels = sheet.pixels()
    assert pixels.max() > 150
    assert pixels[:5].max() == 0
    mesh = cube()
    size = picture_labels(tmp_path / "labels.png", *mesh, names=Names(1))
    assert size[0] == 1600


def test_rings_are_where_pyramids_cross_themselves() -> None:
    vertices, topology = stars_of(random_arms(60, 6, 1, height=0.3, saddle=0.3))
    crossings = pyramid_self_intersections(vertices, topology)
    inner = (~topology.is_boundary_vertex).nonzero().flatten().tolist()
    found = [len(arc_crossings(normal_pyramid(vertices, topology, vertex))) for vertex in inner]
    assert found == crossings[inner].tolist()
    assert max(found) > 1


def test_the_rim_of_a_mesh_has_no_gap() -> None:
    """Every sample of the mesh beside the background is inked."""
    mesh = icosphere(2)
    view = view_of(mesh.vertices, mesh.topology)
    white = torch.ones(mesh.topology.num_faces, 3)
    style = EdgeStyle(torch.zeros(3), widths=0.0, rim=1.0)
    picture = view.paint(white, edges=style, background=(1.0, 1.0, 1.0))[..., 0]
    samples = view.face_index.view(view.height, 3, view.width, 3).ge(0)
    covered, nothing = samples.all(3).all(1), ~samples.any(3).any(1)
    empty = torch.nn.functional.max_pool2d(nothing.float()[None, None], 3, stride=1, padding=1)[0, 0] > 0
    assert int((covered & empty).sum()) > 50
    assert float(picture[covered & empty].max()) < 0.01
    assert float(picture[view.height // 2, view.width // 2]) == 1.0


def test_four_digits_end_in_no_point() -> None:
    assert [four_digits(x) for x in (1285.0, 12.5, 0.1, 99999.0)] == ["1285", "12.50", "0.1000", "1.000e+05"]


def test_a_close_up_shows_what_surrounds_the_worst_edge() -> None:
    vertices, topology = wavy_grid(30, 30)
    vertices[:, 2] = 0.0
    vertices[15 * 30 + 15, 2] = 3.0
    place = worst_place(vertices, topology)
    assert place is not None
    assert float((place.middle - vertices[15 * 30 + 15]).norm()) < 2.0
    part = part_around(vertices, topology, place)
    assert part is not None
    assert 10 < part.topology.num_faces < 100
    assert part_around(*cube(), worst_place(*cube())) is None  # type: ignore[arg-type]
    vertices[:, 2] = 0.0
    assert worst_place(vertices, topology) is None


def test_edges_of_fine_and_coarse_meshes_share_a_scale(tmp_path: Path) -> None:
    """On spheres of two and three subdivisions l |a| differs fourfold, over the squared mean edge hardly."""
    meshes = [icosphere(2), icosphere(3)]
    from torchfair.energies import angle_variation_per_edge

    values = [angle_variation_per_edge(mesh.vertices, mesh.topology) for mesh in meshes]
    vertices, topologies = [mesh.vertices for mesh in meshes], [mesh.topology for mesh in meshes]
    label, scaled = _comparable(values, vertices, topologies)
    assert "bar" in label
    assert float(values[0].mean() / values[1].mean()) > 3.5
    assert 0.9 < float(scaled[0].mean() / scaled[1].mean()) < 1.1
    assert "bar" not in _comparable(values[:1] * 2, vertices[:1] * 2, topologies[:1] * 2)[0]
    picture_edges(tmp_path / "e.png", {"a": vertices[0], "b": vertices[1]}, topologies)
