"""Factors in single precision: refined until the matrix in double precision agrees, replaced where that fails."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import scipy.sparse as sp
import torch
from torch import Tensor

from torchfair.errors import SingularSystemError
from torchfair.linear import LowerTriangle, MixedPrecision, RslabDirect, factorise
from torchfair.projection import ElementTerm, GuidedProjection

with_rslab = pytest.mark.skipif(not RslabDirect.available(), reason="rslab is an extra")
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


@with_rslab
@pytest.mark.parametrize("holding", [1.0, 1e-2, 1e-4])
def test_single_precision_suffices_for_good_matrices(holding: float) -> None:
    remainder, solver = relative_remainder(holding)
    assert solver.single
    assert remainder < 1e-5


@with_rslab
@pytest.mark.parametrize("holding", [1e-9, 1e-11])
def test_double_precision_takes_over_for_bad_matrices(holding: float) -> None:
    remainder, solver = relative_remainder(holding)
    assert not solver.single
    assert remainder < 1e-5


@with_rslab
def test_double_precision_from_the_first_on() -> None:
    solver, matrix = RslabDirect(mixed=False), sp.diags([[-1.0] * 59, [3.0] * 60, [-1.0] * 59], [-1, 0, 1]).tocsr()
    right = torch.rand(60, 40, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    solution = factorise(matrix, solver=solver).solve(right).values
    assert not solver.single
    assert float((torch.from_numpy(matrix.toarray()) @ solution - right).abs().max()) < 1e-14


@with_rslab
def test_a_singular_matrix_is_refused_in_both_precisions() -> None:
    problem = chain(1.0)
    system = problem.structure.linearise({"x": torch.zeros(LENGTH, 1, dtype=torch.float64)})
    solver = RslabDirect()
    solver.prepare(problem.structure)
    with pytest.raises(SingularSystemError):
        solver.factorise(system, torch.full((LENGTH,), -100.0, dtype=torch.float64))


class Rough(MixedPrecision):
    """Dense inverses; the one in single precision is wrong by a factor."""

    name = "rough"

    def __init__(self, factor: float) -> None:
        self.factor_of_single, self.calls = factor, []

    def order(self, lower: LowerTriangle) -> None:
        self.calls.append("order")

    def numeric(self, values: np.ndarray, single: bool) -> Callable[[np.ndarray], np.ndarray]:
        lower = self.places.matrix(values).toarray()
        inverse = np.linalg.inv(lower + lower.T - np.diag(np.diag(lower)))
        self.calls.append("single" if single else "double")
        return lambda right: (self.factor_of_single if single else 1.0) * inverse @ right


@pytest.mark.parametrize(
    ("factor", "calls"), [(0.99, ["single"]), (0.5, ["single", "double"]), (0.02, ["single", "double"])]
)
@pytest.mark.parametrize("columns", [(), (2,)])
def test_refinement_that_hardly_gains_gives_way_to_double_precision(
    factor: float, calls: list[str], columns: tuple[int, ...]
) -> None:
    chain = sp.diags([[-1.0] * 9, [2.5] * 10, [-1.0] * 9], [-1, 0, 1], format="csr")
    right = torch.randn(10, *columns, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    solver = Rough(factor)
    for _ in range(2):
        solution = factorise(chain, solver=solver).solve(right, 1e-2).values
        left = right - torch.from_numpy(chain @ solution.numpy())
        assert float(left.norm()) <= 1e-12 * float(right.norm())
    # The analysis is kept; double precision is, too.
    assert solver.calls == ["order", *calls, calls[-1]]
    assert solver.single == (calls[-1] == "single")
