"""How every command reads a mesh: seams are told and welded, faults are mended and named as the file counts."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch
from helpers import report_in, wavy_grid

from torchfair.cli.command import build_parser, main
from torchfair.cli.reading import with_default_tolerance
from torchfair.io import load_mesh, save_mesh

SPLIT = "v 0 0 0\nv 1 0 0\nv 1 1 .2\nv 0 0 0\nv 1 1 .2\nv 0 1 0\nf 1 2 3\nf 4 5 6\n"
COMMANDS = ("measure", "diagnose", "reflect", "fair", "form", "symmetric", "denoise", "mesh", "subdivide")


@pytest.fixture
def seam(tmp_path: Path) -> str:
    (tmp_path / "seam.obj").write_text(SPLIT)
    return str(tmp_path / "seam.obj")


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_that_reads_a_mesh_can_weld_it(command: str) -> None:
    output = [] if command in ("measure", "diagnose", "reflect") else ["-o", "o.obj"]
    for words, expected in ((["--weld"], True), (["--weld", "0.5"], 0.5), (["--weld=2"], 2.0), ([], False)):
        arguments = build_parser().parse_args([command, *words, "in.obj", *output])
        assert arguments.weld == expected
        assert arguments.input == ["in.obj"]
        assert not arguments.split_edges


def test_a_file_name_is_no_tolerance() -> None:
    assert with_default_tolerance(["--weld", "a.obj", "--weld", "1e-3"]) == ["--weld=auto", "a.obj", "--weld", "1e-3"]
    assert with_default_tolerance(["a.obj", "--weld"]) == ["a.obj", "--weld=auto"]


def test_seams_are_told_and_closed(seam: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["measure", seam, "--json"]) == 0
    loose = json.loads(capsys.readouterr().out)
    assert loose["normal_variation"] == 0.0
    assert "1 pair(s) of boundary edges lie on each other" in loose["notes"][0]
    assert "edges (3, 1) and (4, 5)" in loose["notes"][0]  # as the file counts
    assert "--weld" in loose["notes"][0]
    assert loose["notes"][1] == "most edges (6 of 6) are boundary, and those carry no E."
    assert main(["measure", seam, "--json", "--weld"]) == 0
    joined = json.loads(capsys.readouterr().out)
    assert joined["normal_variation"] == pytest.approx(0.396, abs=5e-4)
    (note,) = joined["notes"]
    assert note.startswith("most edges (4 of 5) are boundary, and those carry no E. If its faces are meant to touch")
    assert joined["repairs"][0].endswith("vertices 4 to 1, 5 to 3.")
    assert main(["measure", seam, "--weld", "-1"]) == 2
    assert "--weld" in capsys.readouterr().err


def test_the_map_of_vertices_is_written(seam: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "new" / "roof.obj"
    assert main(["fair", seam, "--weld", "-o", str(output), "--no-pictures"]) == 0
    assert "repaired: welded 2 vertex(es)" in capsys.readouterr().out
    assert report_in(output.parent)["vertex_map"] == [0, 1, 2, 0, 2, 3]
    assert load_mesh(output).topology.face_lists() == [[0, 1, 2], [0, 2, 3]]


def test_subdivide_writes_the_map_beside(seam: str, tmp_path: Path) -> None:
    words = ["subdivide", seam, "--weld", "--scheme", "midpoint", "-o", str(tmp_path / "fine.obj")]
    assert main(words) == 0
    numbers = json.loads((tmp_path / "fine.vertices.json").read_text())["vertex_map"]
    assert numbers == [0, 1, 2, 0, 2, 3]
    assert load_mesh(tmp_path / "fine.obj").vertices[numbers].equal(load_mesh(seam).vertices)
    (tmp_path / "fine.obj").unlink()
    assert main(words) == 2
    assert not (tmp_path / "fine.obj").exists()


def test_handles_and_marks_keep_the_numbers_of_the_file(tmp_path: Path) -> None:
    """Welding renumbers vertices behind; the handle is still the one that was named, and marked edges stay marked."""
    points, topology = wavy_grid(4, 4)
    faces = topology.face_lists()
    copy = [[{5: 16, 9: 17}.get(v, v) if i % 3 == 0 else v for v in face] for i, face in enumerate(faces)]
    lines = [
        f"v {x} {y} {z}" for x, y, z in [*points.tolist(), points[5].tolist(), points[9].tolist(), [2.0, 2.0, 1.0]]
    ]
    file = "\n".join([*lines, *(f"f {' '.join(str(v + 1) for v in face)}" for face in copy), "l 6 7", "l 17 7"]) + "\n"
    (tmp_path / "in.obj").write_text(file)
    place = [x + 0.01 for x in points[9].tolist()]
    words = [
        "fair",
        str(tmp_path / "in.obj"),
        "-o",
        str(tmp_path / "out" / "o.obj"),
        "--no-pictures",
        "--repair",
        "--weld",
    ]
    assert main([*words, "--handle", "18", *map(str, place), "--iterations", "3"]) in (0, 1)
    made = load_mesh(tmp_path / "out" / "o.obj")
    assert made.topology.num_vertices == 16
    assert torch.allclose(made.vertices[9], torch.tensor(place, dtype=torch.float64), atol=2e-3)
    assert (tmp_path / "out" / "o.obj").read_text().count("l 6 7") == 1
    assert main([*words, "--force", "--handle", "19", "0", "0", "0"]) == 2  # the unused one


def test_what_a_job_refuses_is_named_as_the_file_counts(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "flat.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nv 1 1 0\n\nf 1 3 4\nf 3 1 2\n")
    assert main(["fair", str(path), "-o", str(tmp_path / "o.obj")]) == 2
    assert f"error: {path}: 1 face(s) have no area: faces 2 (line 7). " in capsys.readouterr().err
    assert main(["mesh", str(path), "--quads", "9", "-o", str(tmp_path / "o.obj")]) == 2
    assert f"error: {path}: 1 face(s) have no area: faces 2 (line 7). " in capsys.readouterr().err
    assert main(["subdivide", str(path), "--repair", "-o", str(tmp_path / "o.obj")]) == 0
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\n\nf 1 2 3\n")  # too small for principal directions
    assert main(["symmetric", str(path), "-o", str(tmp_path / "s.obj")]) == 2
    said = "directions: none in the component of face 1 (line 5) (vertex 1). Choose the family by one of its edges, "
    assert f"error: {path}: {said}with --seed V W" in capsys.readouterr().err


def test_groups_and_the_like_come_back_or_are_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "roof.obj"
    path.write_text(
        "mtllib roof.mtl\nv 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 1 1 .2 0 1 0\nv 0 1 0 0 1 0\n"
        "vt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\ng left\nusemtl glass\nf 1/1/1 2/2/1 3/3/1\ng right\nf 1 3 4\n"
    )
    (tmp_path / "roof.mtl").write_text("newmtl glass\n")
    output = tmp_path / "new" / "o.obj"
    assert main(["fair", str(path), "-o", str(output), "--no-pictures"]) == 0
    assert "note: o.obj does not hold normals (vn) of the input" in capsys.readouterr().out
    lines = output.read_text().splitlines()
    assert lines[0] == "v 0.0 0.0 0.0 1 0 0"
    assert lines[4:] == ["vt 0 0", "vt 1 0", "vt 1 1", "mtllib ../roof.mtl", "g left", "usemtl glass", "f 1/1 2/2 3/3",
        "g right", "f 1 3 4"]  # fmt: skip
    assert main(["subdivide", str(path), "-o", str(tmp_path / "o.ply")]) == 0
    said = capsys.readouterr().out
    for words in ("groups (g)", "materials (usemtl)", "texture coordinates", "normals (vn)", "colours"):
        assert words in said


@pytest.mark.parametrize("suffix", [".stl", ".glb"])
def test_polygons_are_cut_where_a_format_has_none(
    suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    vertices, topology = wavy_grid(3, 3)
    save_mesh(tmp_path / "q.obj", vertices, topology)
    assert main(["subdivide", str(tmp_path / "q.obj"), "--scheme", "midpoint", "-o", str(tmp_path / f"o{suffix}")]) == 0
    assert "polygons cut into triangles" in capsys.readouterr().out
    made = load_mesh(tmp_path / f"o{suffix}")
    assert made.topology.num_faces == 32
    assert made.topology.num_vertices == 25


def saddle_lines() -> list[str]:
    """OBJ lines of a saddle of 7 x 7 vertices, the first of which no face uses."""
    x, y = torch.meshgrid(*(torch.linspace(-1, 1, 7, dtype=torch.float64),) * 2, indexing="ij")
    rows = torch.stack([x, y, 0.4 * (x**2 - y**2)], -1).reshape(-1, 3).tolist()
    faces = [(7 * i + j, 7 * i + j + 7, 7 * i + j + 8, 7 * i + j + 1) for i in range(6) for j in range(6)]
    triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
    points = ["v 9 9 9", *(f"v {p} {q} {r}" for p, q, r in rows)]
    return [*points, *("f " + " ".join(str(corner + 2) for corner in face) for face in triangles)]


def test_diagnose_names_vertices_as_the_file_does_after_repair(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "saddle.obj"
    path.write_text("\n".join(saddle_lines()) + "\n")

    def rows(*words: str) -> list[int]:
        assert main(["diagnose", str(path), "--json", *words]) == 0
        return [row["number_in_file"] for row in json.loads(capsys.readouterr().out)["worst_vertices"]]

    assert rows("--repair") == rows()


def test_symmetric_takes_marks_and_numbers_of_the_file_after_repair(tmp_path: Path) -> None:
    path = tmp_path / "saddle.obj"
    lines = [f"l {' '.join(str(7 * i + j + 2) for j in range(7))}" for i in range(7)]
    path.write_text("\n".join([*saddle_lines(), *lines]) + "\n")
    words = ["symmetric", str(path), "-o", str(tmp_path / "out.obj"), "--repair", "--no-pictures", "--steps", "1"]
    assert main([*words, "--fix", "2"]) in (0, 1)  # the first vertex of a face
    corner = load_mesh(tmp_path / "out.obj").vertices[0]
    assert corner.tolist() == [-1.0, -1.0, 0.0]
    assert main([*words, "--force", "--fix", "1"]) == 2  # was dropped
    assert main([*words, "--force", "--seed", "2", "51"]) == 2


def test_numbers_beyond_the_file_are_refused_though_repair_adds_vertices(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "bow.obj"
    places = ("0 0 0", "1 0 0", "1 1 0", "0 1 0.1", "-1 0 0", "-1 -1 0", "0 -1 0.1")
    fans = ("1 2 3", "1 3 4", "1 5 6", "1 6 7")
    path.write_text("\n".join([*(f"v {place}" for place in places), *(f"f {face}" for face in fans)]) + "\n")
    words = ["fair", str(path), "-o", str(tmp_path / "o.obj"), "--repair", "--no-pictures"]
    assert main([*words, "--fix", "8"]) == 2
    assert "vertices are numbered 1 to 7 in the file, got 8" in capsys.readouterr().err


def test_what_meshing_has_read_is_in_its_report(tmp_path: Path) -> None:
    path = tmp_path / "saddle.obj"
    path.write_text("\n".join(saddle_lines()) + "\n")
    words = ["mesh", str(path), "-o", str(tmp_path / "o.obj"), "--quads", "30", "--repair", "--no-pictures"]
    assert main(words) in (0, 1)
    report = report_in(tmp_path)
    assert report["repairs"]
    assert report["vertex_map"][:3] == [-1, 0, 1]
