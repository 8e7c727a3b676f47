"""Experiments with principal-symmetric designs at tiny sizes: what their JSON claims holds."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import torch

from torchfair import shapes
from torchfair.geometry import planarity
from torchfair.io import load_mesh
from torchfair.principal import principal_edges_of_lattice

Run = Callable[..., dict[str, Any]]
AROUND = ("--around", "16")


def assert_principal_symmetric(level: dict[str, Any]) -> None:
    after = level["after"]
    assert max(after["largest_cospherical"], after["largest_coplanar"]) < 1e-6
    assert after["saddle_side_share"] == 1
    assert after["crossing_pyramids_negative"] == 0
    assert after["largest_handle_distance"] < 0.05 * after["mean_edge_length"]


def test_annulus_stays_principal_symmetric_and_carries_developable_strips(run: Run, tmp_path: Path) -> None:
    report = run("fig05_annulus", *AROUND, "--rings", "6", "--outwards", "0.1", "--inwards", "0.06", "--held", "4")
    assert_principal_symmetric(report["design"])
    assert report["largest_pull"] == pytest.approx(math.hypot(0.1, 0.05))
    assert report["gauss_image"]["crossing"] == 0
    strips = report["strips"]
    assert strips["quads"] == 7 * 16  # one for every principal edge
    assert strips["largest_planarity"] < 1e-6
    assert strips["largest_isometry_error"] < 1e-6
    assert load_mesh(tmp_path / "out" / "strips.obj").topology.num_faces == strips["quads"]
    start, design = (load_mesh(tmp_path / "out" / name) for name in ("start.obj", "design.obj"))
    moved = torch.linalg.vector_norm(design.vertices - start.vertices, dim=1)
    assert moved.max() > 0.3


def test_designs_from_a_torus_stay_principal_symmetric_when_refined(run: Run, tmp_path: Path) -> None:
    options = (
        "--rows",
        "12",
        "--levels",
        "1",
        "--smooth",
        "1",
        "--size",
        "64",
        "--outwards",
        "0.1",
        "--inwards",
        "0.05",
    )
    report = run("fig14_design", *AROUND, *options)
    assert [level["vertices"] for level in report["levels"]] == [192, 768]
    for level in report["levels"]:
        assert_principal_symmetric(level)
    coarse, fine, quads = report["reflections"].values()
    assert fine["score"] < coarse["score"]
    assert fine["rms"] < 0.7 * coarse["rms"]
    assert quads["normal_variation"] < fine["normal_variation"]
    assert report["largest_planarity_of_quads"] < 0.05
    mesh = load_mesh(tmp_path / "out" / "principal_quads.obj")
    assert mesh.topology.is_quadrangular
    assert mesh.topology.num_vertices == quads["vertices"] == 768 // 2


def test_principal_quads_lie_on_the_lines_of_a_lattice(script: Callable[[str], ModuleType]) -> None:
    mesh = shapes.principal_triangles(shapes.Torus(), 8, 10, along="u")
    principal = principal_edges_of_lattice(mesh, "u")
    module = script("fig14_design")
    lines = torch.stack(module.every_other_line(principal))
    assert lines.shape == (4, 10)
    turn = (mesh.parameters[lines, 0] - mesh.parameters[lines[:1], 0]).abs()
    assert torch.minimum(turn, 2 * math.pi - turn).max() < 1e-12  # columns are meridians
    assert (mesh.parameters[lines, 1] - mesh.parameters[lines[:, :1], 1]).abs().max() < 1e-12
    level = module.Level(mesh.vertices, principal, {})
    vertices, topology = module.principal_quad_mesh(level, 2)
    assert topology.num_vertices == topology.num_faces == 4 * 5
    assert planarity(vertices, topology).max() < 1e-12  # symmetric trapezoids


def test_conditions_on_chosen_polylines_leave_the_rest_to_the_energy(run: Run) -> None:
    options = ("--rows", "8", "--smooth", "0", "--size", "64", "--spacing", "2")
    plain, report = (
        run("fig14h_polylines", *AROUND, *options, "--energy-weight", weight, folder=weight) for weight in ("0", "0.03")
    )
    assert report["conditions_at"] == 4 * 16
    for level in report["levels"]:
        assert max(level["after"]["largest_cospherical"], level["after"]["largest_coplanar"]) < 1e-6
    assert [level["after"]["stars"] for level in report["levels"]] == [4 * 16, 4 * 32]
    energies = [found["levels"][-1]["after"]["normal_variation"] for found in (plain, report)]
    assert energies[1] < 0.99 * energies[0]
