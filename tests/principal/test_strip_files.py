"""Strips in OBJ, SVG and DXF files, true to scale."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import pytest
import torch
from torch import Tensor

from torchfair import MeshFileError, TorchfairError, load_mesh
from torchfair.principal import (
    DevelopableStrips,
    developable_strips,
    principal_edges_of_lattice,
    save_strips_dxf,
    save_strips_obj,
    save_strips_svg,
)
from torchfair.shapes import Enneper, principal_triangles

SVG = "{http://www.w3.org/2000/svg}"
WRITERS: dict[str, Callable[..., None]] = {".obj": save_strips_obj, ".svg": save_strips_svg, ".dxf": save_strips_dxf}


@pytest.fixture(scope="module")
def strips() -> DevelopableStrips:
    mesh = principal_triangles(Enneper(), 5, 8)
    lines = principal_edges_of_lattice(mesh).polylines()
    return developable_strips(mesh.vertices, lines, mesh.normals, 0.3, depth=0.1, sheet_width=2.0)


def nothing() -> DevelopableStrips:
    points = torch.eye(3, dtype=torch.float64)
    return developable_strips(points, [], points, 0.1)


def path_points(path: ElementTree.Element, height: float) -> Tensor:
    words = path.attrib["d"].strip("MZ").split()
    points = torch.tensor([list(map(float, word.split(","))) for word in words], dtype=torch.float64)
    return torch.stack([points[:, 0], height - points[:, 1]], dim=1)


def inner_rulings(strips: DevelopableStrips) -> Tensor:
    rulings = strips.uv.view(-1, 2, 2)
    spans = [(a + 1, b - 1) for a, b in zip(strips.offsets.tolist(), strips.offsets.tolist()[1:], strict=False)]
    return torch.cat([rulings[a:b] for a, b in spans])


def test_obj_files_hold_strips_in_space_and_on_the_sheet(tmp_path: Path, strips: DevelopableStrips) -> None:
    path = tmp_path / "strips.obj"
    save_strips_obj(path, strips)
    mesh = load_mesh(path)
    assert torch.equal(mesh.vertices, strips.vertices)
    assert mesh.topology.face_lists() == strips.topology.face_lists()
    lines = path.read_text().splitlines()
    places = [list(map(float, line.split()[1:])) for line in lines if line.startswith("vt ")]
    assert torch.equal(torch.tensor(places, dtype=torch.float64), strips.uv)
    corners = [corner.split("/") for line in lines if line.startswith("f ") for corner in line.split()[1:]]
    assert all(vertex == place for vertex, place in corners)
    assert [line for line in lines if line.startswith("g ")] == [f"g strip_{name}" for name in strips.names]


@pytest.mark.parametrize("scale", [1.0, 250.0])
def test_svg_files_are_true_to_scale(tmp_path: Path, strips: DevelopableStrips, scale: float) -> None:
    path = tmp_path / "strips.svg"
    save_strips_svg(path, strips, millimetres=scale)
    root = ElementTree.parse(path).getroot()
    width, height = (float(root.attrib[key].removesuffix("mm")) for key in ("width", "height"))
    assert (width, height) == pytest.approx((scale * strips.sheet[0], scale * strips.sheet[1]))
    assert list(map(float, root.attrib["viewBox"].split())) == [0, 0, width, height]  # one unit is a millimetre
    groups = {group.attrib["id"]: group for group in root.iter(f"{SVG}g")}
    outlines = list(groups["cut"])
    assert all(outline.attrib["d"].endswith("Z") for outline in outlines)
    for outline, expected in zip(outlines, strips.outlines(), strict=True):
        assert torch.allclose(path_points(outline, height), scale * expected, atol=1e-8 * scale)
    scores = torch.stack([path_points(line, height) for line in groups["score"]])
    assert torch.allclose(scores, scale * inner_rulings(strips), atol=1e-8 * scale)
    assert [str(word.text).removesuffix(" v") for word in groups["label"]] == [f"#{name}" for name in strips.names]


def test_labels_stand_in_their_strips_and_run_along_them(tmp_path: Path, strips: DevelopableStrips) -> None:
    path = tmp_path / "strips.svg"
    save_strips_svg(path, strips)
    root = ElementTree.parse(path).getroot()
    for number, word in enumerate(root.iter(f"{SVG}text")):
        x, y, turn = map(float, re.findall(r"[-+.e\d]+", re.sub(r"[a-z]+\(", " ", word.attrib["transform"])))
        a, b = strips.offsets[number : number + 2].tolist()
        rulings = strips.uv.view(-1, 2, 2)[a:b]
        middle = (len(rulings) - 1) // 2
        quad = rulings[middle : middle + 2] if len(rulings) % 2 == 0 else rulings[middle - 1 : middle + 1]
        assert (x, strips.sheet[1] - y) == pytest.approx(tuple(quad.mean((0, 1)).tolist()), abs=1e-6)
        along = (quad[1] - quad[0]).mean(0)
        angle = torch.tensor(-turn).deg2rad()  # y points down in the file
        direction = torch.stack([angle.cos(), angle.sin()]).double()
        side = -1 if str(word.text).endswith(" v") else 1  # whether the normals point to the foot of the word
        assert torch.dot(direction, along) / along.norm() == pytest.approx(side, abs=1e-6)
        assert -90.0 - 1e-6 < -turn <= 90.0 + 1e-6  # upright


@pytest.mark.parametrize("scale", [0.1, 1.0, 4000.0])
def test_lines_follow_the_size_of_the_sheet(tmp_path: Path, strips: DevelopableStrips, scale: float) -> None:
    path = tmp_path / "strips.svg"
    save_strips_svg(path, strips, millimetres=scale)
    root = ElementTree.parse(path).getroot()
    widths = [float(group.attrib["stroke-width"]) for group in root.iter(f"{SVG}g") if "stroke" in group.attrib]
    assert widths == pytest.approx([scale * max(strips.sheet) / 1500] * 2, rel=1e-3)


def test_sheets_of_a_height_lie_above_each_other(tmp_path: Path) -> None:
    mesh = principal_triangles(Enneper(), 5, 8)
    lines = principal_edges_of_lattice(mesh).polylines()
    strips = developable_strips(mesh.vertices, lines, mesh.normals, 0.3, gap=0.1, sheet_width=2.0, sheet_height=1.1)
    assert strips.sheets > 1
    assert strips.sheet == pytest.approx((2.0, 1.1 * strips.sheets))
    for outline in strips.outlines():
        low, high = outline[:, 1].min(), outline[:, 1].max()
        number = (low / 1.1).floor()
        assert low >= 1.1 * number + 0.1 - 1e-9
        assert high <= 1.1 * (number + 1) - 0.1 + 1e-9
    save_strips_svg(tmp_path / "strips.svg", strips, millimetres=10.0)
    rims = list(ElementTree.parse(tmp_path / "strips.svg").getroot().iter(f"{SVG}rect"))
    assert len(rims) == strips.sheets
    assert [float(rim.attrib["height"]) for rim in rims] == pytest.approx([11.0] * strips.sheets)
    with pytest.raises(TorchfairError, match="sheet_height: a strip needs"):
        developable_strips(mesh.vertices, lines, mesh.normals, 0.3, gap=0.1, sheet_height=0.45)


@pytest.mark.parametrize("scale", [1.0, 250.0])
def test_dxf_files_are_true_to_scale(tmp_path: Path, strips: DevelopableStrips, scale: float) -> None:
    ezdxf = pytest.importorskip("ezdxf")
    path = tmp_path / "strips.dxf"
    save_strips_dxf(path, strips, millimetres=scale)
    document = ezdxf.readfile(path)
    assert not document.audit().errors
    assert document.units == ezdxf.units.MM
    space = document.modelspace()
    outlines = list(space.query('LWPOLYLINE[layer=="CUT"]'))
    for outline, expected in zip(outlines, strips.outlines(), strict=True):
        assert outline.closed
        points = torch.tensor(outline.get_points("xy"), dtype=torch.float64)
        assert torch.allclose(points, scale * expected, atol=1e-9 * scale)
    lines = [[tuple(end)[:2] for end in (line.dxf.start, line.dxf.end)] for line in space.query('LINE[layer=="SCORE"]')]
    scores = torch.tensor(lines, dtype=torch.float64)
    assert torch.allclose(scores, scale * inner_rulings(strips), atol=1e-9 * scale)
    words = [text.dxf.text.removesuffix(" v") for text in space.query('TEXT[layer=="LABEL"]')]
    assert words == [f"#{name}" for name in strips.names]


def test_dxf_without_its_package(tmp_path: Path, strips: DevelopableStrips, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(TorchfairError, match=r"pip install 'torchfair\[dxf\]'"):
        save_strips_dxf(tmp_path / "a.dxf", strips)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize("suffix", WRITERS)
def test_what_cannot_be_written(tmp_path: Path, strips: DevelopableStrips, suffix: str) -> None:
    write = WRITERS[suffix]
    with pytest.raises(MeshFileError, match=f"expected a file name that ends in {suffix}"):
        write(tmp_path / "strips.txt", strips)
    with pytest.raises(TorchfairError, match="there are no strips to"):
        write(tmp_path / f"none{suffix}", nothing())
    if suffix != ".obj":
        with pytest.raises(TorchfairError, match="millimetres: expected a positive number, got 0"):
            write(tmp_path / f"none{suffix}", strips, millimetres=0)
    assert not list(tmp_path.iterdir())
    if suffix == ".dxf":
        pytest.importorskip("ezdxf")
    path = tmp_path / f"strips{suffix}"
    path.write_text("old")
    with pytest.raises(MeshFileError, match="exists already"):
        write(path, strips)
    write(path, strips, overwrite=True)
    assert path.read_text() != "old"


@pytest.mark.parametrize("suffix", WRITERS)
def test_extensions_may_be_in_capitals(tmp_path: Path, strips: DevelopableStrips, suffix: str) -> None:
    if suffix == ".dxf":
        pytest.importorskip("ezdxf")
    path = tmp_path / f"STRIPS{suffix.upper()}"
    WRITERS[suffix](path, strips)
    assert path.stat().st_size > 0
