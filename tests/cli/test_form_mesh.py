"""``torchfair form --mesh N``: principal quads beside the surface, which is never lost."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import torch
from helpers import report_in

from torchfair.cli import main
from torchfair.io import load_mesh
from torchfair.meshing import NoMeshError, principal_quads

FEW = ["--vertices", "110", "--starts", "1", "--iterations", "6"]


@pytest.fixture
def words(tmp_path: Path) -> list[str]:
    """A tube between circles of different radii, into a folder that is not there yet."""
    found = []
    for name, radius, height in (("lower", 1.0, 0.0), ("upper", 0.7, 1.0)):
        angles = [2 * math.pi * i / 40 for i in range(40)]
        rows = (f"{radius * math.cos(a)!r} {radius * math.sin(a)!r} {height}\n" for a in angles)
        (tmp_path / f"{name}.xyz").write_text("".join(rows))
        found += ["--curve", str(tmp_path / f"{name}.xyz")]
    return ["form", *found, "-o", str(tmp_path / "out" / "tube.obj"), *FEW]


def failing(*_: object, **__: object) -> None:
    raise NoMeshError("no valid mesh was found near vertex 7", 7)


def interrupted(*_: object, **__: object) -> None:
    raise KeyboardInterrupt


def test_quads_are_those_of_the_surface_that_is_written(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main([*words, "--mesh", "80", "--no-pictures"]) == 0
    surface, quads = load_mesh(out / "tube.obj"), load_mesh(out / "tube-quads.obj")
    expected = principal_quads(surface.vertices, surface.topology, count=80)
    torch.testing.assert_close(quads.vertices, expected.vertices, rtol=0, atol=1e-9)
    assert quads.topology.face_lists() == expected.topology.face_lists()
    assert len(quads.topology.boundary_loops()) == 2
    report = report_in(out)
    assert report["principal_quads"]["measures"]["faces"] == quads.topology.num_faces
    floor = report["principal_quads"]["measures"]["total_absolute_curvature"]
    assert floor == pytest.approx(expected.report["total_absolute_curvature"])
    assert report["energies"]["after"]["total_absolute_curvature"] == pytest.approx(floor, rel=0.05)  # of triangles
    assert {path.name for path in out.iterdir()} == {"tube.obj", "tube-quads.obj", "tube.report.json"}
    said = capsys.readouterr().out
    assert "angle to principal directions" in said
    assert f"wrote {out / 'tube-quads.obj'}" in said


@pytest.mark.parametrize(
    ("meshing", "code", "reason"),
    [(failing, 1, "no valid mesh was found near vertex 7"), (interrupted, 130, "interrupted")],
)
def test_the_surface_is_there_if_there_are_no_quads(
    meshing: object,
    code: int,
    reason: str,
    words: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.setattr("torchfair.meshing.principal_quads", meshing)
    out = tmp_path / "out"
    assert main([*words, "--mesh", "80", "--no-pictures"]) == code
    said = capsys.readouterr().out.rstrip().splitlines()
    assert said[-1] == f"principal quads (--mesh 80): NOT REACHED; {reason}"
    assert not any("tube-quads" in line for line in said)
    assert load_mesh(out / "tube.obj").topology.num_faces > 80
    assert {path.name for path in out.iterdir()} == {"tube.obj", "tube.report.json"}
    report = report_in(out)
    assert report["principal_quads"] == {"not_reached": reason}


def test_the_surface_is_written_before_it_is_meshed(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def out_of_memory(*_: object, **__: object) -> None:
        raise MemoryError

    monkeypatch.setattr("torchfair.meshing.principal_quads", out_of_memory)
    with pytest.raises(MemoryError):
        main([*words, "--mesh", "80", "--no-pictures"])
    assert load_mesh(tmp_path / "out" / "tube.obj").topology.num_faces > 80


@pytest.mark.slow
def test_quads_have_a_picture_if_they_are_there(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([*words, "--mesh", "80"]) == 0
    assert (tmp_path / "out" / "tube.mesh.png").read_bytes().startswith(b"\x89PNG")
    assert "mesh.png" in capsys.readouterr().out
    monkeypatch.setattr("torchfair.meshing.principal_quads", failing)
    assert main([*words, "--mesh", "80", "--results", str(tmp_path / "other"), "--force"]) == 1
    assert "mesh.png" not in capsys.readouterr().out
    assert {path.name for path in (tmp_path / "other").iterdir()} == {
        "tube.report.json",
        "tube.curvature.png",
        "tube.edges.png",
    }


def test_quads_of_an_earlier_run_are_kept_and_named(
    words: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    earlier = tmp_path / "out" / "tube-quads.obj"
    earlier.parent.mkdir()
    earlier.write_text("precious")
    assert main([*words, "--mesh", "80", "--no-pictures"]) == 2
    assert f"{earlier} exists" in capsys.readouterr().err
    assert not (tmp_path / "out" / "tube.obj").exists()
    monkeypatch.setattr("torchfair.meshing.principal_quads", failing)
    assert main([*words, "--mesh", "80", "--no-pictures", "--force"]) == 1
    assert f"{earlier} is of an earlier run" in capsys.readouterr().out
    assert earlier.read_text() == "precious"


def test_a_wrong_count_is_one_line(words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([*words, "--mesh", "0"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_without_the_option_nothing_is_said_of_quads(words: list[str], tmp_path: Path) -> None:
    assert main([*words, "--no-pictures"]) == 0
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"tube.obj", "tube.report.json"}
    assert "principal_quads" not in report_in(tmp_path / "out")


def test_quads_are_cut_where_a_format_has_none(
    words: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words[words.index("-o") + 1] = str(tmp_path / "out" / "tube.stl")
    assert main([*words, "--mesh", "40", "--no-pictures"]) in (0, 1)
    assert "tube-quads.stl holds its polygons cut into triangles" in capsys.readouterr().out
    assert load_mesh(tmp_path / "out" / "tube-quads.stl").topology.is_triangular
    assert "principal_quads" in report_in(tmp_path / "out")
