from __future__ import annotations

import math

import hypothesis.strategies as st
import pytest
import torch
from helpers import DOUBLE
from hypothesis import given, settings

from torchfair.geometry import frobenius_norms, nuclear_norms

entries = st.floats(-1e3, 1e3).map(lambda x: round(x, 3))  # equal and zero entries turn up


def symmetric(a: float, b: float, d: float) -> torch.Tensor:
    return torch.tensor([[a, b], [b, d]], dtype=DOUBLE)


@settings(max_examples=200, deadline=None)
@given(a=entries, b=entries, d=entries)
def test_agree_with_singular_values(a, b, d):
    matrix = symmetric(a, b, d)
    values = torch.linalg.svdvals(matrix)
    torch.testing.assert_close(nuclear_norms(matrix), values.sum(), rtol=1e-12, atol=1e-10)
    torch.testing.assert_close(frobenius_norms(matrix), values.square().sum().sqrt(), rtol=1e-12, atol=1e-10)


@settings(max_examples=100, deadline=None)
@given(first=st.tuples(entries, entries, entries), second=st.tuples(entries, entries, entries))
def test_gradients_are_subgradients(first, second):
    """A convex function lies above every tangent plane, at its kinks too."""
    start, end = symmetric(*first), symmetric(*second)
    for norms in (nuclear_norms, frobenius_norms):
        # The entry below the diagonal is not read: its share of the derivative is with the one above.
        slope = torch.func.grad(norms)(start)
        tangent = norms(start) + (slope * (end - start)).sum()
        assert norms(end) >= tangent - 1e-9 * (1 + tangent.abs())


KINKS = {
    "flat": (0.0, 0.0, 0.0),
    "umbilic": (2.0, 0.0, 2.0),
    "minimal": (1.0, 0.0, -1.0),
    "cylinder": (1.0, 0.0, 0.0),
    "slanted cylinder": (1.0, 1.0, 1.0),
}


@pytest.mark.parametrize("matrix", KINKS.values(), ids=KINKS.keys())
@pytest.mark.parametrize("norms", [nuclear_norms, frobenius_norms])
def test_derivatives_are_finite_and_the_same_in_both_modes(norms, matrix):
    start = symmetric(*matrix)
    torch.testing.assert_close(torch.func.jacfwd(norms)(start), torch.func.jacrev(norms)(start))
    assert torch.func.jacrev(norms)(start).isfinite().all()
    assert torch.func.jacrev(torch.func.jacrev(norms))(start).isfinite().all()


def test_umbilics_are_smooth_in_the_nuclear_norm():
    variable = symmetric(*KINKS["umbilic"]).requires_grad_()
    assert torch.autograd.gradcheck(nuclear_norms, variable)
    assert torch.autograd.gradgradcheck(nuclear_norms, variable)


def test_values_of_the_cases():
    values = [nuclear_norms(symmetric(*matrix)).item() for matrix in KINKS.values()]
    assert values == pytest.approx([0, 4, 2, 1, 2])
    values = [frobenius_norms(symmetric(*matrix)).item() for matrix in KINKS.values()]
    assert values == pytest.approx([0, math.sqrt(8), math.sqrt(2), 1, 2])


def test_norms_bound_how_fast_normals_turn():
    """Inequality (3) of the paper, |W x| <= |W| |x|, for both norms, with equality for some x on cylinders."""
    generator = torch.Generator().manual_seed(0)
    matrices = torch.randn(200, 2, 2, dtype=DOUBLE, generator=generator)
    matrices = matrices + matrices.mT
    steps = torch.randn(200, 2, dtype=DOUBLE, generator=generator)
    turns = torch.linalg.vector_norm((matrices @ steps[..., None]).squeeze(-1), dim=-1)
    for norms in (nuclear_norms, frobenius_norms):
        assert (turns <= norms(matrices) * torch.linalg.vector_norm(steps, dim=-1)).all()
        cylinder = symmetric(3.0, 0.0, 0.0)
        assert (
            norms(cylinder).item() == torch.linalg.vector_norm(cylinder @ torch.tensor([1.0, 0.0]).to(cylinder)).item()
        )
