from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from torchfair.cameras import OrthographicCamera
from torchfair.cli import main, reflect
from torchfair.io import load_mesh, save_mesh
from torchfair.reflection import SmoothReference, default_camera, reflection_score
from torchfair.shapes import PrincipalParaboloid, irregular_triangles, principal_quads
from torchfair.viewing.chosen_view import chosen_view
from torchfair.viewing.sheet import MARGIN

KEYS = ("score", "reflection_variation", "rms", "wobble")
SADDLE = PrincipalParaboloid(1.0, -0.5, (0.8, 0.8))
FEW_PIXELS = ("--size", "64", "--frames", "3")


@pytest.fixture
def mesh_file(tmp_path: Path) -> str:
    path = tmp_path / "mesh.obj"
    mesh = irregular_triangles(SADDLE, 120)
    save_mesh(path, mesh.vertices, mesh.topology)
    return str(path)


@pytest.fixture
def reference_file(tmp_path: Path) -> str:
    path = tmp_path / "reference.off"
    mesh = principal_quads(SADDLE, 30, 30)
    save_mesh(path, mesh.vertices, mesh.topology)
    return str(path)


def read_json(text: str) -> dict[str, object]:
    def refuse(token: str) -> float:
        raise AssertionError(f"{token} is no JSON")

    found: dict[str, object] = json.loads(text, parse_constant=refuse)
    return found


def test_numbers_are_those_of_the_library(
    mesh_file: str, reference_file: str, capsys: pytest.CaptureFixture[str]
) -> None:
    mesh, reference = load_mesh(mesh_file), load_mesh(reference_file)
    for options, surface in (([], None), (["--reference", reference_file], (reference.vertices, reference.topology))):
        assert main(["reflect", mesh_file, "--json", "--size", "64", *options]) == 0
        report = read_json(capsys.readouterr().out)
        expected = reflection_score(mesh.vertices, mesh.topology, surface, size=64).numbers()
        assert {key: report[key] for key in KEYS} == {key: float(expected[key]) for key in KEYS}
        assert all(report[key] > 0 for key in KEYS)  # type: ignore[operator]
        assert len(report["score_by_view"]) == 6  # type: ignore[arg-type]
        assert report["reference"] == (options[1] if options else None)


def test_table(mesh_file: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["reflect", mesh_file, "--size", "64"]) == 0
    out = capsys.readouterr().out
    assert all(word in out for word in ("1 - SSIM", "variation", "rms", "score by view"))
    assert "wrote" not in out


