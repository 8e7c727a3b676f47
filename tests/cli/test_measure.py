from __future__ import annotations

import csv
import json
import math
from pathlib import Path

import pytest
import torch
from helpers import cube, wavy_grid

from torchfair import NormalVariation, Topology
from torchfair.cli import main
from torchfair.geometry import face_areas
from torchfair.io import load_mesh, save_mesh
from torchfair.shapes import builtin_mesh

CUBE_OBJ = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))


def file_of(mesh: tuple[torch.Tensor, Topology], path: Path) -> str:
    save_mesh(path, *mesh)
    return str(path)


def strict_json(text: str) -> dict[str, object]:
    def refuse(token: str) -> float:
        raise AssertionError(f"{token} is no JSON")

    return json.loads(text, parse_constant=refuse)


def test_json_is_one_strict_object(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = file_of(cube(), tmp_path / "cube.obj")
    assert main(["measure", path, "--json", "--worst", "2"]) == 0
    captured = capsys.readouterr()
    measured = strict_json(captured.out)
    assert captured.err == ""
    assert measured["normal_variation"] == pytest.approx(12 * math.sqrt(2))
    assert measured["file"] == path
    assert measured["repairs"] == []
    assert len(measured["worst_edges"]) == 2
    assert set(measured["worst_edges"][0]) == {
        "edge",
        "vertices",
        "vertices_in_file",
        "position",
        "kind",
        "length",
        "dihedral_angle_degrees",
        "angle_variation",
    }
    assert measured["notes"] == []
    others = {"file", "repairs", "notes", "worst_edges", "worst_panels", "curvature_doubts", "units", "verdict"}
    edge = measured["worst_edges"][0]
    assert edge["vertices_in_file"] == [vertex + 1 for vertex in edge["vertices"]]
    assert set(measured["units"]) == set(measured) - others
    assert measured["curvature_doubts"] == []


def test_json_of_a_degenerate_mesh_has_nulls_for_what_is_undefined(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "line.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    assert main(["measure", str(path), "--json"]) == 0
    measured = strict_json(capsys.readouterr().out)
    assert measured["normal_variation_per_area"] is None
    assert measured["degenerate_faces"] == 1
    assert measured["worst_edges"] == []


def test_table_has_values_units_and_worst_edges(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = file_of(cube(), tmp_path / "cube.off")
    assert main(["measure", path, "--worst", "3"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == path
    energy = next(line for line in lines if "normal variation" in line)
    assert energy.split()[-6:] == ["16.9706", "length", "units", "of", "the", "file"]
    heading = next(number for number, line in enumerate(lines) if line.startswith("worst edges"))
    rows = lines[heading + 2 :]
    assert len(rows) == 3
    assert rows[0].split()[-6:-3] == ["1", "90", "1.5708"]
    assert sorted(map(float, rows[0].split()[-3:]))[:2] in ([0.0, 0.0], [0.0, 0.5], [0.5, 1.0])
    assert lines[1].startswith("verdict: E/C is ")


def test_tables_have_a_row_for_each_panel_and_edge(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = file_of(cube(), tmp_path / "cube.obj")
    panels, edges = tmp_path / "tables" / "p.csv", tmp_path / "tables" / "e.csv"
    words = ["measure", path, "--panels", str(panels), "--edges", str(edges)]
    assert main(words) == 0
    rows = list(csv.DictReader(panels.read_text().splitlines()))
    assert [row["panel"] for row in rows] == [str(number) for number in range(1, 7)]
    assert {float(row["area"]) for row in rows} == {1.0}
    assert {(row["class"], row["largest_kink_degrees"]) for row in rows} == {("planar", "90.0")}
    rows = list(csv.DictReader(edges.read_text().splitlines()))
    assert len(rows) == 12
    assert {row["class"] for row in rows} == {"crease"}
    assert min(int(row["from"]) for row in rows) == 1
    assert max(int(row["to"]) for row in rows) == 8
    energy = sum(
        float(row["length"]) * 2 * math.sin(math.radians(float(row["dihedral_angle_degrees"])) / 2) for row in rows
    )
    assert energy == pytest.approx(12 * math.sqrt(2))
    capsys.readouterr()
    assert main(words) == 2
    assert "--force" in capsys.readouterr().err
    assert main([*words, "--force"]) == 0


def test_tables_of_a_result(tmp_path: Path) -> None:
    vertices, topology = wavy_grid(4, 4)
    path = file_of((vertices, topology), tmp_path / "in.obj")
    words = ["fair", path, "-o", str(tmp_path / "out.ply"), "--no-pictures", "--iterations", "2"]
    assert main([*words, "--panels", str(tmp_path / "p.csv")]) in (0, 1)
    made = load_mesh(tmp_path / "out.ply")
    rows = list(csv.DictReader((tmp_path / "p.csv").read_text().splitlines()))
    assert [int(row["panel"]) for row in rows] == list(range(9))
    areas = face_areas(made.vertices, made.topology).tolist()
    assert [float(row["area"]) for row in rows] == pytest.approx(areas)


def test_repair_is_said_and_done(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "turned.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 9 9 9\nf 1 2 3\nf 1 4 3\n")
    assert main(["measure", str(path)]) == 2
    assert "--repair" in capsys.readouterr().err
    assert main(["measure", str(path), "--repair", "--json"]) == 0
    measured = strict_json(capsys.readouterr().out)
    assert measured["vertices"] == 4
    assert len(measured["repairs"]) >= 1
    assert main(["measure", str(path), "--repair"]) == 0
    assert capsys.readouterr().out.startswith("repaired: ")


def test_folds_that_c_does_not_see_are_said(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A strip folded back onto itself: C = 0, E is not."""
    places = [(x, y, 0) for x in (0, 1, 0.4) for y in (0, 1, 2)]
    faces = [(a, a + 3, a + 4, a + 1) for a in (1, 2, 4, 5)]
    lines = [*(f"v {x} {y} {z}" for x, y, z in places), *("f " + " ".join(map(str, face)) for face in faces)]
    (tmp_path / "folded.obj").write_text("\n".join(lines) + "\n")
    assert main(["measure", str(tmp_path / "folded.obj")]) == 0
    out = capsys.readouterr().out
    assert "C is not to be trusted: E = 4 is more than 3 times C" in out
    assert "a dihedral angle of 180 degrees" in out
    assert main(["measure", "example:roof"]) == 0
    assert "trusted" not in capsys.readouterr().out


def test_surfaces_are_examples_by_name(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["measure", "example:torus", "--json"]) == 0
    vertices, topology = builtin_mesh("torus")
    measured = strict_json(capsys.readouterr().out)
    assert measured["normal_variation"] == pytest.approx(float(NormalVariation(topology)(vertices)))
