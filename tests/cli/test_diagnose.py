from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from star_tools import random_arms, stars_of

from torchfair import Topology
from torchfair.cli import main
from torchfair.cli.diagnosis import counts, describe_vertex, diagnose_mesh, per_vertex, worst_vertices
from torchfair.io import save_mesh
from torchfair.stars import StarKind, classify_stars, gauss_overlaps, pyramid_self_intersections

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


def test_numbers_are_those_of_the_library() -> None:
    vertices, topology = wavy_grid(9, 9, triangles=True)
    diagnosis = diagnose_mesh(vertices, topology)
    numbers = counts(diagnosis)
    classes = classify_stars(vertices, topology)
    for kind in (StarKind.CONVEX, StarKind.SADDLE, StarKind.NEITHER):
        assert numbers[kind.name.lower()] == int(classes.is_kind(kind).sum())
    assert numbers["convex"] + numbers["saddle"] + numbers["neither"] == numbers["inner_vertices"] == 49
    assert numbers["good_saddle"] + numbers["bad_saddle"] == numbers["saddle"]
    folded = pyramid_self_intersections(vertices, topology)
    assert numbers["self_intersecting_pyramids"] == int((folded > 0).sum())
    assert numbers["pyramid_self_intersections"] == int(folded.sum())
    assert sum(numbers["self_intersecting_pyramids_by_class"].values()) == numbers["self_intersecting_pyramids"]
    assert numbers["gauss_image_crossings"] == gauss_overlaps(vertices, topology).crossings
    assert sum(numbers["ordinary_patterns"].values()) == numbers["inner_vertices"]
    assert sum(numbers["pyramid_windings"].values()) == numbers["inner_vertices"]
    lists = per_vertex(diagnosis)
    assert {len(entries) for entries in lists.values()} == {81}
    for name in ("convex", "saddle", "neither"):
        assert lists["class"].count(name) == numbers[name]
    assert lists["class"].count("boundary") == numbers["boundary_vertices"]


def test_worst_vertices_come_first_and_good_ones_never() -> None:
    diagnosis = diagnose_mesh(*wavy_grid(9, 9, triangles=True))
    rows = worst_vertices(diagnosis, 1000)
    crossings = [row["self_intersections"] for row in rows]
    assert crossings == sorted(crossings, reverse=True)
    assert {row["class"] for row in rows if not row["self_intersections"]} <= {"bad saddle", "neither"}
    assert worst_vertices(diagnosis, 3) == rows[:3]
    assert rows[0] == describe_vertex(diagnosis, rows[0]["vertex"])


def test_mesh_without_inner_vertices_and_isolated_ones() -> None:
    vertices = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]], dtype=DOUBLE)
    numbers = counts(diagnose_mesh(vertices, Topology.from_faces([[0, 1, 2]], num_vertices=4)))
    assert (numbers["inner_vertices"], numbers["boundary_vertices"], numbers["isolated_vertices"]) == (0, 3, 1)
    assert numbers["mean_pyramid_perimeter_degrees"] is None


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
