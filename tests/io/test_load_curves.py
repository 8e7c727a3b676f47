"""Closed curves in files as they come: repeated points, open arcs, drawings in pieces."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import torch

from torchfair.curves import ClosedCurve
from torchfair.errors import MeshFileError
from torchfair.io import load_curve, load_curves

SQUARE = [(0.0, 0.0, 0.0), (2.0, 0.0, 0.5), (2.0, 2.0, 0.0), (0.0, 2.0, 0.5)]


def write(path: Path, rows: list[tuple[float, ...]]) -> Path:
    path.write_text("\n".join(" ".join(map(repr, row)) for row in rows) + "\n")
    return path


def ring(count: int, turn: float = 1.0) -> list[tuple[float, float, float]]:
    angles = [turn * math.tau * i / count for i in range(count)]
    return [(math.cos(a), math.sin(a), 0.0) for a in angles]


def same_loop(points: torch.Tensor, expected: list[tuple[float, ...]]) -> bool:
    """Whether points are those of a loop, from any of them on and either way round."""
    wanted = torch.tensor(expected, dtype=torch.float64)
    if points.shape != wanted.shape:
        return False
    turned = [way.roll(k, 0) for way in (points, points.flip(0)) for k in range(len(points))]
    return any(torch.allclose(one, wanted, atol=1e-9) for one in turned)


@pytest.mark.parametrize("last", [(0.0, 0.0, 0.0), (0.0, 1e-9, 0.0)])
def test_a_last_point_that_is_the_first_is_left_out(last: tuple[float, float, float], tmp_path: Path) -> None:
    curve = load_curve(write(tmp_path / "x.xyz", [*SQUARE, last]))
    assert curve.points.tolist() == [list(row) for row in SQUARE]
    assert [("1e-09 from the first" in note) for note in curve.notes] == [True] * (last[1] != 0.0)


def test_repeated_points_are_left_out_with_a_note(tmp_path: Path) -> None:
    rows = [SQUARE[0], SQUARE[0], SQUARE[1], SQUARE[2], SQUARE[2], SQUARE[2], SQUARE[3]]
    curve = load_curve(write(tmp_path / "x.xyz", rows))
    assert curve.points.tolist() == [list(row) for row in SQUARE]
    (note,) = curve.notes
    assert "3 point(s) repeat" in note
    assert ": 1, 4, 5 (from 0)" in note
    assert load_curve(write(tmp_path / "y.xyz", SQUARE)).notes == ()


def test_normals_of_repeated_points_go_with_them(tmp_path: Path) -> None:
    rows = [(*place, 0.0, 0.0, float(i)) for i, place in enumerate([SQUARE[0], SQUARE[0], *SQUARE[1:]])]
    curve = load_curve(write(tmp_path / "x.xyz", rows))
    assert curve.normals is not None
    assert curve.normals[:, 2].tolist() == [0.0, 2.0, 3.0, 4.0]


def test_open_arcs_are_closed_only_on_request(tmp_path: Path) -> None:
    arc = write(tmp_path / "arc.xyz", ring(40, 0.5))
    with pytest.raises(MeshFileError, match=r"open arc, whose ends are 1\.9.* --close"):
        load_curve(arc)
    curve = load_curve(arc, close=True)
    assert len(curve.points) == 40
    assert "closed by a straight line" in curve.notes[0]
    assert len(load_curve(write(tmp_path / "ring.xyz", ring(40))).points) == 40  # a step is missing, no more


def test_two_different_points_are_no_curve(tmp_path: Path) -> None:
    with pytest.raises(MeshFileError, match="three different points, found 2"):
        load_curve(write(tmp_path / "x.xyz", [SQUARE[0], SQUARE[1], SQUARE[1], SQUARE[0]]))


def test_text_holds_one_curve(tmp_path: Path) -> None:
    (curve,) = load_curves(write(tmp_path / "x.txt", SQUARE))
    assert curve.points.tolist() == [list(row) for row in SQUARE]


def test_line_elements_of_obj_files_are_joined(tmp_path: Path) -> None:
    vertices = "".join(f"v {x} {y} {z}\n" for x, y, z in [*SQUARE, *((x + 5, y, z) for x, y, z in SQUARE)])
    path = tmp_path / "x.obj"
    path.write_text(f"{vertices}l 1 2\nl 3 2\nl 3 4 1\nl 5 6 7 8 5\n")
    first, second = load_curves(path)
    assert same_loop(first.points, SQUARE)
    assert same_loop(second.points, [(x + 5, y, z) for x, y, z in SQUARE])
    path.write_text(f"{vertices}l 1 2 3\n")
    with pytest.raises(MeshFileError, match="open arc"):
        load_curves(path)
    (closed,) = load_curves(path, close=True)
    assert len(closed.points) == 3
    path.write_text(f"{vertices}l 1 2 99\n")
    with pytest.raises(MeshFileError, match="does not exist"):
        load_curves(path)
    path.write_text(vertices)
    with pytest.raises(MeshFileError, match="no line elements"):
        load_curves(path)
    path.write_text("v 0 0 0\nv 1 0 0\nl 1 2 3 1\nv 0 1\n")
    with pytest.raises(MeshFileError, match=r"line 4.*needs three coordinates"):
        load_curves(path)


def test_drawings_in_dxf_are_joined(tmp_path: Path) -> None:
    ezdxf = pytest.importorskip("ezdxf")
    document = ezdxf.new()
    space = document.modelspace()
    space.add_line(SQUARE[0], SQUARE[1])
    space.add_polyline3d([SQUARE[3], SQUARE[2], SQUARE[1]])
    space.add_line(SQUARE[0], SQUARE[3])
    space.add_circle((10, 0, 1), 2.0)
    space.add_lwpolyline([(20, 0), (22, 0), (22, 2)], close=True)
    space.add_text("not a curve")
    document.saveas(tmp_path / "x.dxf")
    curves = load_curves(tmp_path / "x.dxf")
    assert len(curves) == 3
    assert any(same_loop(curve.points, SQUARE) for curve in curves)
    assert any(same_loop(curve.points, [(20, 0, 0), (22, 0, 0), (22, 2, 0)]) for curve in curves)
    (circle,) = (curve for curve in curves if len(curve.points) > 10)
    radii = (circle.points - torch.tensor([10.0, 0.0, 1.0], dtype=torch.float64)).norm(dim=1)
    assert float((radii - 2.0).abs().max()) < 1e-9


def test_files_that_are_no_drawings_are_named(tmp_path: Path) -> None:
    pytest.importorskip("ezdxf")
    (tmp_path / "x.dxf").write_text("nothing of the kind")
    with pytest.raises(MeshFileError, match=r"x\.dxf"):
        load_curves(tmp_path / "x.dxf")


def test_curves_of_3dm_files(tmp_path: Path) -> None:
    rhino = pytest.importorskip("rhino3dm")
    model = rhino.File3dm()
    line = rhino.Polyline(0)
    for x, y, z in [*SQUARE, SQUARE[0]]:
        line.Add(x, y, z)
    model.Objects.AddPolyline(line)
    model.Objects.AddCircle(rhino.Circle(rhino.Point3d(5.0, 0.0, 0.0), 2.0))
    model.Write(str(tmp_path / "x.3dm"), 7)
    square, circle = sorted(load_curves(tmp_path / "x.3dm"), key=lambda curve: len(curve.points))
    assert same_loop(square.points, SQUARE)
    radii = (circle.points - torch.tensor([5.0, 0.0, 0.0], dtype=torch.float64)).norm(dim=1)
    assert float((radii - 2.0).abs().max()) < 1e-6


def test_3dm_files_are_read_in_double_precision_with_corners_between_segments(tmp_path: Path) -> None:
    rhino = pytest.importorskip("rhino3dm")
    third = 1.0 / 3.0
    exact = [(third, 0.1, -1e-9), (1.0, 0.1, 0.7), (1.0, 1.0 + 2.0**-50, 0.0), (1e6 + third, 2.0, 3.0)]
    model = rhino.File3dm()
    line = rhino.Polyline(0)
    for x, y, z in [*exact, exact[0]]:
        line.Add(x, y, z)
    model.Objects.AddPolyline(line)
    model.Write(str(tmp_path / "x.3dm"), 7)
    (curve,) = load_curves(tmp_path / "x.3dm")
    assert curve.points.tolist() == [list(row) for row in exact]

    half_disk = rhino.PolyCurve()  # a line and a half circle, joined in Rhino
    left, top, right = (rhino.Point3d(*row) for row in [(-third, 0.0, 0.0), (0.0, third, 0.0), (third, 0.0, 0.0)])
    half_disk.Append(rhino.Line(left, right))
    half_disk.Append(rhino.Arc(right, top, left))
    model = rhino.File3dm()
    model.Objects.AddCurve(half_disk)
    model.Write(str(tmp_path / "y.3dm"), 7)
    (curve,) = load_curves(tmp_path / "y.3dm")
    rim = ClosedCurve(curve.points)
    corners = rim.at(rim.corners)
    assert sorted(corners[:, 0].tolist()) == pytest.approx([-third, third], abs=1e-12)
    assert float(corners[:, 1:].abs().max()) < 1e-12
    assert rim.length == pytest.approx(third * (2.0 + math.pi), rel=1e-4)
