from __future__ import annotations

import json
from pathlib import Path

import pytest
from star_tools import random_arms, stars_of

from torchfair.cli import main
from torchfair.io import save_mesh

KEYS = ("convex", "saddle", "neither", "good_saddle", "self_intersecting_pyramids")
CUBE_OBJ = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1)) + (
    "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n"
)


@pytest.fixture
def stars_file(tmp_path: Path) -> str:
    path = tmp_path / "stars.obj"
    save_mesh(path, *stars_of(random_arms(20, 6, 1, height=0.3, saddle=0.3)))
    return str(path)


def read_json(text: str) -> dict[str, object]:
    def refuse(token: str) -> float:
        raise AssertionError(f"{token} is no JSON")

    found: dict[str, object] = json.loads(text, parse_constant=refuse)
    return found


def test_json(stars_file: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["diagnose", stars_file, "--json"]) == 0
    report = read_json(capsys.readouterr().out)
    assert all(isinstance(report[key], int) for key in KEYS)
    assert report["inner_vertices"] == 20
    assert "per_vertex" not in report
    assert main(["diagnose", stars_file, "--json", "--per-vertex", "--worst", "2"]) == 0
    report = read_json(capsys.readouterr().out)
    assert len(report["per_vertex"]["class"]) == 140  # type: ignore[index]
    assert len(report["worst_vertices"]) == 2  # type: ignore[arg-type]


def test_table(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "cube.obj"
    path.write_text(CUBE_OBJ)
    assert main(["diagnose", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert any(line.split()[:2] == ["convex", "8"] for line in lines)
    assert not any("worst" in line for line in lines)


def test_pictures_and_report_are_written_once(
    stars_file: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "out"
    command = ["diagnose", stars_file, "-o", str(folder), "--vertex", "0", "--vertex", "7"]
    assert main(command) == 0
    names = {"diagnosis.json", "classes.png", "pyramids.png", "gauss_image.png"}
    assert {path.name for path in folder.iterdir()} == names
    capsys.readouterr()
    assert main(command) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert "--force" in line
    assert main([*command, "--force"]) == 0
    report = read_json((folder / "diagnosis.json").read_text())
    assert set(KEYS) <= set(report)
    plain = tmp_path / "plain"
    assert main(["diagnose", stars_file, "-o", str(plain), "--no-pictures", "--per-vertex"]) == 0
    assert [path.name for path in plain.iterdir()] == ["diagnosis.json"]
    assert "per_vertex" in read_json((plain / "diagnosis.json").read_text())


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--vertex", "0"], "--output"),
        (["--vertex", "1", "-o", "out"], "not inside"),
        (["--vertex", "1000", "-o", "out"], "0 to 139"),
        (["--vertex", "-1", "-o", "out"], "'-1'"),
    ],
)
def test_wrong_vertices_are_refused(
    options: list[str],
    named: str,
    stars_file: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["diagnose", stars_file, *options]) == 2
    assert named in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
