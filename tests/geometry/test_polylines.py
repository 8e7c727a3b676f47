from __future__ import annotations

from fractions import Fraction

import pytest
import torch
from helpers import DOUBLE, wavy_grid

from torchfair import ShapeError
from torchfair.geometry import second_differences

TRIPLES = torch.tensor([[0, 1, 2], [3, 4, 5], [2, 7, 12]])


def test_equals_the_formula_for_batches_too():
    vertices, _ = wavy_grid(5, 5)
    batch = torch.stack([vertices, vertices**2])
    expected = torch.stack([batch[:, p] - 2 * batch[:, v] + batch[:, n] for p, v, n in TRIPLES.tolist()], dim=1)
    torch.testing.assert_close(second_differences(batch, TRIPLES), expected)
    mapped = torch.func.vmap(lambda v: second_differences(v, TRIPLES))(batch)
    torch.testing.assert_close(mapped, expected)


def test_of_a_parabola_is_its_second_derivative():
    x = torch.arange(7, dtype=DOUBLE)
    points = torch.stack([x, 3 * x**2 - x, torch.zeros_like(x)], dim=-1)
    triples = torch.stack([torch.arange(5), torch.arange(1, 6), torch.arange(2, 7)], dim=1)
    expected = torch.tensor([0.0, 6, 0], dtype=DOUBLE).expand(5, 3)
    torch.testing.assert_close(second_differences(points, triples), expected)


def test_keeps_its_digits_far_from_the_origin():
    """Against exact rational arithmetic on the same rounded input."""
    far = wavy_grid(5, 5)[0] / 1000 + 1e6
    exact = [[Fraction(x) for x in row] for row in far.tolist()]
    expected = [[float(exact[p][k] - 2 * exact[v][k] + exact[n][k]) for k in range(3)] for p, v, n in TRIPLES.tolist()]
    torch.testing.assert_close(
        second_differences(far, TRIPLES), torch.tensor(expected, dtype=DOUBLE), rtol=1e-15, atol=1e-18
    )


def test_no_triples_give_no_rows():
    vertices, _ = wavy_grid(5, 5)
    assert second_differences(vertices, TRIPLES[:0]).shape == (0, 3)


@pytest.mark.parametrize("triples", [TRIPLES[:, :2], TRIPLES.double(), TRIPLES.flatten(), [[0, 1, 2]]])
def test_refuses_other_triples(triples):
    with pytest.raises(ShapeError, match=r"triples: expected an integer tensor \(N, 3\)"):
        second_differences(wavy_grid(5, 5)[0], triples)
