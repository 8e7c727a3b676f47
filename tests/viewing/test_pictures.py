from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from helpers import DOUBLE, cube, grid_faces, tetrahedron, wavy_grid
from PIL import Image

from torchfair import MeshFileError, ShapeError, Topology
from torchfair.subdivision import hybrid
from torchfair.viewing import (
    picture_before_after,
    picture_curvature,
    picture_edges,
    picture_gauss_images,
    picture_mesh,
    view_direction,
)
from torchfair.viewing.color_scale import BAR, ColorScale
from torchfair.viewing.sheet import MARGIN, Sheet

Mesh = tuple[torch.Tensor, Topology]
Picture = Callable[..., tuple[int, int]]


def mesh_picture(path: Path, vertices: torch.Tensor, topology: Topology, **options: object) -> tuple[int, int]:
    return picture_mesh(path, vertices, topology, width=240, **options)


def before_after(path: Path, vertices: torch.Tensor, topology: Topology, **options: object) -> tuple[int, int]:
    return picture_before_after(path, vertices, 1.1 * vertices, topology, width=400, **options)


def edges_picture(path: Path, vertices: torch.Tensor, topology: Topology, **options: object) -> tuple[int, int]:
    return picture_edges(path, {"one": vertices, "two": 1.1 * vertices}, topology, width=500, **options)


def gauss_picture(path: Path, vertices: torch.Tensor, topology: Topology, **options: object) -> tuple[int, int]:
    return picture_gauss_images(path, vertices, 1.1 * vertices, topology, width=400, **options)


def curvature_picture(path: Path, vertices: torch.Tensor, topology: Topology, **options: object) -> tuple[int, int]:
    meshes = [("one", vertices, topology), ("two", 1.1 * vertices, topology)]
    return picture_curvature(path, meshes, width=500, **options)


PICTURES = [mesh_picture, before_after, edges_picture, gauss_picture, curvature_picture]
MESHES = {
    "quads": wavy_grid(),
    "float32": (wavy_grid(triangles=True)[0].float(), wavy_grid(triangles=True)[1]),
    "closed": cube(),
    "flat": (wavy_grid(3, 3)[0] * torch.tensor([1.0, 1, 0], dtype=DOUBLE), Topology.from_faces(grid_faces(3, 3))),
    "one face": (torch.eye(3, dtype=DOUBLE), Topology.from_faces([[0, 1, 2]])),
    "point": (torch.zeros(4, 3), tetrahedron()[1]),
    "no faces": (torch.eye(3), Topology.from_faces([], 3)),
    "strip": (torch.tensor([[0.0, 0, 0], [50, 0, 0], [50, 1, 0], [0, 1, 0]]), Topology.from_faces([[0, 1, 2, 3]])),
    "empty": (torch.zeros(0, 3), Topology.from_faces([])),
}


def pixels(path: Path) -> np.ndarray:
    with Image.open(path) as image:
        image.load()
        assert image.format == "PNG"
        assert image.mode == "RGB"
        return np.asarray(image)


@pytest.mark.parametrize("picture", PICTURES)
@pytest.mark.parametrize("name", MESHES)
def test_every_mesh_gives_a_png_of_the_size_returned(picture: Picture, name: str, tmp_path: Path) -> None:
    size = picture(tmp_path / "picture.png", *MESHES[name])
    image = pixels(tmp_path / "picture.png")
    assert (image.shape[1], image.shape[0]) == size
    assert [file.name for file in tmp_path.iterdir()] == ["picture.png"]


@pytest.mark.parametrize("picture", PICTURES)
def test_existing_files_are_kept_unless_overwriting_is_asked_for(picture: Picture, tmp_path: Path) -> None:
    path = tmp_path / "picture.png"
    path.write_bytes(b"precious")
    with pytest.raises(MeshFileError, match="exists"):
        picture(path, *wavy_grid())
    assert path.read_bytes() == b"precious"
    picture(path, *wavy_grid(), overwrite=True)
    assert pixels(path).ndim == 3


