"""The tree of boxes misses nothing and repeats nothing."""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from torchfair.geometry._closest_boxes import BoxTree


@settings(max_examples=40, deadline=None)
@given(st.integers(1, 70), st.integers(2, 4), st.integers(0, 10**6), st.floats(0, 4))
def test_box_tree_returns_every_box_within_reach_once(count, dimension, seed, reach):
    generator = np.random.default_rng(seed)
    low = generator.integers(-3, 4, size=(dimension, count)).astype(float)
    high = low + generator.integers(0, 3, size=(dimension, count))
    points = generator.uniform(-5, 5, size=(dimension, 6))
    gaps = np.maximum(np.maximum(low[:, None] - points[:, :, None], points[:, :, None] - high[:, None]), 0)
    expected = np.argwhere((gaps**2).sum(0) <= reach * reach)
    tree = BoxTree(low, high)
    found = tree.pairs(points, np.full(6, reach), 10**6)
    assert sorted(zip(*found, strict=True)) == sorted(map(tuple, expected))
    assert (np.diff(found[0]) >= 0).all()
    assert ((tree.guess(points) >= 0) & (tree.guess(points) < count)).all()
