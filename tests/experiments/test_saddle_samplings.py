"""Stars of sampled saddles: what the paper remarks, and that the table of the docs is the one that comes out."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
import torch

from torchfair.geometry import edge_lengths
from torchfair.shapes import Sphere, Torus, parameter_triangles, rotated_lattice

Run = Callable[..., dict[str, Any]]
STARS = Path(__file__).resolve().parents[2] / "docs" / "stars.md"


def test_asymmetric_patterns_and_many_inflection_faces_are_rare(run: Run) -> None:
    report = run("saddle_samplings", "--surfaces", "paraboloid", "curvatures 1 : -0.1", "--rows", "12", "--angles", "3",
                 "--perturbations", "0.1", "--seeds", "1")  # fmt: skip
    for row in report["all"].values():
        assert row["stars"] > 50
        kinds = ("good saddles", "other 1, 2, 1, 2", "2, 2, 1, 1", "3, 1, 1, 1", "other saddles", "neither", "convex")
        assert sum(row[kind] for kind in kinds) == row["stars"]
        assert row["stars with more than 4 inflection faces"] == 0
        assert row["2, 2, 1, 1"] + row["3, 1, 1, 1"] + row["other saddles"] <= 0.01 * row["stars"]
    even, uneven = (report["surfaces"][name]["regular"] for name in ("paraboloid", "curvatures 1 : -0.1"))
    assert even["neither"] == 0
    assert uneven["neither"] > 0.2 * uneven["stars"]
    assert set(report["all"]) == {"regular", "moved by up to 0.1 edges", "random"}


def test_vertices_move_along_the_surface_by_no_more_than_allowed(script: Callable[[str], ModuleType]) -> None:
    module = script("saddle_samplings")
    mesh = rotated_lattice(Torus(2.0, 1.0), 20, 40, 0.3)
    moved = module.moved(mesh, 0.2, torch.Generator().manual_seed(0))
    x, y, z = moved.unbind(1)
    torch.testing.assert_close(torch.hypot(torch.hypot(x, y) - 2.0, z), torch.ones_like(x))
    lengths = torch.linalg.vector_norm(moved - mesh.vertices, dim=1) / edge_lengths(mesh.vertices, mesh.topology).mean()
    assert 0.18 < float(lengths.max()) < 0.21
    assert float(lengths.mean()) == pytest.approx(0.1, rel=0.1)


def test_only_regular_stars_away_from_the_boundary_are_counted(script: Callable[[str], ModuleType]) -> None:
    module = script("saddle_samplings")
    mesh = parameter_triangles(Sphere(latitudes=(-0.5, 0.5)), 6, 20)  # rows of 20, five of them inside
    chosen = module.counted(mesh.topology)
    assert int(chosen.sum()) == 3 * 20
    assert not (chosen & mesh.topology.is_boundary_vertex).any()
    assert module.count(mesh.vertices, mesh.topology)["convex"] <= 60


@pytest.mark.slow
def test_the_table_of_the_docs_comes_out(run: Run, tmp_path: Path) -> None:
    run("saddle_samplings")
    assert (tmp_path / "out" / "table.md").read_text() in STARS.read_text()
