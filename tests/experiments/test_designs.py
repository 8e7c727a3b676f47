"""What experiments on whole designs claim, at tiny sizes: found through solves, chains of commands, reflections."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import torch

from torchfair.geometry import planarity
from torchfair.io import load_mesh

Run = Callable[..., dict[str, Any]]


@pytest.mark.slow
def test_handles_are_found_through_the_solve(run: Run, tmp_path: Path) -> None:
    design = run("inverse_design", "--vertices", "60", "--steps", "2", "--difference-steps", "1", "--points", "4",
                 "--handles", "1", "--pull", "0.4")["designs"]["points"]  # fmt: skip
    assert design["errors_of_gradients"]["implicit"] < 0.03  # that of differences of a loss that is small here
    for way in ("implicit", "unrolled", "finite differences"):
        assert design[way]["loss"] <= design[way]["first_loss"]
    assert design["implicit"]["loss"] < 0.6 * design["implicit"]["first_loss"]
    assert load_mesh(tmp_path / "out" / "points_found.obj").topology.is_triangular


@pytest.mark.slow
def test_a_surface_is_recovered_from_what_it_mirrors(run: Run, tmp_path: Path) -> None:
    report = run("shape_from_mirrors", "--rows", "8", "--fine", "24", "--views", "3", "--size", "32", "--steps", "40",
                 "--rate", "0.06")  # fmt: skip
    surfaces = report["surfaces"]
    for way in surfaces.values():
        assert way["degrees"] < 0.4 * way["start"]["degrees"]
        assert way["rms"] < 0.4 * way["start"]["rms"]
    alone, energy = surfaces["pictures alone"], surfaces["pictures and E"]
    assert energy["normal_variation"] < alone["normal_variation"]
    found, wanted = (load_mesh(tmp_path / "out" / name) for name in ("pictures_and_e.obj", "surface.obj"))
    boundary = found.topology.is_boundary_vertex
    torch.testing.assert_close(found.vertices[boundary], wanted.vertices[boundary])


@pytest.mark.parametrize(("name", "rows"), [("fig01_reflections", ["16"]), ("fig14_reflections", ["10", "16"])])
def test_principal_meshes_have_least_energy_and_mirror_better(run: Run, name: str, rows: list[str]) -> None:
    report = run(name, "--size", "96", "--rows", *rows)
    finest = {kind: row.get(rows[-1], row) for kind, row in report["meshes"].items()}
    kinds = ("triangle mesh", "principal-symmetric triangles", "principal quads")
    irregular, symmetric, quads = (finest[kind] for kind in kinds)
    meshed = finest["principal quads, meshed"]  # of the irregular triangles alone
    assert meshed["normal_variation"] == pytest.approx(quads["normal_variation"], rel=0.05)
    assert meshed["score"] < irregular["score"]
    assert quads["normal_variation"] < symmetric["normal_variation"] < irregular["normal_variation"]
    assert quads["normal_variation"] == pytest.approx(report["total_absolute_curvature"], rel=0.15)
    assert max(quads["score"], symmetric["score"]) < irregular["score"]


@pytest.mark.slow
def test_chains_end_in_planar_quads_whose_energy_is_the_curvature_of_the_surface(run: Run, tmp_path: Path) -> None:
    report = run("fig17_pipelines", "--vertices", "300", "--quads", "150")["surfaces"]
    for surface in report.values():
        stages = surface["stages"]
        energy = {name: row["variation_over_curvature"] for name, row in stages.items()}
        assert energy["triangles"] > 1.2
        assert energy["of smaller E"] < 0.9 * energy["triangles"]
        assert energy["principal quads"] < 1.03
        assert energy["planar"] < 1.06
        assert stages["planar"]["planarity_max"] < 1e-4 < stages["principal quads"]["planarity_max"]
        assert surface["chain"]["holds"]
    floors = [surface["stages"]["triangles"]["total_absolute_curvature"] for surface in report.values()]
    assert floors[1] < 0.8 * floors[0]
    mesh = load_mesh(tmp_path / "out" / "design_surface_planar.obj")
    assert planarity(mesh.vertices, mesh.topology).max() < 1e-4


@pytest.mark.slow
def test_a_facade_of_principal_quads_mirrors_better_than_one_of_as_many_triangles(run: Run) -> None:
    options = ("--vertices", "200", "--levels", "1", "--quads", "500", "--size", "96")
    meshes = run("fig10_glass_facade", *options)["meshes"]
    triangles, quads = meshes["as many triangular panels"], meshes["planar principal quads"]
    assert 0.8 < triangles["faces"] / quads["faces"] < 1.25
    assert quads["variation_over_curvature"] < 1.08 < 1.25 < triangles["variation_over_curvature"]
    assert quads["score"] < triangles["score"]
    assert quads["planarity_max"] < 1e-4


@pytest.mark.slow
def test_a_surface_with_four_openings_is_meshed_with_all_of_them(run: Run, tmp_path: Path) -> None:
    report = run("fig21_principal_remeshing", "--vertices", "300", "--levels", "1", "--quads", "500")
    made = report["chain"]["principal quads"]
    assert (made["euler_number"], made["boundary_loops"]) == (-3, 5)
    rows = report["meshes"]
    assert rows["principal quads"]["normal_variation"] < 0.85 * rows["surface of least C"]["normal_variation"]
    mesh = load_mesh(tmp_path / "out" / "planar_quads.obj")
    assert len(mesh.topology.boundary_loops()) == 5