@pytest.mark.parametrize("picture", PICTURES)
def test_batches_and_foreign_vertices_are_refused(picture: Picture, tmp_path: Path) -> None:
    vertices, topology = wavy_grid()
    for wrong in (vertices[None], vertices[:-1]):
        with pytest.raises(ShapeError, match="vertices"):
            picture(tmp_path / "picture.png", wrong, topology)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("picture", PICTURES)
def test_a_title_is_put_above_the_same_picture(picture: Picture, tmp_path: Path) -> None:
    plain = picture(tmp_path / "plain.png", *wavy_grid())
    titled = picture(tmp_path / "titled.png", *wavy_grid(), title="Roof")
    extra = titled[1] - plain[1]
    assert extra > 20
    assert np.array_equal(pixels(tmp_path / "titled.png")[extra:], pixels(tmp_path / "plain.png"))
    assert (pixels(tmp_path / "titled.png")[:extra] < 128).any()


@pytest.mark.parametrize("words", ["$x", "a $\\frac$ b", "\\$", "\u5c4b\u6839", "long " * 60])
def test_titles_and_names_are_taken_literally(words: str, tmp_path: Path) -> None:
    """Dollar signs, backslashes, letters that the font lacks, and no end of words."""
    picture_edges(tmp_path / "picture.png", {words: cube()[0]}, cube()[1], words, width=400)
    image = pixels(tmp_path / "picture.png")
    assert (image[:56, 20:-20] < 200).any()
    assert (image[:56, [0, -1]] == 255).all()


@pytest.mark.parametrize("picture", PICTURES)
def test_pictures_are_reproducible(picture: Picture, tmp_path: Path) -> None:
    picture(tmp_path / "first.png", *wavy_grid())
    picture(tmp_path / "second.png", *wavy_grid())
    assert (tmp_path / "first.png").read_bytes() == (tmp_path / "second.png").read_bytes()


def test_equal_meshes_give_equal_halves(tmp_path: Path) -> None:
    """The two panels of each row differ by a shift alone: one camera, one light, one striped surrounding."""
    vertices, topology = wavy_grid()
    picture_before_after(tmp_path / "picture.png", vertices, vertices, topology, width=400)
    image = pixels(tmp_path / "picture.png")
    panel = (400 - 2 * 36 - 32) // 2
    rows = image.shape[0] - 36 - 52
    first, second = image[52:rows, 36 : 36 + panel], image[52:rows, 68 + panel : 68 + 2 * panel]
    row = (image.shape[0] - 36) // 2  # each row of pictures has its line of captions above
    keep = np.r_[0 : row - 52, row : rows - 52]
    assert np.array_equal(first[keep], second[keep])
    assert len(np.unique(first[keep].reshape(-1, 3), axis=0)) > 20


def test_flat_faces_have_the_colour_asked_for(tmp_path: Path) -> None:
    """Vertex colours are drawn unshaded, so a uniform colour fills the mesh exactly."""
    vertices, topology = wavy_grid()
    color = torch.tensor([0.2, 0.4, 0.6])
    colors = color.expand(topology.num_vertices, 3)
    picture_mesh(tmp_path / "picture.png", vertices, topology, vertex_colors=colors, width=300)
    image = pixels(tmp_path / "picture.png").reshape(-1, 3)
    exact = (image == [51, 102, 153]).all(1)
    assert exact.mean() > 0.2
    assert (exact | (image == 255).all(1)).mean() > 0.95


def test_view_can_be_chosen(tmp_path: Path) -> None:
    vertices, topology = wavy_grid()
    direction = view_direction(vertices, topology)
    picture_mesh(tmp_path / "default.png", vertices, topology, width=300)
    picture_mesh(tmp_path / "same.png", vertices, topology, view=direction, width=300)
    other = direction._replace(towards_eye=-direction.towards_eye)
    picture_mesh(tmp_path / "below.png", vertices, topology, view=other, height=300, width=500)
    assert (tmp_path / "default.png").read_bytes() == (tmp_path / "same.png").read_bytes()
    assert pixels(tmp_path / "below.png").shape == (300, 500, 3)


