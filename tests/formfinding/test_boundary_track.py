"""Boundary vertices on their curves: parameters after sliding and after refinement."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair.curves import ClosedCurve
from torchfair.formfinding import FormSettings, minimise_absolute_curvature, start_surface
from torchfair.formfinding.form.boundary_track import BoundaryTrack
from torchfair.formfinding.form.rim import _refined_normals
from torchfair.projection import ProjectionSettings
from torchfair.subdivision import loop

FEW = ProjectionSettings(max_iterations=2, damping_scale="identity")


def square() -> ClosedCurve:
    corners = torch.tensor([[0.0, 0, 0], [2, 0, 0.5], [2, 2, 0], [0, 2, 0.5]], dtype=DOUBLE)
    return ClosedCurve(torch.cat([a.lerp(b, t)[None] for a, b in zip(corners, corners.roll(-1, 0), strict=True)
                                  for t in (0.0, 0.25, 0.5, 0.75)]))  # fmt: skip


def wave() -> ClosedCurve:
    return ClosedCurve.from_function(
        lambda t: torch.stack([torch.cos(math.tau * t), torch.sin(math.tau * t), 0.3 * torch.cos(2 * math.tau * t)], 1)
    )


def tracked(curve: ClosedCurve, count: int = 60) -> tuple[Tensor, BoundaryTrack]:
    vertices, topology = start_surface([curve], count)
    return vertices, BoundaryTrack.onto(vertices, topology, [curve])


def test_vertices_slide_along_their_curve_and_corners_stay_corners() -> None:
    vertices, track = tracked(square())
    noise = 0.05 * torch.randn(vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    later = track.updated(vertices + noise)
    assert int(track.corners.sum()) == 4
    assert torch.equal(later.corners, track.corners)
    assert torch.equal(later.parameters[track.corners], track.parameters[track.corners])
    rim = track.topology.is_boundary_vertex
    others = rim & ~track.corners
    torch.testing.assert_close(later.parameters[others], square().parameters_of((vertices + noise)[others]))
    assert float((later.parameters - track.parameters)[others].abs().max()) > 1e-3
    assert not bool(later.parameters[~rim].any())
    placed = later.positions(vertices + noise)
    assert torch.equal(placed[~rim], (vertices + noise)[~rim])
    torch.testing.assert_close(placed[track.corners], vertices[track.corners], atol=1e-12, rtol=0)


def ahead(parameters: Tensor, others: Tensor) -> Tensor:
    """Signed way from parameters to others, the short one around."""
    return torch.remainder(others - parameters + 0.5, 1.0) - 0.5


@pytest.mark.parametrize("make", [square, wave])
def test_new_vertices_lie_halfway_along_the_curve_between_their_neighbours(make: Callable[[], ClosedCurve]) -> None:
    _, track = tracked(make())
    coarse = track.topology
    finer = track.refined(loop(coarse, boundary="interpolate", corners=track.corners))
    assert torch.equal(finer.parameters[: coarse.num_vertices], track.parameters)
    assert torch.equal(torch.nonzero(finer.corners), torch.nonzero(track.corners))
    start, end = track.parameters[coarse.boundary_edges].unbind(1)
    middle = finer.parameters[coarse.num_vertices + coarse.num_interior_edges :][: len(start)]
    torch.testing.assert_close(ahead(start, middle), 0.5 * ahead(start, end))
    torch.testing.assert_close(ahead(middle, end), 0.5 * ahead(start, end))
    assert float(ahead(start, end).sum().abs()) == pytest.approx(1.0)


@pytest.mark.parametrize("boundary", ["fixed", "glide"])
def test_boundaries_of_all_levels_lie_on_the_given_curve(boundary: str) -> None:
    """On the curve itself, not on the refined polyline: subdivision alone leaves it by 1e-4 and more."""
    curve = wave()
    vertices, topology = start_surface([curve], 40)
    settings = FormSettings(boundary=boundary, projection=FEW)
    result = minimise_absolute_curvature(vertices, topology, curves=[curve], levels=2, settings=settings)
    rim = result.vertices[result.topology.is_boundary_vertex]
    assert len(rim) == 4 * int(topology.is_boundary_vertex.sum())
    assert float((curve.at(curve.parameters_of(rim)) - rim).norm(dim=1).max()) < 1e-8


def test_prescribed_normals_of_new_vertices_are_unit_means_of_both_ends() -> None:
    """Where one end has none, or both ends are opposite, nothing is prescribed between them; nor is it inside."""
    _, track = tracked(wave(), 40)
    coarse = track.topology
    (ring,) = coarse.boundary_loops()
    normals = torch.zeros(coarse.num_vertices, 3, dtype=DOUBLE)
    normals[ring[0]] = torch.tensor([0.6, 0.0, 0.8], dtype=DOUBLE)
    normals[ring[1]] = torch.tensor([-0.6, 0.0, 0.8], dtype=DOUBLE)
    normals[ring[2]] = torch.tensor([0.6, 0.0, -0.8], dtype=DOUBLE)
    step = loop(coarse, boundary="interpolate", corners=track.corners)
    finer = _refined_normals(normals, step)
    assert torch.equal(finer[: coarse.num_vertices], normals)
    between = [set(edge) for edge in coarse.boundary_edges.tolist()].index(set(ring[:2].tolist()))
    expected = torch.zeros_like(finer[coarse.num_vertices :])
    expected[coarse.num_interior_edges + between] = torch.tensor([0.0, 0.0, 1.0], dtype=DOUBLE)
    torch.testing.assert_close(finer[coarse.num_vertices :], expected)


def test_finer_levels_start_nearby_and_need_the_last_smoothing_only() -> None:
    """Along normals and in space, once each; from afar there is a stage for every smoothing besides."""
    curve = wave()
    vertices, topology = start_surface([curve], 40)
    settings = FormSettings(projection=FEW)
    result = minimise_absolute_curvature(vertices, topology, curves=[curve], levels=2, settings=settings)
    first, *finer = (len(level.runs) for level in result.levels)
    assert first > 2
    assert finer == [2, 2]
