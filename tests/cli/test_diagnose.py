from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest
import torch
from star_tools import random_arms, stars_of

from torchfair.cli import main
from torchfair.geometry import edge_lengths
from torchfair.io import load_mesh, save_mesh
from torchfair.shapes import Catenoid, principal_triangles

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
    command = ["diagnose", stars_file, "-o", str(folder), "--vertex", "1", "--vertex", "8"]
    assert main(command) == 0
    names = {
        f"stars.{end}" for end in ("diagnosis.json", "classes.png", "pyramids.png", "gauss_image.png", "classes.ply")
    }
    assert {path.name for path in folder.iterdir()} == names
    capsys.readouterr()
    assert main(command) == 2
    line = capsys.readouterr().err
    assert line.count("\n") == 1
    assert "--force" in line
    assert main([*command, "--force"]) == 0
    report = read_json((folder / "stars.diagnosis.json").read_text())
    assert set(KEYS) <= set(report)
    plain = tmp_path / "plain"
    assert main(["diagnose", stars_file, "-o", str(plain), "--no-pictures", "--per-vertex"]) == 0
    assert [path.name for path in plain.iterdir()] == ["stars.diagnosis.json"]
    assert "per_vertex" in read_json((plain / "stars.diagnosis.json").read_text())


@pytest.mark.parametrize(
    ("options", "named"),
    [
        (["--vertex", "1"], "--output"),
        (["--vertex", "2", "-o", "out"], "--vertex 2: it is not inside"),
        (["--vertex", "1000", "-o", "out"], "1 to 140"),
        (["--vertex", "-1", "-o", "out"], "got -1"),
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


def test_worst_vertices_are_explained(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A good lattice with one vertex slid away: it is where the file says, and what is proposed mends it."""
    mesh = principal_triangles(Catenoid(), 8, 12, along="v")
    vertices, vertex = mesh.vertices.clone(), 50
    frame = mesh.principal_directions[vertex]
    vertices[vertex] += 0.35 * (frame[0] + frame[1]) * edge_lengths(vertices, mesh.topology).mean()
    save_mesh(tmp_path / "one.obj", vertices, mesh.topology)
    assert main(["diagnose", str(tmp_path / "one.obj"), "--json"]) == 0
    report = read_json(capsys.readouterr().out)
    rows: Any = report["worst_vertices"]
    row = next(row for row in rows if row["vertex"] == vertex)
    assert row["number_in_file"] == vertex + 1
    assert row["position"] == pytest.approx(vertices[vertex].tolist())
    assert row["remedy"]["bad_after"] < row["remedy"]["bad_before"]
    assert "few" in report["advice"][0]  # type: ignore[index]
    assert main(["diagnose", str(tmp_path / "one.obj")]) == 0
    out = capsys.readouterr().out
    assert row["remedy"]["words"] in out
    assert row["pattern_words"] in out
    assert "{:.6g} {:.6g} {:.6g}".format(*row["position"]) in out


def test_the_coloured_mesh_is_the_mesh(stars_file: str, tmp_path: Path) -> None:
    assert main(["diagnose", stars_file, "-o", str(tmp_path / "out")]) == 0
    given, made = load_mesh(stars_file), load_mesh(tmp_path / "out" / "stars.classes.ply")
    assert torch.equal(given.vertices, made.vertices)
    assert given.topology.face_lists() == made.topology.face_lists()
    head = (tmp_path / "out" / "stars.classes.ply").read_bytes().split(b"end_header")[0]
    assert all(f"property uchar {name}".encode() in head for name in ("red", "green", "blue"))