def test_edge_colours_run_from_light_to_dark_and_stop_at_the_end() -> None:
    scale = ColorScale("", 1.0, False, "magma_r", 0.04)
    colors = scale.colors(torch.linspace(0, 1, 50))
    luminance = colors @ torch.tensor([0.2126, 0.7152, 0.0722])
    assert bool((luminance.diff() < 0).all())
    assert torch.equal(scale.colors(torch.tensor([1.0, 7.0, torch.inf])), colors[-1:].expand(3, 3))


def test_meshes_of_different_connectivity_share_a_picture(tmp_path: Path) -> None:
    meshes = {"quads": wavy_grid(), "triangles": wavy_grid(triangles=True), "finer": wavy_grid(9, 8)}
    vertices = {name: mesh[0] for name, mesh in meshes.items()}
    topologies = [mesh[1] for mesh in meshes.values()]
    one_row = picture_edges(tmp_path / "row.png", vertices, topologies, columns=3, width=900)
    two_rows = picture_edges(tmp_path / "rows.png", vertices, topologies, columns=2, width=900)
    assert two_rows[1] > 1.5 * one_row[1]
    for wrong in ({}, dict(list(vertices.items())[:2])):
        with pytest.raises(ShapeError, match="meshes"):
            picture_edges(tmp_path / "wrong.png", wrong, topologies)


def test_drawing_libraries_are_imported_late_and_without_global_state() -> None:
    script = """
import sys, tempfile, torch
import torchfair.viewing as viewing
assert not {"matplotlib", "PIL"} & set(sys.modules)
from torchfair import Topology
with tempfile.TemporaryDirectory() as folder:
    viewing.picture_edges(folder + "/x.png", {"a": torch.eye(3)}, Topology.from_faces([[0, 1, 2]]), width=400)
assert "matplotlib" in sys.modules
assert "matplotlib.pyplot" not in sys.modules
"""
    subprocess.run([sys.executable, "-c", script], check=True)


def test_before_and_after_may_have_different_topologies(tmp_path: Path) -> None:
    """As a mesh and its refinement have."""
    vertices, topology = cube()
    step = hybrid(topology)
    both = (topology, step.topology)
    for number, picture in enumerate((picture_before_after, picture_gauss_images)):
        path = tmp_path / f"{number}.png"
        assert min(picture(path, vertices, step.apply(vertices), both, width=400)) > 100
        with pytest.raises(ShapeError, match="topology"):
            picture(tmp_path / "none.png", vertices, vertices, [topology], width=400)
    picture_before_after(tmp_path / "same.png", vertices, vertices, (topology, topology), width=400)
    picture_before_after(tmp_path / "one.png", vertices, vertices, topology, width=400)
    assert (tmp_path / "same.png").read_bytes() == (tmp_path / "one.png").read_bytes()


@pytest.mark.parametrize("label", [r"$\ell\,|\alpha|$", r"$|\kappa_1| + |\kappa_2|$", "planarity of the panels"])
def test_the_title_of_a_bar_stays_beside_the_pictures(label: str) -> None:
    sheet = Sheet(800, 600)
    ColorScale.of(torch.rand(50), label, color_map="Blues").draw_bar(sheet, 560)
    pixels = sheet.pixels()
    inked = np.flatnonzero((pixels < 200).any(2).any(0))
    assert inked.min() >= 800 - MARGIN - BAR
    assert inked.max() < 800
    assert inked.min() < 800 - MARGIN - BAR + 44 + 13, "it has a title"


def test_long_captions_fit_beside_each_other() -> None:
    sheet = Sheet(900, 200)
    for column, words in enumerate(
        ["short", "a caption that is much too long for a third of the page, $C$ = 8.07", "W" * 60]
    ):
        sheet.caption(words, 300 * column, 0, 300)
    ends = [text.get_window_extent() for text in sheet.figure.texts]
    for column, end in enumerate(ends):
        assert end.x0 >= 300 * column - 1
        assert end.x1 <= 300 * (column + 1) + 1
    assert sheet.figure.texts[0].get_fontsize() > 1.2 * sheet.figure.texts[1].get_fontsize()
