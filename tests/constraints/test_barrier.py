from __future__ import annotations

import torch
from helpers import DOUBLE
from hypothesis import given
from hypothesis import strategies as st

from torchfair.constraints import barrier


def at(margin: float, safe: float = 0.5) -> torch.Tensor:
    return barrier(torch.tensor(margin, dtype=DOUBLE), torch.tensor(safe, dtype=DOUBLE))


@given(st.floats(0.01, 100.0), st.floats(1.0, 50.0))
def test_silent_in_the_safe_region(safe: float, factor: float) -> None:
    assert float(at(factor * safe, safe)) == 0.0


@given(st.floats(0.01, 100.0), st.floats(1e-9, 10.0))
def test_infinite_beyond_the_bound(safe: float, beyond: float) -> None:
    assert float(at(-beyond, safe)) == float("inf")


def test_ten_at_the_bound_and_continuous_at_the_safe_margin() -> None:
    assert abs(float(at(0.0)) - 10.0) < 1e-12
    assert float(at(0.5 * (1 - 1e-12))) < 1e-11


@given(st.floats(0.0, 0.49), st.floats(1e-3, 0.01))
def test_falls_strictly_with_the_margin(margin: float, step: float) -> None:
    assert float(at(margin)) > float(at(margin + step))


def test_derivative_is_finite_everywhere_and_zero_where_silent() -> None:
    margin = torch.tensor([-1.0, 0.0, 0.25, 0.5, 2.0], dtype=DOUBLE, requires_grad=True)
    value = barrier(margin, torch.tensor(0.5, dtype=DOUBLE))
    (slope,) = torch.autograd.grad(value[torch.isfinite(value)].sum(), margin)
    assert torch.isfinite(slope).all()
    assert (slope[1:3] < 0).all()
    assert (slope[3:] == 0).all()


def test_nan_does_not_pass_for_safe() -> None:
    assert barrier(torch.tensor(torch.nan), torch.tensor(1.0)).isnan()
