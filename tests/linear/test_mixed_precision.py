"""Factors in single precision: refined until the matrix in double precision agrees, replaced where that fails."""

from __future__ import annotations

import pytest
import torch
from torch import Tensor

from torchfair.errors import SingularSystemError
from torchfair.linear import RslabDirect
from torchfair.projection import ElementTerm, GuidedProjection

pytestmark = pytest.mark.skipif(not RslabDirect.available(), reason="rslab is an extra")
LENGTH = 400


def bend(x: Tensor) -> Tensor:
    return x[0, 0] - 2.0 * x[1, 0] + x[2, 0] + 0.01 * x[1, 0] ** 2


def chain(holding: float) -> GuidedProjection:
    """A bent strip held by springs: the weaker they are, the worse the condition of its normal matrix."""
    triples = torch.arange(LENGTH - 2)[:, None] + torch.arange(3)
    every = torch.arange(LENGTH)[:, None]
    terms = [
        ElementTerm("bend", bend, [("x", triples)], weight=1.0),
        ElementTerm("held", lambda x: x[0, 0] - 1.0, [("x", every)], weight=holding),
    ]
    return GuidedProjection({"x": torch.zeros(LENGTH, 1, dtype=torch.float64)}, terms)


def relative_remainder(holding: float) -> tuple[float, RslabDirect]:
    problem = chain(holding)
    start = 0.1 * torch.randn(LENGTH, 1, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    system = problem.structure.linearise({"x": start})
    damping = torch.full((LENGTH,), 1e-14, dtype=torch.float64)
    solver = RslabDirect()
    solver.prepare(problem.structure)
    change = solver.factorise(system, damping).solve(-system.gradient, 1e-2).values
    jacobian = system.jacobian.to_dense()
    left = jacobian.T @ (jacobian @ change) + damping * change + system.gradient
    return float(left.norm() / system.gradient.norm()), solver


@pytest.mark.parametrize("holding", [1.0, 1e-2, 1e-4])
def test_single_precision_suffices_for_good_matrices(holding: float) -> None:
    remainder, solver = relative_remainder(holding)
    assert solver.single
    assert remainder < 1e-5


@pytest.mark.parametrize("holding", [1e-9, 1e-11])
def test_double_precision_takes_over_for_bad_matrices(holding: float) -> None:
    remainder, solver = relative_remainder(holding)
    assert not solver.single
    assert remainder < 1e-5


def test_a_singular_matrix_is_refused_in_both_precisions() -> None:
    problem = chain(1.0)
    system = problem.structure.linearise({"x": torch.zeros(LENGTH, 1, dtype=torch.float64)})
    solver = RslabDirect()
    solver.prepare(problem.structure)
    with pytest.raises(SingularSystemError):
        solver.factorise(system, torch.full((LENGTH,), -100.0, dtype=torch.float64))
