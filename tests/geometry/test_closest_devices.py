"""Closest points of points on another device: one operator for torch, whose answer lies where the points are."""

from __future__ import annotations

import copy
import gc
import pickle
from collections.abc import Callable
from contextlib import nullcontext
from typing import NamedTuple

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from pretended_device import PRETENDED, PretendedDevice
from torch import Tensor
from torch._subclasses.fake_tensor import FakeTensorMode

from torchfair.geometry import ReferenceCurve, ReferenceCurves, ReferenceSurface
from torchfair.geometry import _closest_query as query

VERTICES, TOPOLOGY = wavy_grid(5, 6)
LINE = VERTICES[:7]
POINTS = VERTICES + 0.2 * VERTICES.roll(1, 1)
Query = Callable[[Tensor], NamedTuple]


def by_curves() -> Query:
    curves = ReferenceCurves([LINE, LINE + 1.0], [True, False])
    return lambda points: curves.closest(points, torch.arange(points.shape[0], device=points.device) % 2)


QUERIES: dict[str, Callable[[], Query]] = {
    "surface": lambda: ReferenceSurface(VERTICES, TOPOLOGY).closest,
    "tracker": lambda: ReferenceSurface(VERTICES, TOPOLOGY).tracker().closest,
    "curve": lambda: ReferenceCurve(LINE, closed=False).closest,
    "curves": by_curves,
}
every_query = pytest.mark.parametrize("make", QUERIES.values(), ids=QUERIES)
both_dtypes = pytest.mark.parametrize("dtype", [torch.float32, DOUBLE])


@every_query
@both_dtypes
def test_answers_are_the_same_bit_for_bit_on_the_device_of_the_points(make, dtype, device):
    closest, points = make(), POINTS.to(dtype)
    there = points.to(device)
    with PretendedDevice(strict=True) if device == PRETENDED else nullcontext():
        found = closest(there)
    for name, expected in make()(points)._asdict().items():
        answer = getattr(found, name)
        assert answer.device == device, name
        assert answer.dtype == expected.dtype, name
        assert torch.equal(answer.cpu(), expected), name


@every_query
@both_dtypes
def test_fake_points_have_fake_answers_of_the_right_kind(make, dtype):
    """What is told to torch about the answer is true."""
    closest, points = make(), POINTS.to(dtype)
    with FakeTensorMode() as fake:
        found = closest(fake.from_tensor(points).to(PRETENDED))
    for name, expected in closest(points)._asdict().items():
        answer = getattr(found, name)
        assert answer.device == PRETENDED, name
        assert (answer.shape, answer.stride(), answer.dtype) == (expected.shape, expected.stride(), expected.dtype)


def test_copies_search_for_themselves():
    """The operator knows searchers by numbers, which copies must not share."""
    surface = ReferenceSurface(VERTICES, TOPOLOGY)
    for kind in (surface, surface.tracker()):
        kind.closest(POINTS)
        others = [copy.copy(kind), copy.deepcopy(kind), pickle.loads(pickle.dumps(kind))]
        del kind
        for other in others:
            assert torch.equal(other.closest(POINTS).positions, surface.closest(POINTS).positions)


def test_searchers_are_not_kept_alive():
    gc.collect()
    before = len(query._SEARCHERS)
    surface = ReferenceSurface(VERTICES, TOPOLOGY)
    surface.closest(POINTS)
    surface.tracker().closest(POINTS)
    del surface
    gc.collect()
    assert len(query._SEARCHERS) <= before