def test_large_meshes_have_a_turntable_where_it_is_asked_for(
    mesh_file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """What an earlier run has drawn goes, as with ``--frames 0``."""
    command = ["reflect", mesh_file, "-o", str(tmp_path), "--size", "64", "--force"]
    film = tmp_path / "mesh.turntable.gif"
    assert main([*command, "--frames", "2"]) == 0
    assert film.is_file()
    assert "turntable is" not in capsys.readouterr().err
    faces = load_mesh(mesh_file).topology.num_faces
    monkeypatch.setattr(reflect, "_MANY_FACES", faces - 1)
    assert main(command) == 0
    assert not film.is_file()
    assert "--frames 24" in capsys.readouterr().err
    assert main([*command, "--frames", "1"]) == 0
    assert film.is_file()
    film.unlink()
    monkeypatch.setattr(reflect, "_FRAMES", 2)
    monkeypatch.setattr(reflect, "_MANY_FACES", faces)
    assert main(command) == 0
    assert film.is_file()


def test_files_are_written_once(mesh_file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    folder = tmp_path / "out"
    command = ["reflect", mesh_file, "-o", str(folder), *FEW_PIXELS]
    assert main(command) == 0
    names = {"mesh.reflection.json", "mesh.views.png", "mesh.differences.png", "mesh.turntable.gif"}
    assert {path.name for path in folder.iterdir()} == names
    with Image.open(folder / "mesh.turntable.gif") as film:
        assert getattr(film, "n_frames", 1) == 3
        first = film.convert("L").tobytes()
        film.seek(2)
        assert film.convert("L").tobytes() != first
    with Image.open(folder / "mesh.views.png") as sheet:
        assert sheet.width > 6 * 64
        assert len(sheet.convert("RGB").getcolors(1 << 24)) > 50
    capsys.readouterr()
    assert main(command) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert "--force" in line
    assert main([*command, "--force", "--frames", "0"]) == 0
    assert set(KEYS) <= set(read_json((folder / "mesh.reflection.json").read_text()))
    plain = tmp_path / "plain"
    assert main(["reflect", mesh_file, "-o", str(plain), "--no-pictures", "--size", "64"]) == 0
    assert [path.name for path in plain.iterdir()] == ["mesh.reflection.json"]


def test_a_mesh_that_is_not_where_its_reference_is_has_nothing_to_compare(
    mesh_file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mesh = principal_quads(SADDLE, 4, 4)
    save_mesh(tmp_path / "far.obj", mesh.vertices + 100, mesh.topology)
    folder = tmp_path / "out"
    options = ["--reference", str(tmp_path / "far.obj"), "-o", str(folder), *FEW_PIXELS]
    assert main(["reflect", mesh_file, *options]) == 1
    said = capsys.readouterr()
    assert "nothing to compare" in said.out
    assert said.err.count("\n") == 1
    assert "no score" in said.err
    report = read_json((folder / "mesh.reflection.json").read_text())
    assert [report[key] for key in KEYS] == [None] * 4
    assert report["compared_of_mesh"] == 0
    assert len(list(folder.iterdir())) == 4


def test_a_score_of_little_is_doubted(mesh_file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A reference that lies beside the mesh but for a margin, and one that lies on it."""
    mesh = principal_quads(SADDLE, 12, 12)
    width = float(mesh.vertices[:, 0].max() - mesh.vertices[:, 0].min())
    for shift, doubted in ((0.0, False), (0.7 * width, True)):
        moved = mesh.vertices.clone()
        moved[:, 0] += shift
        save_mesh(tmp_path / "reference.obj", moved, mesh.topology, overwrite=True)
        command = ["reflect", mesh_file, "--reference", str(tmp_path / "reference.obj"), "--json", "--size", "96"]
        assert main(command) == 0
        said = capsys.readouterr()
        report = read_json(said.out)
        assert ("was compared" in said.err) is doubted is (report["compared_of_mesh"] < 0.2)  # type: ignore[operator]
        assert report["score"] > 0  # type: ignore[operator]
        views = zip(report["score_by_view"], report["compared"], strict=True)  # type: ignore[call-overload]
        assert all((score is None) is (part == 0) for score, part in views)


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--size", "8"], "at least 16"),
        (["--size", "0"], "'0'"),
        (["--frequency", "-1"], "'-1'"),
        (["--frames", "-2"], "'-2'"),
        (["--reference", "missing.obj"], "missing.obj"),
    ],
)
def test_wrong_options_are_refused_in_one_line(
    options: list[str], named: str, mesh_file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "out"
    assert main(["reflect", mesh_file, "-o", str(folder), *options]) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert named in line
    assert not folder.exists()


def test_interruption_leaves_whole_files_only(
    mesh_file: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def stop(*arguments: object, **options: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("torchfair.progress.frame_progress", stop)
    folder = tmp_path / "out"
    assert main(["reflect", mesh_file, "-o", str(folder), *FEW_PIXELS]) == 130
    assert "interrupted" in capsys.readouterr().err
    assert {path.name for path in folder.iterdir()} == {
        "mesh.reflection.json",
        "mesh.views.png",
        "mesh.differences.png",
    }


def test_one_view_is_scored_alone_and_its_notes_are_whole(
    mesh_file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mesh = load_mesh(mesh_file)
    angles = (30.0, 20.0)
    folder = tmp_path / "out"
    command = ["reflect", mesh_file, "--json", "--size", "64", "--view", "30,20", "--up", "y"]
    assert main([*command, "-o", str(folder), "--frames", "0"]) == 0
    report = read_json(capsys.readouterr().out)
    view = chosen_view(mesh.vertices, mesh.topology, "y", angles)
    camera = OrthographicCamera.fit(mesh.vertices, directions=-view.towards_eye, ups=view.up)
    expected = reflection_score(mesh.vertices, mesh.topology, camera=camera, size=64)
    assert report["score"] == float(expected.score)
    assert report["view_directions"] == (-view.towards_eye)[None].tolist()
    elevation = math.degrees(math.asin(float(view.towards_eye[1])))
    assert elevation == pytest.approx(20.0)
    with Image.open(folder / "mesh.views.png") as sheet:
        gray = np.asarray(sheet.convert("L"))
    assert (gray[:, -MARGIN // 2 :] == 255).all(), "a note runs out of the sheet"


def test_what_is_up_turns_all_views_and_the_turntable(
    mesh_file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    films = []
    for up in "zy":
        folder = tmp_path / up
        assert main(["reflect", mesh_file, "--json", "-o", str(folder), *FEW_PIXELS, "--up", up]) == 0
        assert len(read_json(capsys.readouterr().out)["score_by_view"]) == 6  # type: ignore[arg-type]
        films.append((folder / "mesh.turntable.gif").read_bytes())
    assert films[0] != films[1]
    mesh = load_mesh(mesh_file)
    ups = default_camera(SmoothReference.of_mesh(mesh.vertices, mesh.topology), torch.eye(3)[1]).axes[:, 1]
    assert (ups[:, 1] > 0.5).all()
