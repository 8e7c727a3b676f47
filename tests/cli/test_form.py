"""``torchfair form``: from a mesh, from curves alone, refusals, what is written."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
from helpers import report_in, wavy_grid

from torchfair.cli import main
from torchfair.io import load_mesh, save_mesh

QUIET = ["--iterations", "2", "--no-pictures", "--starts", "1"]
FEW = ["--vertices", "60"]


def circle_rows(height: float, *, normals: bool = False) -> str:
    angles = [2 * math.pi * i / 24 for i in range(24)]
    rows = []
    for angle in angles:
        place = f"{math.cos(angle)!r} {math.sin(angle)!r} {height}"
        rows.append(f"{place} {math.cos(angle)!r} {math.sin(angle)!r} 0" if normals else place)
    return "# a circle\nx y z\n" + "\n".join(rows) + "\n"


@pytest.fixture
def circle(tmp_path: Path) -> str:
    (tmp_path / "circle.xyz").write_text(circle_rows(0.0))
    return str(tmp_path / "circle.xyz")


def error_line(capsys: pytest.CaptureFixture[str]) -> str:
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("torchfair form: error: ")
    return err


def test_curves_alone_give_a_disk_or_an_annulus(circle: str, tmp_path: Path) -> None:
    assert main(["form", "--curve", circle, "-o", str(tmp_path / "disk.obj"), *FEW, *QUIET]) == 0
    disk = load_mesh(tmp_path / "disk.obj")
    assert len(disk.topology.boundary_loops()) == 1
    (tmp_path / "top.csv").write_text(circle_rows(1.0).replace(" ", ","))
    words = ["--curve", circle, "--curve", str(tmp_path / "top.csv"), "-o", str(tmp_path / "annulus.obj")]
    assert main(["form", *words, *FEW, *QUIET, "--results", str(tmp_path / "other")]) == 0
    annulus = load_mesh(tmp_path / "annulus.obj")
    assert len(annulus.topology.boundary_loops()) == 2
    assert float((annulus.vertices[:, :2].norm(dim=1) - 1.0).abs().max()) < 0.03


def test_mesh_report_and_pictures_are_written(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vertices, topology = wavy_grid(7, 6, triangles=True)
    save_mesh(tmp_path / "start.obj", vertices, topology)
    output = tmp_path / "formed" / "surface.ply"
    words = [str(tmp_path / "start.obj"), "-o", str(output), "--levels", "1", "--iterations", "4"]
    assert main(["form", *words]) == 0
    out, err = capsys.readouterr()
    report = report_in(output.parent)
    after = load_mesh(output)
    assert after.topology.num_faces == 4 * topology.num_faces
    energies = report["energies"]
    assert energies["after"]["total_absolute_curvature"] < energies["before"]["total_absolute_curvature"]
    assert len(report["levels"]) == 2
    assert all(level["runs"] for level in report["levels"])
    assert report["levels"][0]["runs"][0]["history"][0]["total_absolute_curvature"] > 0
    assert report["steps"] == sum(run["steps"] for level in report["levels"] for run in level["runs"])
    assert report["settings"]["boundary"] == "fixed"
    for name in (f"{output.stem}.curvature.png", f"{output.stem}.edges.png"):
        assert (output.parent / name).read_bytes().startswith(b"\x89PNG")
        assert name in out
    assert "C " in err


@pytest.mark.slow
def test_normals_in_a_curve_file_prescribe_tangent_planes(tmp_path: Path) -> None:
    words = []
    for name, height in (("bottom", 0.0), ("top", 1.0)):
        (tmp_path / f"{name}.xyz").write_text(circle_rows(height, normals=True))
        words += ["--curve", str(tmp_path / f"{name}.xyz")]
    assert main(["form", *words, "-o", str(tmp_path / "x.obj"), "--vertices", "200", "--no-pictures"]) == 0
    report = report_in(tmp_path)
    assert 0 < report["energies"]["after"]["largest_tilt_degrees"] < 0.5


def test_points_are_passed_through(circle: str, tmp_path: Path) -> None:
    words = ["--curve", circle, "-o", str(tmp_path / "x.obj"), "--through", "0.1", "0", "0.4", "--vertices", "100"]
    assert main(["form", *words, "--no-pictures"]) == 0
    mesh = load_mesh(tmp_path / "x.obj")
    assert float(mesh.vertices[:, 2].max()) == pytest.approx(0.4, abs=0.02)


REFUSED = {
    "nothing to start from": ([], "--curve"),
    "missing mesh": (["none.obj"], "none.obj"),
    "missing curve": (["--curve", "none.xyz"], "none.xyz"),
    "same curve twice": (["--curve", "CIRCLE"] * 2, "the same"),
    "two numbers": (["--curve", "TWO"], "line 2"),
    "no numbers": (["--curve", "WORDS"], "line"),
    "bad boundary": (["--curve", "CIRCLE", "--boundary", "loose"], "loose"),
    "smoothing": (["--curve", "CIRCLE", "--smoothing", "0"], "smoothing"),
    "handle": (["--curve", "CIRCLE", "--handle", "9999", "0", "0", "0"], "9999"),
    "twice the same vertex": (["--curve", "CIRCLE", *["--through", "0", "0", "1"] * 2], "same vertex"),
    "unknown option": (["--curve", "CIRCLE", "--smooth"], "--smooth"),
}


@pytest.mark.parametrize("name", REFUSED)
def test_bad_requests_end_with_one_line_and_write_nothing(
    name: str, circle: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "work"
    folder.mkdir()
    monkeypatch.chdir(folder)
    (tmp_path / "two.xyz").write_text("0 0 0\n1 1\n2 2 2\n")
    (tmp_path / "words.xyz").write_text("x y z\na b c\n")
    files = {"CIRCLE": circle, "TWO": str(tmp_path / "two.xyz"), "WORDS": str(tmp_path / "words.xyz")}
    words, message = REFUSED[name]
    assert main(["form", *(files.get(word, word) for word in words), "-o", "x.obj", *FEW, *QUIET]) == 2
    assert message in error_line(capsys)
    assert list(folder.iterdir()) == []


def test_existing_files_are_kept(circle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "out.obj"
    output.write_text("precious")
    assert main(["form", "--curve", circle, "-o", str(output), *FEW, *QUIET]) == 2
    assert "--force" in error_line(capsys)
    assert output.read_text() == "precious"
    assert main(["form", "--curve", circle, "-o", str(output), "--force", *FEW, *QUIET]) == 0
    assert load_mesh(output).topology.num_faces > 0


def notes_of(folder: Path) -> list[str]:
    return list(report_in(folder)["notes"])


def test_curves_alone_are_tried_from_several_starts(circle: str, tmp_path: Path) -> None:
    words = ["form", "--curve", circle, *FEW, "--no-pictures"]
    assert main([*words, "-o", str(tmp_path / "six" / "x.obj")]) == 0
    assert any(note.startswith("C from 6 starts") for note in notes_of(tmp_path / "six"))
    assert main([*words, "-o", str(tmp_path / "one" / "x.obj"), "--starts", "1"]) == 0
    assert not any("starts" in note for note in notes_of(tmp_path / "one"))
    assert main(["form", str(tmp_path / "one" / "x.obj"), "-o", str(tmp_path / "mesh" / "x.obj"), *QUIET]) in (0, 1)
    assert not any("starts" in note for note in notes_of(tmp_path / "mesh"))


@pytest.mark.slow
def test_points_on_the_rim_and_far_away_are_said(
    circle: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["form", "--curve", circle, *FEW, *QUIET]
    assert main([*words, "-o", str(tmp_path / "rim.obj"), "--through", "1", "0", "0"]) == 0
    assert "--through 1 0 0 lies on the boundary" in capsys.readouterr().out
    assert (
        main([*words, "-o", str(tmp_path / "far.obj"), "--through", "0", "0", "95", "--results", f"{tmp_path}/f"]) == 1
    )
    assert "lies 95 from the start, which is 2 across" in capsys.readouterr().out


def test_an_arc_is_closed_on_request(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    rows = [(math.cos(math.pi * i / 24), math.sin(math.pi * i / 24)) for i in range(25)]
    (tmp_path / "arc.xyz").write_text("".join(f"{x} {y} 0\n" for x, y in rows))
    words = ["form", "--curve", str(tmp_path / "arc.xyz"), "-o", str(tmp_path / "x.obj"), *FEW, *QUIET]
    assert main(words) == 2
    assert "--close" in error_line(capsys)
    assert main([*words, "--close"]) == 0
    assert "closed by a straight line" in capsys.readouterr().out


def test_a_rim_that_is_not_convex_stays_flat(tmp_path: Path) -> None:
    (tmp_path / "ell.xyz").write_text("0 0 0\n8 0 0\n8 3 0\n3 3 0\n3 8 0\n0 8 0\n")
    words = ["form", "--curve", str(tmp_path / "ell.xyz"), "-o", str(tmp_path / "x.obj"), "--no-pictures"]
    assert main([*words, "--vertices", "100", "--starts", "2"]) == 0
    after = report_in(tmp_path)["energies"]["after"]
    assert after["area"] == pytest.approx(39.0, rel=1e-9)
    assert after["normal_variation"] < 1e-6
    assert after["smallest_angle_degrees"] > 15.0
