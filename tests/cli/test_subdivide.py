"""``torchfair subdivide``: schemes, marks on edges, refusals."""

from __future__ import annotations

import math
from pathlib import Path

import pytest
import torch
from helpers import cube, wavy_grid

from torchfair.boundary import boundary_corners
from torchfair.cli import main
from torchfair.io import load_edge_labels, load_mesh, save_edge_labels, save_mesh
from torchfair.principal import PrincipalEdges, principal_edges_of_lattice
from torchfair.shapes import Torus, principal_triangles
from torchfair.subdivision import refine


def error_line(capsys: pytest.CaptureFixture[str]) -> str:
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("torchfair subdivide: error: ")
    return err


@pytest.mark.parametrize("scheme", ["loop", "catmull-clark", "hybrid", "midpoint"])
def test_every_scheme_is_that_of_the_library(scheme: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vertices, topology = wavy_grid(5, 4, triangles=True)
    save_mesh(tmp_path / "coarse.obj", vertices, topology)
    output = tmp_path / "new" / "fine.ply"
    words = ["--scheme", scheme, "--levels", "2", "--boundary", "interpolate", "--corner-angle", "60"]
    assert main(["subdivide", str(tmp_path / "coarse.obj"), "-o", str(output), *words]) == 0
    fine = load_mesh(output)
    corners = boundary_corners(vertices, topology, math.radians(60.0))
    step = refine(topology, scheme.replace("-", "_"), 2, boundary="interpolate", corners=corners)  # type: ignore[arg-type]
    assert fine.topology.face_lists() == step.topology.face_lists()
    torch.testing.assert_close(fine.vertices, step.apply(vertices), rtol=0, atol=0)
    out, _ = capsys.readouterr()
    assert f"20 vertices, 24 faces to {step.topology.num_vertices} vertices" in out
    assert not output.with_suffix(".edges.json").exists()


@pytest.mark.parametrize("suffix", [".obj", ".off"])
def test_principal_edges_stay_principal(suffix: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mesh = principal_triangles(Torus(), 8, 10)
    edges = principal_edges_of_lattice(mesh)
    save_mesh(tmp_path / "torus.obj", mesh.vertices, mesh.topology, polylines=edges.polylines())
    output = tmp_path / f"fine{suffix}"
    assert main(["subdivide", str(tmp_path / "torus.obj"), "-o", str(output), "--levels", "2"]) == 0
    assert "edges parallel to them" in capsys.readouterr().out
    fine = load_mesh(output)
    file = output if suffix == ".obj" else output.with_suffix(".edges.json")
    found = PrincipalEdges(fine.topology, load_edge_labels(file, fine.topology)).check()
    assert torch.equal(found.mask, edges.refine(refine(mesh.topology, "loop", 2)).mask)
    assert 3 * int(found.mask.sum()) == fine.topology.num_edges


def test_other_lines_are_cut_and_nothing_else(tmp_path: Path) -> None:
    vertices, topology = cube()
    marks = torch.zeros(topology.num_edges, dtype=torch.bool)
    marks[:4] = True
    save_mesh(tmp_path / "cube.off", vertices, topology)
    save_edge_labels(tmp_path / "cube.edges.json", topology, marks)
    for lines, count in (("auto", 8), ("along", 8), ("parallel", None)):
        output = tmp_path / f"{lines}.obj"
        assert main(["subdivide", str(tmp_path / "cube.off"), "-o", str(output), "--lines", lines]) == 0
        fine = load_mesh(output)
        found = load_edge_labels(output, fine.topology)
        step = refine(topology, "hybrid", 1)
        assert torch.equal(found, step.carry_edge_labels(marks, parallel=lines == "parallel"))
        assert count is None or int(found.sum()) == count


def test_refusals(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vertices, topology = cube()
    start = tmp_path / "cube.obj"
    save_mesh(start, vertices, topology)
    assert main(["subdivide", str(start), "-o", str(tmp_path / "fine.obj"), "--scheme", "loop"]) == 2
    assert "Loop subdivision needs triangles" in error_line(capsys)
    assert main(["subdivide", str(start), "-o", str(tmp_path / "fine.xyz")]) == 2
    assert "choose a name that ends in .obj, .off, .ply" in error_line(capsys)
    before = start.read_bytes()
    assert main(["subdivide", str(start), "-o", str(start)]) == 2
    assert "exists" in error_line(capsys)
    assert start.read_bytes() == before
    assert main(["subdivide", str(start), "-o", str(tmp_path / "fine.obj"), "--levels", "0"]) == 2
    assert "at least 1" in error_line(capsys)
    assert not (tmp_path / "fine.obj").exists()
    (tmp_path / "other.edges.json").write_text("{}")
    save_mesh(tmp_path / "marked.obj", vertices, topology, polylines=[topology.edges[0]])
    assert main(["subdivide", str(tmp_path / "marked.obj"), "-o", str(tmp_path / "other.ply")]) == 2
    assert "other.edges.json exists" in error_line(capsys)
    assert not (tmp_path / "other.ply").exists()
    assert main(["subdivide", str(tmp_path / "marked.obj"), "-o", str(tmp_path / "other.ply"), "--force"]) == 0
