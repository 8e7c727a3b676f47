"""Stars that are settled without looking at pairs: never one that runs through itself, and nearly all others."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import torch
from helpers import wavy_grid
from hypothesis import example, given, settings
from hypothesis import strategies as st

import torchfair.self_intersections as module
from torchfair import Topology
from torchfair._embedded_stars import embedded_stars
from torchfair._exact_triangles import meet_exactly
from torchfair.self_intersections import self_intersections
from torchfair.shapes import icosphere

MARGIN = 1e-12


def star(turns: float, count: int, *, closed: bool, height: float = 0.3) -> tuple[np.ndarray, np.ndarray]:
    """Vertex 0 and ``count`` triangles around it."""
    rim = count if closed else count + 1
    angles = 2.0 * np.pi * turns * np.arange(rim) / count
    points = np.stack([np.cos(angles), np.sin(angles), height * np.cos(2.0 * angles)], 1)
    ring = np.arange(count)
    return np.vstack([np.zeros(3), points]), np.stack([0 * ring, 1 + ring, 1 + (ring + 1) % rim], 1)


def is_settled(points: np.ndarray, triangles: np.ndarray, *, closed: bool) -> bool:
    is_open = np.ones(len(points), bool)
    is_open[0] = not closed
    return bool(embedded_stars(points, triangles, is_open, MARGIN)[0])


@pytest.mark.parametrize(
    ("turns", "closed", "settled"),
    [(1.0, True, True), (2.0, True, False), (3.0, True, False), (0.5, False, True), (0.99, False, True),
     (1.2, False, False)],
)  # fmt: skip
@pytest.mark.parametrize("way", [1, -1])
def test_stars_are_settled_by_how_often_they_run_around(turns: float, closed: bool, settled: bool, way: int) -> None:
    """Whichever way they are seen; open ones up to a full turn, closed ones once."""
    points, triangles = star(turns, 12, closed=closed)
    assert is_settled(points, triangles[:, ::way], closed=closed) == settled


def test_folded_and_flat_triangles_settle_nothing() -> None:
    points, triangles = star(1.0, 6, closed=True)
    folded = points.copy()
    folded[2] = 0.9 * folded[4]  # behind its neighbours
    assert not is_settled(folded, triangles, closed=True)
    flat = points.copy()
    flat[2] = 0.5 * flat[1]  # a triangle without area
    assert not is_settled(flat, triangles, closed=True)
    far = points + 1e13  # coordinates that are known to 2e-3: nothing is sure
    assert not embedded_stars(far, triangles, np.zeros(7, bool), MARGIN * 1e13)[0]


@settings(deadline=None, max_examples=300)
@given(st.lists(st.integers(-3, 3), min_size=18, max_size=18))
@example([1, 0, 0, 1, 1, 1, -1, 1, 0, -1, 0, 2, -1, -1, 0, 1, -1, 0])
def test_no_star_is_settled_that_runs_through_itself(numbers: list[int]) -> None:
    """Six triangles around the origin, on a grid, by rational arithmetic."""
    points = np.vstack([np.zeros(3), np.array(numbers, float).reshape(6, 3)])
    triangles = np.array([[0, 1 + i, 1 + (i + 1) % 6] for i in range(6)])
    if not is_settled(points, triangles, closed=True):
        return
    for i, j in itertools.combinations(range(6), 2):
        if len(set(triangles[i]) & set(triangles[j])) == 1:
            assert not meet_exactly(points[triangles[i]], points[triangles[j]], common=True)


def test_a_smooth_mesh_is_settled_everywhere() -> None:
    """Also at its boundary."""
    ball = icosphere(2)
    triangles = ball.topology.corners.view(-1, 3).numpy()
    assert embedded_stars(ball.vertices.numpy(), triangles, np.zeros(len(ball.vertices), bool), MARGIN).all()
    vertices, topology = wavy_grid(5, 5, triangles=True)
    is_open = topology.is_boundary_vertex.numpy()
    assert embedded_stars(vertices.numpy(), topology.corners.view(-1, 3).numpy(), is_open, MARGIN).all()


@pytest.mark.parametrize("noise", [0.05, 0.6, 1.5])
@pytest.mark.parametrize("quads", [False, True])
def test_the_answer_is_the_same_without_settled_stars(
    noise: float, quads: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On meshes that are more and more crumpled."""
    vertices, topology = wavy_grid(9, 9, triangles=not quads)
    shaken = vertices + noise * torch.randn(vertices.shape, generator=torch.Generator().manual_seed(2)).double()
    quick = self_intersections(shaken, topology)
    monkeypatch.setattr(module, "embedded_stars", lambda points, *rest: np.zeros(len(points), bool))
    assert torch.equal(quick, self_intersections(shaken, topology))
    assert len(quick) > 0 or noise == 0.05


def test_faces_that_touch_in_a_vertex_are_looked_at_in_pairs() -> None:
    """Two fans around one vertex may lie over each other, each within half a turn."""
    points = torch.tensor([[0, 0, 0], [2, -1, 0], [2, 1, 0], [1, -2, -1], [1, 2, 1.0]], dtype=torch.float64)
    topology = Topology.from_faces([[0, 1, 2], [0, 3, 4]], manifold="edges")
    assert len(self_intersections(points, topology)) == 1
