"""Contact sheets of reflections and the turntable, on meshes of every kind."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from geometry_meshes import torus
from helpers import DOUBLE, cube
from PIL import Image

from torchfair import MeshFileError, ShapeError, Topology, TorchfairError
from torchfair.reflection import SmoothReference, reflection_score
from torchfair.shapes import Sphere
from torchfair.viewing import picture_reflection_differences, picture_reflections, turntable
from torchfair.viewing.picture_reflections import mirror_colors
from torchfair.viewing.shading import stripe_colors

SMALL = {"size": 48, "supersampling": 1}
NOTHING = (torch.zeros(0, 3), Topology.from_faces([]))


@pytest.mark.parametrize("mesh", [cube(), torus(8, 6), NOTHING], ids=["cube", "torus", "nothing"])
@pytest.mark.parametrize("picture", [picture_reflections, picture_reflection_differences])
def test_sheets_have_the_size_they_say_and_are_not_replaced(mesh, picture, tmp_path: Path):
    score = reflection_score(*mesh, **SMALL)
    path = tmp_path / "sheet.png"
    size = picture(path, score, "a $title")
    with Image.open(path) as image:
        assert image.size == size
    with pytest.raises(MeshFileError, match="exists"):
        picture(path, score)
    assert picture(path, score, overwrite=True)[1] < size[1]


def test_differences_are_white_where_pictures_agree(tmp_path: Path):
    vertices, topology = cube()
    flat = SmoothReference(vertices, topology, torch.zeros_like(vertices))  # looks straight through
    score = reflection_score(vertices, topology, flat, frequency=2.0, **SMALL)
    picture_reflection_differences(tmp_path / "red.png", score)
    with Image.open(tmp_path / "red.png") as image:
        colors = {color for _, color in image.convert("RGB").getcolors(1 << 24)}
    assert any(r > 150 and g < 60 for r, g, _ in colors)


def test_colors_of_whole_and_of_empty_pixels():
    values = torch.tensor([[0.0, 1.0, 0.4]], dtype=DOUBLE)
    covered = torch.ones_like(values)
    torch.testing.assert_close(mirror_colors(values, covered), stripe_colors(values))
    assert (mirror_colors(torch.zeros_like(values), torch.zeros_like(values)) == 1).all()
    half = mirror_colors(values / 2, covered / 2)
    torch.testing.assert_close(half, (stripe_colors(values) + 1) / 2)


@pytest.mark.parametrize("mesh", [cube(), NOTHING], ids=["cube", "nothing"])
def test_turntable_turns_and_reports_frames(mesh, tmp_path: Path):
    done: list[int] = []
    path = tmp_path / "film.gif"
    turntable(path, *mesh, frames=4, size=40, progress=done.append)
    assert done == [1, 2, 3, 4]
    with Image.open(path) as film:
        assert film.size == (80, 40)
        assert film.info["loop"] == 0
    with pytest.raises(MeshFileError, match="exists"):
        turntable(path, *mesh, frames=1, size=40)


def test_turntable_shows_a_reference_beside_the_mesh(tmp_path: Path):
    vertices, topology = cube()
    reference = SmoothReference.of_surface(Sphere(0.9), 24)
    turntable(tmp_path / "film.gif", vertices - 0.5, topology, reference, frames=1, size=60)
    with Image.open(tmp_path / "film.gif") as film:
        left, right = (film.convert("L").crop((x, 0, x + 60, 60)) for x in (0, 60))
    painted = [sum(value < 250 for value in half.tobytes()) for half in (left, right)]
    assert painted[0] < painted[1]  # the ball is larger


def test_wrong_arguments_are_named(tmp_path: Path):
    vertices, topology = cube()
    with pytest.raises(ShapeError, match="count"):
        turntable(tmp_path / "film.gif", vertices, topology, frames=0)
    with pytest.raises(TorchfairError, match="not finite"):
        turntable(tmp_path / "film.gif", vertices * torch.nan, topology)
    with pytest.raises(ShapeError, match="one mesh"):
        turntable(tmp_path / "film.gif", vertices[None], topology)
    assert not list(tmp_path.iterdir())
