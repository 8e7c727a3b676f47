"""Stationarity of E on a reference surface as one number per vertex, and which vertices can be judged."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import torch
from helpers import DOUBLE, cube, wavy_grid

from torchfair import ShapeError, Topology
from torchfair.cli import main
from torchfair.geometry import ReferenceSurface
from torchfair.io import save_mesh
from torchfair.measuring import measure_stationarity
from torchfair.measuring.stationarity import complete_stars
from torchfair.shapes import ClosestOnSurface, Torus, irregular_triangles, principal_quads, rotated_lattice


def test_complete_stars_have_no_boundary_edge_around_them() -> None:
    for triangles in (False, True):
        vertices, topology = wavy_grid(6, 5, triangles=triangles)
        boundary = {frozenset(edge) for edge in topology.edges[topology.num_interior_edges :].tolist()}
        expected = torch.ones(len(vertices), dtype=torch.bool)
        for face in topology.face_lists():
            sides = {frozenset((face[i - 1], face[i])) for i in range(len(face))}
            if sides & boundary:
                expected[face] = False
        assert torch.equal(complete_stars(topology), expected)
        assert 0 < int(expected.sum()) < 20
    assert complete_stars(cube()[1]).all()
    assert not complete_stars(Topology.from_faces([[0, 1, 2]], 4)).any()


@pytest.mark.parametrize("scale", [1.0, 1000.0])
def test_a_fine_mesh_of_the_surface_tells_the_same_as_the_surface(scale: float) -> None:
    surface = Torus(2.0, 0.8)
    mesh, fine = rotated_lattice(surface, 16, 32, 0.3), principal_quads(surface, 100, 200)
    smooth = measure_stationarity(mesh.vertices, mesh.topology, ClosestOnSurface(surface))
    meshed = measure_stationarity(
        scale * mesh.vertices, mesh.topology, ReferenceSurface(scale * fine.vertices, fine.topology)
    )
    torch.testing.assert_close(meshed.gradients, smooth.gradients, atol=3e-3, rtol=0)
    assert meshed.imbalance == pytest.approx(smooth.imbalance, rel=0.01)
    assert float(smooth.distances.max()) < 1e-14
    values = {quantity.key: quantity.value for quantity in meshed.quantities()}
    lengths = torch.linalg.vector_norm(smooth.gradients, dim=1)
    assert values["judged_vertices"] == len(mesh.vertices)
    assert values["largest_tangential_gradient"] == pytest.approx(float(lengths.max()), rel=0.02)
    assert values["mean_tangential_gradient"] == pytest.approx(float(lengths.mean()), rel=0.02)
    assert values["largest_reference_distance"] == pytest.approx(float(meshed.distances.max()))


def test_the_job_that_lowers_e_makes_meshes_more_stationary() -> None:
    from torchfair.formfinding import minimise_normal_variation

    mesh = irregular_triangles(Torus(2.0, 0.8), 150)
    found = minimise_normal_variation(mesh.vertices, mesh.topology)
    surface = ReferenceSurface(*(lambda m: (m.vertices, m.topology))(principal_quads(Torus(2.0, 0.8), 60, 120)))
    before, after = (measure_stationarity(v, mesh.topology, surface).imbalance for v in (mesh.vertices, found.vertices))
    assert after < before


def test_where_nothing_can_be_judged_numbers_are_missing() -> None:
    vertices, topology = wavy_grid(3, 3)
    surface = ReferenceSurface(vertices, topology)
    missing = {
        quantity.key: quantity.value for quantity in measure_stationarity(vertices, topology, surface).quantities()
    }
    assert missing["judged_vertices"] == 0
    assert missing["largest_tangential_gradient"] is None
    assert missing["tangential_imbalance"] is None
    assert missing["largest_reference_distance"] == 0
    away = torch.cat([vertices, torch.full((1, 3), 100.0, dtype=DOUBLE)])  # an isolated vertex is nowhere
    more = Topology.from_faces(topology.face_lists(), len(away))
    assert float(measure_stationarity(away, more, surface).distances.max()) == 0
    with pytest.raises(ShapeError, match="not a batch"):
        measure_stationarity(vertices[None], topology, surface)


def test_the_command_prints_and_lists_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    mesh, fine = principal_quads(Torus(), 12, 24), principal_quads(Torus(), 48, 96)
    for name, m in (("mesh", mesh), ("fine", fine)):
        save_mesh(tmp_path / f"{name}.obj", m.vertices, m.topology)
    words = ["measure", str(tmp_path / "mesh.obj"), "--reference", str(tmp_path / "fine.obj")]
    assert main(words) == 0
    table = capsys.readouterr().out
    assert "on the reference surface" in table
    assert "largest tangential gradient of E" in table
    assert main([*words, "--json", "--per-vertex"]) == 0
    report = json.loads(capsys.readouterr().out)
    lengths = report["per_vertex"]["tangential_gradient"]
    assert max(lengths) == report["largest_tangential_gradient"]
    assert report["units"]["largest_reference_distance"] == "length units of the file"
    assert len(report["per_vertex"]["reference_distance"]) == len(mesh.vertices)
    assert max(report["per_vertex"]["reference_distance"]) == report["largest_reference_distance"]
    assert main([*words, "--per-vertex"]) == 2
    assert "--json" in capsys.readouterr().err
    assert torch.tensor(lengths, dtype=DOUBLE).isfinite().all()
