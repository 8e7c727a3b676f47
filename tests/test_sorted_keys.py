"""The stable order of the numbers of edges, whether a number and its place fit into one word or not."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from torchfair._sorted_keys import sort_keys


@given(
    bits=st.integers(0, 62),
    size=st.integers(0, 300),
    distinct=st.integers(1, 300),
    seed=st.integers(0, 2**32 - 1),
)
def test_order_is_stable(bits: int, size: int, distinct: int, seed: int) -> None:
    generator = np.random.default_rng(seed)
    some = generator.integers(0, 2**bits, distinct, endpoint=True)
    keys = some[generator.integers(0, distinct, size)]
    _is_stable(keys)


@pytest.mark.parametrize("size", [2, 3, 4, 5, 256, 257])
@pytest.mark.parametrize("spare", [-1, 0, 1])
def test_about_the_length_of_a_word(size: int, spare: int) -> None:
    largest = 2 ** min(64 - (size - 1).bit_length() - spare, 62)
    keys = np.resize([largest, largest - 1, 0, largest - 1], size)
    _is_stable(keys)


@pytest.mark.parametrize("most", [2**40, 2**60])
def test_many(most: int) -> None:
    _is_stable(np.random.default_rng(0).integers(0, most, 40_000) // 7 * 7)


def _is_stable(keys: np.ndarray) -> None:
    order, ordered = sort_keys(keys)
    assert order.dtype == ordered.dtype == np.int64
    np.testing.assert_array_equal(order, np.argsort(keys, kind="stable"))
    np.testing.assert_array_equal(ordered, np.sort(keys))
