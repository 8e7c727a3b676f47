"""The job that lowers E, coarse to fine: what stays that of the input, and what is carried on."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE, grid_faces
from torch import Tensor

from torchfair import Topology
from torchfair.boundary import boundary_corners
from torchfair.energies import normal_variation, total_absolute_curvature
from torchfair.formfinding import FairSettings, minimise_normal_variation
from torchfair.formfinding.boundary_curves import BoundaryCurves
from torchfair.formfinding.fair.recipe import FairRecipe
from torchfair.formfinding.fair.refinement import _unfolded
from torchfair.geometry import dihedral_angles, edge_lengths
from torchfair.geometry.closest_point import ReferenceSurface
from torchfair.geometry.planarity import planarity
from torchfair.projection import ProjectionSettings
from torchfair.shapes import Catenoid, hybrid_roof, irregular_triangles
from torchfair.subdivision import hybrid, midpoint
from torchfair.triangulation import triangulate

QUICK = FairSettings(planar="none", projection=ProjectionSettings(max_iterations=4, initial_damping=0.1))


def catenoid(count: int = 60) -> tuple[Tensor, Topology]:
    """Two boundary circles without corners."""
    mesh = irregular_triangles(Catenoid(), count)
    return mesh.vertices, mesh.topology


def dome() -> tuple[Tensor, Topology]:
    """Four corners and four curved sides."""
    x, y = torch.meshgrid(*(torch.linspace(-1, 1, 6, dtype=DOUBLE),) * 2, indexing="ij")
    vertices = torch.stack([x, y, 0.2 * x * y - 0.1 * x**2 + 0.05 * torch.sin(3 * y)], dim=-1).reshape(-1, 3)
    return vertices, Topology.from_faces(grid_faces(6, 6))


def test_every_level_is_nearer_to_its_floor_and_near_the_input() -> None:
    vertices, topology = catenoid()
    settings = FairSettings()
    result = minimise_normal_variation(vertices, topology, levels=1, settings=settings)
    assert result.holds
    assert [level.topology.num_faces for level in result.levels] == [topology.num_faces, 4 * topology.num_faces]
    reference, mean = ReferenceSurface(vertices, topology), float(edge_lengths(vertices, topology).mean())
    for level in result.levels:
        inner = ~level.topology.is_boundary_vertex
        farthest = float(reference.closest(level.vertices[inner]).distances.max())
        assert farthest <= settings.distance_limit * mean * (1 + 1e-6)
        assert level.after["largest_distance_relative"] * mean >= farthest * (1 - 1e-9)
        assert level.after["energy_over_curvature"] < level.before["energy_over_curvature"]
    fine, finer = result.levels[-1].vertices, result.levels[-1].topology
    once = hybrid(topology, boundary="interpolate")
    plain = once.apply(result.levels[0].vertices)
    ratios = [
        float(normal_variation(places, finer) / total_absolute_curvature(places, finer)) for places in (fine, plain)
    ]
    assert ratios[0] < ratios[1]


@pytest.mark.parametrize("mesh", [catenoid, dome])
def test_new_boundary_vertices_lie_on_the_curves_of_the_input(mesh: object) -> None:
    vertices, topology = mesh()  # type: ignore[operator]
    result = minimise_normal_variation(vertices, topology, levels=2, settings=QUICK)
    corners = boundary_corners(vertices, topology, FairSettings().corner_angle)
    rim = BoundaryCurves.through(vertices, topology, corners)
    curves = rim.splines()
    assert curves is not None
    step = hybrid(topology, boundary="interpolate", corners=corners)
    rim = rim.refined(step)
    finest = rim.refined(hybrid(step.topology, boundary="interpolate", corners=rim.corners))
    rows = torch.nonzero(finest.owners >= 0).squeeze(1)
    assert len(rows) + int(corners.sum()) == int(result.topology.is_boundary_vertex.sum())
    distances = curves.closest(result.vertices[rows], finest.owners[rows]).distances
    assert float(distances.max()) < 1e-10
    assert torch.equal(result.vertices[: len(vertices)][corners], vertices[corners])
    assert result.after["largest_boundary_distance"] < 1e-10


def test_handles_and_held_vertices_are_carried_on() -> None:
    vertices, topology = dome()
    target = (vertices[14] + torch.tensor([0.02, 0.01, 0.1], dtype=DOUBLE)).tolist()
    recipe = FairRecipe(vertices, topology, handles={14: target})
    recipe.pulls.hold(torch.tensor([21]))
    finer = recipe.refined(recipe.state())
    assert finer.handles == {14: pytest.approx(target)}
    assert torch.nonzero(finer.pulls.held).squeeze(1).tolist() == [21]
    assert torch.equal(finer.given[[14, 21]], vertices[[14, 21]])
    assert not torch.equal(finer.given[15], vertices[15])
    assert finer.rim.points is recipe.rim.points
    assert finer.reference[0] is recipe.reference[0]
    result = minimise_normal_variation(vertices, topology, handles={14: target}, levels=1)
    assert float((result.vertices[14] - torch.tensor(target, dtype=DOUBLE)).norm()) < 0.05 * 0.2


@pytest.mark.slow
def test_parts_of_planar_faces_and_of_flat_panels_are_planar_and_flat_again() -> None:
    vertices, topology = hybrid_roof(4, 7)
    result = minimise_normal_variation(vertices, topology, levels=1)
    assert result.holds
    quads = int((topology.face_sizes == 4).sum())
    assert int((result.topology.face_sizes == 4).sum()) == 4 * quads
    assert float(planarity(result.vertices, result.topology).max()) < 1e-4
    triangles = Topology.from_faces(triangulate(vertices, topology).triangles, topology.num_vertices)
    cut = minimise_normal_variation(vertices, triangles, levels=1)
    assert cut.holds
    folds = dihedral_angles(cut.vertices, cut.topology).abs().rad2deg()
    assert int((folds < 0.02).sum()) >= 4 * quads


def test_a_start_that_folds_or_pinches_faces_goes_back_towards_the_plain_cut() -> None:
    """Half the way, or all of it."""
    vertices, topology = dome()
    step = hybrid(topology, boundary="interpolate")
    plain, smooth = midpoint(topology).apply(vertices), step.apply(vertices)
    assert torch.equal(_unfolded(smooth, vertices, step), smooth)
    across = torch.zeros_like(plain)
    across[14, 0] = 0.2  # half an edge of the coarse mesh, one of the fine one
    torch.testing.assert_close(_unfolded(plain + 1.2 * across, vertices, step), plain + 0.6 * across)
    assert torch.equal(_unfolded(plain + 4.0 * across, vertices, step), plain)


def test_the_distance_limit_is_in_mean_edges_of_the_input() -> None:
    vertices, topology = catenoid(60)
    recipe = FairRecipe(vertices, topology, settings=FairSettings(distance_limit=0.08))
    finer = recipe.refined(recipe.state())
    ratio = recipe.unit.length / finer.unit.length
    assert 1.8 < ratio < 2.2
    assert finer.problem.near.limit == pytest.approx(0.08 * ratio)
    assert finer.input_edge == recipe.unit.length
    measured = finer.measures(finer.given)
    assert measured["largest_distance_relative"] == pytest.approx(measured["largest_distance"] / recipe.unit.length)
