"""Creases are curves like the boundary: vertices glide on them, corners stay, on every level."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, cube, grid_faces, split_quads
from torch import Tensor

from torchfair import Topology
from torchfair.errors import SettingsError
from torchfair.formfinding import FairSettings, minimise_normal_variation
from torchfair.formfinding.fair.feature_curves import FeatureCurves
from torchfair.formfinding.fair.problem import FairProblem
from torchfair.formfinding.job import Pulls
from torchfair.geometry import face_areas
from torchfair.subdivision import hybrid, midpoint

FORTY = math.radians(40.0)


def block() -> tuple[Tensor, Topology]:
    """A cube whose sides are cut into triangles, twice."""
    vertices, quads = cube()
    triangles = Topology.from_faces(split_quads(quads.corners.view(-1, 4).numpy()))
    for _ in range(2):
        step = midpoint(triangles)
        vertices, triangles = step.apply(vertices), step.topology
    return vertices, triangles


def ridge(n: int = 7) -> tuple[Tensor, Topology]:
    """A roof of bent slopes; its ridge is an arch over the middle row, with vertices at uneven places."""
    x, y = torch.meshgrid(*(torch.arange(n, dtype=DOUBLE),) * 2, indexing="ij")
    x, y = x - (n - 1) / 2, y + 0.15 * torch.sin(5.0 * x + 3.0 * y) * (y % (n - 1) > 0)
    z = -0.8 * x.abs() - 0.05 * (y - 3.0) ** 2 + 0.05 * x**2
    vertices = torch.stack([x, y, z], -1).reshape(-1, 3)
    return vertices, Topology.from_faces(split_quads(grid_faces(n, n)))


@pytest.mark.parametrize("levels", [0, 1])
def test_a_block_stays_a_block(levels: int) -> None:
    vertices, topology = block()
    result = minimise_normal_variation(vertices, topology, levels=levels)
    corners = ((vertices == 0) | (vertices == 1)).all(1)
    assert int(corners.sum()) == 8
    assert torch.equal(result.vertices[: len(vertices)][corners], vertices[corners])
    assert float(face_areas(result.vertices, result.topology).sum()) == pytest.approx(6.0, rel=1e-4)
    assert result.after["largest_distance_back"] < 1e-3
    assert any("48 edges are creases" in note for note in result.notes) or levels
    eaten = minimise_normal_variation(vertices, topology, settings=FairSettings(crease_angle=0.0))
    assert float(face_areas(eaten.vertices, topology).sum()) < 5.0  # what creases are there for


@pytest.mark.parametrize("boundary", ["glide", "free", "fixed"])
def test_vertices_of_a_ridge_glide_on_its_arch(boundary: str) -> None:
    vertices, topology = ridge()
    settings = FairSettings(boundary=boundary)  # type: ignore[arg-type]
    result = minimise_normal_variation(vertices, topology, settings=settings)
    inner = torch.arange(22, 27)
    moved = (result.vertices - vertices)[inner].norm(dim=1)
    assert float(moved.max()) > 0.02
    assert float(result.vertices[inner, 0].abs().max()) < 1e-9  # in the plane of the arch, a parabola
    assert float((result.vertices[inner, 2] + 0.05 * (result.vertices[inner, 1] - 3.0) ** 2).abs().max()) < 1e-3
    assert result.after["normal_variation"] < result.before["normal_variation"]


def test_finer_meshes_have_the_same_creases() -> None:
    vertices, topology = ridge()
    coarse = FeatureCurves.through(vertices, topology, corner_angle=FORTY, crease_angle=FORTY)
    step = hybrid(topology, boundary="interpolate", corners=coarse.rim.corners)
    fine = coarse.refined(step)
    assert int((fine.edges >= 0).sum()) == 2 * int((coarse.edges >= 0).sum()) == 12
    assert torch.nonzero(fine.corners).squeeze(1).tolist() == [21, 27]
    assert int((fine.owners >= 0).sum()) == 11
    assert len(fine.points) == 1
    assert bool(coarse.rim.corners[[21, 27]].all())  # the boundary has corners where the ridge arrives


def test_second_differences_along_a_crease_leave_out_its_corners() -> None:
    vertices, topology = ridge()
    curves = FeatureCurves.through(vertices, topology, corner_angle=FORTY, crease_angle=FORTY)
    (term,) = curves.fairness_terms(topology, weight=1.0)
    triples = {(min(row[0], row[2]), row[1], max(row[0], row[2])) for row in term.stencil[0][1].tolist()}
    assert triples == {(i - 1, i, i + 1) for i in range(22, 27)}


def test_a_mesh_without_creases_has_the_same_problem_as_before() -> None:
    vertices, topology = ridge()
    flat = vertices * torch.tensor([1.0, 1.0, 0.1], dtype=DOUBLE)
    seen, off = (FairProblem(flat, topology, None, Pulls(flat), FairSettings(crease_angle=a)) for a in (FORTY, 0.0))
    assert [term.name for term in seen.terms(1.0)] == [term.name for term in off.terms(1.0)]
    assert torch.equal(seen.stays(), off.stays())
    assert not any("crease" in note for note in seen.notes)


@pytest.mark.parametrize("angle", [-0.1, 3.2, 40.0])
def test_angles_are_in_radians(angle: float) -> None:
    with pytest.raises(SettingsError, match="crease_angle"):
        FairSettings(crease_angle=angle)
