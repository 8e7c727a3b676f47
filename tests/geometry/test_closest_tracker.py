"""A tracker follows moving points and finds, bit for bit, what a fresh search finds."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from closest_reference import ridge, same
from geometry_meshes import icosphere
from helpers import DOUBLE, wavy_grid

from torchfair import Topology
from torchfair.geometry._closest_tracker import _below
from torchfair.geometry.closest_point import ClosestPointTracker, ReferenceSurface


@pytest.mark.parametrize("step", [1e-6, 0.02, 0.3, 5.0])
@pytest.mark.parametrize("mesh", [ridge, lambda: wavy_grid(9, 11), lambda: icosphere(1)])
def test_a_tracker_finds_what_a_fresh_search_finds_bit_for_bit(mesh, step):
    vertices, topology = mesh()
    surface = ReferenceSurface(vertices, topology)
    generator = torch.Generator().manual_seed(0)
    tracker = ClosestPointTracker(surface)
    points = vertices.clone()
    for turn in range(12):
        assert same(tracker.closest(points), surface.closest(points))
        points = points + step * torch.randn(points.shape, dtype=DOUBLE, generator=generator)
        if turn == 6:
            points = points[:5]


def test_a_tracker_with_more_equally_near_pieces_than_it_keeps():
    count = 50
    angles = torch.arange(count, dtype=DOUBLE) * (2 * math.pi / count)
    rim = torch.stack([angles.cos(), angles.sin(), torch.zeros_like(angles)], dim=1)
    vertices = torch.cat([torch.tensor([[0.0, 0, 1]], dtype=DOUBLE), rim])
    topology = Topology.from_faces([[0, k + 1, (k + 1) % count + 1] for k in range(count)])
    surface = ReferenceSurface(vertices, topology)
    tracker = surface.tracker()
    generator = torch.Generator().manual_seed(0)
    for shift in (0.0, 0.0, 1e-12, 1e-3, 0.1, 0.0):
        points = torch.tensor([[0.0, 0, 3], [0, 0, 1], [0, 0, -2]], dtype=DOUBLE).repeat(10, 1)
        points = points + shift * torch.randn(points.shape, dtype=DOUBLE, generator=generator)
        assert same(tracker.closest(points), surface.closest(points))


def searched_by(tracker, monkeypatch):
    """The numbers of points that are searched from now on."""
    searched = []
    anchor = tracker._tracker._anchor
    monkeypatch.setattr(tracker._tracker, "_anchor", lambda rows, *rest: (searched.extend(rows), anchor(rows, *rest)))
    return searched


def test_points_that_start_near_the_surface_have_candidates_at_once(monkeypatch):
    vertices, topology = wavy_grid(9, 11)
    far = torch.tensor([[0.0, 0.0, 5.0]], dtype=DOUBLE)
    tracker = ReferenceSurface(vertices, topology).tracker()
    tracker.closest(torch.cat([vertices, far]))
    searched = searched_by(tracker, monkeypatch)
    tracker.closest(torch.cat([vertices, far]) + 1e-3)
    assert searched == [len(vertices)]


def test_a_tracker_searches_only_points_that_went_far(monkeypatch):
    vertices, topology = wavy_grid(9, 11)
    tracker = ReferenceSurface(vertices, topology).tracker()
    tracker.closest(vertices)
    tracker.closest(vertices)  # the points rest: now candidates are gathered
    searched = searched_by(tracker, monkeypatch)
    points = vertices + 1e-3
    points[17] += 3.0
    tracker.closest(points)
    assert searched == [17]


def test_distances_kept_in_single_precision_are_never_larger_than_they_are():
    """A candidate that is rounded up could be left out though it is the nearest."""
    generator = np.random.default_rng(0)
    distances = np.concatenate(
        [10.0 ** generator.uniform(-60, 70, 2000), generator.uniform(0.0, 1.0, 2000), [0.0, 1.0]]
    )
    single = _below(distances)
    assert single.dtype == np.float32
    assert (single.astype(float) <= distances).all()
    within = (distances > 1e-30) & (distances < 1e30)
    assert (distances[within] - single[within] <= 2e-7 * distances[within]).all()


def test_a_tracker_far_beyond_single_precision():
    vertices, topology = wavy_grid(4, 5)
    surface = ReferenceSurface(1e60 * vertices, topology)
    tracker = surface.tracker()
    for shift in (0.0, 1e-3, 2e-3):
        points = 1e60 * (vertices + shift * torch.sin(7.0 * vertices))
        assert same(tracker.closest(points), surface.closest(points))
