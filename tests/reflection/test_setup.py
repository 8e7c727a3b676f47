"""Stripes of a setup: how many a reference shows, and in which directions they run."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, cube, grid_faces, random_rotation
from torch import Tensor

from torchfair import Topology
from torchfair.reflection import OrthographicCamera, ReflectionSetup, SmoothReference, reflection_score
from torchfair.reflection.default_views import default_stripe_directions

DOWN = OrthographicCamera(torch.tensor([0.0, 0.0, -1.0]), half_widths=1.02, ups=torch.tensor([0.0, 1.0, 0.0]))


def trough(curvature: float, along: float = 0.0, n: int = 21) -> SmoothReference:
    """z = curvature x^2 / 2 + along y^2 / 2 over the square from -1 to 1, with its own normals."""
    side = torch.linspace(-1, 1, n, dtype=DOUBLE)
    x, y = (part.reshape(-1) for part in torch.meshgrid(side, side, indexing="ij"))
    points = torch.stack([x, y, 0.5 * (curvature * x**2 + along * y**2)], dim=1)
    normals = torch.stack([-curvature * x, -along * y, torch.ones_like(x)], dim=1)
    return SmoothReference(points, Topology.from_faces(grid_faces(n, n)), normals / normals.norm(dim=1, keepdim=True))


def frequencies(setup: ReflectionSetup) -> list[float]:
    return (setup.stripes.waves.norm(dim=1) / (2 * math.pi)).tolist()


def extent(curvature: float) -> float:
    """Of the x-component of what a trough mirrors from above, twice the sine of twice the slope at its rim."""
    return 2 * math.sin(2 * math.atan(curvature))


@pytest.mark.parametrize("curvature", [0.03, 0.1, 0.3])
def test_a_reference_shows_four_stripe_pairs_whatever_its_curvature(curvature: float) -> None:
    """Mirrored directions of a trough run evenly from one side to the other, so their extent is known."""
    reference = trough(curvature)
    across = torch.tensor([[1.0, 0.0, 0.0]])
    setup = ReflectionSetup.for_reference(reference, camera=DOWN, stripe_directions=across, size=96, supersampling=1)
    assert frequencies(setup) == pytest.approx([4.0 / extent(curvature)], rel=0.03)
    row = setup.reference_pictures.stripes[0, 0, 48, 2:-2] - 0.5
    borders = int((row[1:] * row[:-1] < 0).sum())
    assert 7 <= borders <= 9  # of eight stripes, bright and dark


def test_stripe_pairs_are_counted_on_the_average_of_all_directions() -> None:
    """Lengths of directions do not matter."""
    reference = trough(0.2, 0.1)
    both = torch.tensor([[5.0, 0.0, 0.0], [0.0, 0.1, 0.0]])
    setup = ReflectionSetup.for_reference(reference, camera=DOWN, stripe_directions=both)
    mean = (extent(0.2) + extent(0.1)) / 2
    assert frequencies(setup) == pytest.approx([4.0 / mean] * 2, rel=0.03)


def test_a_plane_counts_as_bent_by_a_twentieth_of_a_radian() -> None:
    setup = ReflectionSetup.for_reference(trough(0.0), camera=DOWN)
    assert frequencies(setup) == pytest.approx([4.0 / (2 * math.sin(0.025))] * 4)


def test_a_score_has_the_stripes_that_are_asked_for() -> None:
    reference = trough(0.2, n=9)
    directions = torch.tensor([[1.0, 0.0, 0.0], [0.0, 0.0, 2.0]])
    mesh = (reference.vertices, reference.topology)
    result = reflection_score(
        *mesh, reference, camera=DOWN, stripe_directions=directions, frequency=1.7, size=48, supersampling=2
    )
    expected = 2 * math.pi * 1.7 * torch.tensor([[1.0, 0, 0], [0, 0, 1]], dtype=DOUBLE)
    torch.testing.assert_close(result.setup.stripes.waves, expected)
    assert result.per_view.shape == (1, 2)
    assert result.images.shape == (1, 2, 48, 48)


def test_stripes_of_a_patch_run_every_45_degrees_around_its_normal() -> None:
    turn = random_rotation(2)
    flat = trough(0.0, n=3)
    patch = SmoothReference(flat.vertices @ turn.T, flat.topology, flat.normals @ turn.T)
    waves = default_stripe_directions(patch)
    across: Tensor = waves @ waves.T
    turns = torch.arange(4, dtype=DOUBLE) * (math.pi / 4)
    torch.testing.assert_close(across, torch.cos(turns[:, None] - turns), atol=1e-5, rtol=0)
    assert float((waves @ patch.normals[0]).abs().max()) < 1e-5


def test_stripes_of_a_body_run_along_the_diagonals_of_a_cube() -> None:
    waves = torch.nn.functional.normalize(default_stripe_directions(SmoothReference.of_mesh(*cube())), dim=1)
    expected = torch.full((4, 4), 1 / 3, dtype=DOUBLE).fill_diagonal_(1.0)
    torch.testing.assert_close((waves @ waves.T).abs(), expected)
