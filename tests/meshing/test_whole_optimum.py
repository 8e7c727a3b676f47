"""Least squares of a map in its whole numbers, against dense ones."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
import scipy.sparse as sp
from meshing_tools import cut, ellipsoid, irregular, problem_of, punched

from torchfair.linear import LinearSolver, RslabDirect, ScipyDirect
from torchfair.meshing import whole_optimum as module
from torchfair.meshing.integers import IntegerSplit
from torchfair.meshing.whole_optimum import WholeOptimum, real_optimum, whole_optimum
from torchfair.shapes import Torus, icosphere

SOLVERS = [
    ScipyDirect,
    pytest.param(RslabDirect, marks=pytest.mark.skipif(not RslabDirect.available(), reason="rslab")),
]
ROUND = icosphere(3)
SHAPES = {
    "ellipsoid": ellipsoid(3),
    "sphere with holes": punched(ROUND.vertices, ROUND.topology, 0, 20, 40),
    "torus": irregular(Torus()),  # without nodes, so that one vertex is held
}


class Problem(NamedTuple):
    """``|rows @ parts - right|^2`` with 30 free values and 70 whole numbers by 90 others, more than one portion."""

    rows: sp.csr_matrix
    right: np.ndarray
    split: IntegerSplit


@pytest.fixture(scope="module")
def problem() -> Problem:
    chance = np.random.default_rng(3)

    def sparse(rows: int, columns: int) -> sp.csr_matrix:
        return sp.csr_matrix(np.where(chance.random((rows, columns)) < 0.2, chance.normal(size=(rows, columns)), 0))

    basis = chance.integers(-1, 2, size=(90, 70))
    split = IntegerSplit(sparse(120, 30), sparse(120, 90), basis, chance.normal(size=120))
    return Problem(sparse(200, 120), chance.normal(size=200), split)


def dense(problem: Problem) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Rows by free values and by whole numbers, and the right-hand side."""
    rows, split = problem.rows.toarray(), problem.split
    whole = split.whole.toarray() @ split.basis
    return rows @ split.free.toarray(), rows @ whole, problem.right - rows @ split.fixed


def residual(problem: Problem, parts: np.ndarray) -> float:
    return float(((problem.rows @ parts - problem.right) ** 2).sum())


@pytest.fixture(scope="module", params=SOLVERS)
def optimum(problem: Problem, request: pytest.FixtureRequest) -> WholeOptimum:
    return whole_optimum(*problem, request.param())


def test_free_values_follow_whole_numbers(problem: Problem, optimum: WholeOptimum) -> None:
    free, whole, right = dense(problem)
    for vector in (np.zeros(70), np.arange(70) - 30, 1e3 * np.ones(70)):
        x = np.linalg.lstsq(free, right - whole @ vector)[0]
        split = problem.split
        wanted = split.free @ x + split.whole @ (split.basis @ vector) + split.fixed
        assert np.allclose(optimum.parts(vector), wanted, rtol=1e-9, atol=1e-9)


def test_metric_and_target_are_those_of_the_least_squares(problem: Problem, optimum: WholeOptimum) -> None:
    """Residuals over the least one are the squared distance from the target, but for the scale of the norm."""
    best = residual(problem, optimum.parts(optimum.target))
    vectors = np.random.default_rng(0).integers(-3, 4, size=(20, 70))
    over = [residual(problem, optimum.parts(vector)) - best for vector in vectors]
    away = vectors - optimum.target
    found = np.einsum("ni,ij,nj->n", away, optimum.metric, away)
    assert np.allclose(over / found, over[0] / found[0], rtol=1e-6)
    assert np.linalg.eigvalsh(optimum.metric)[-1] == pytest.approx(1)
    free, whole, right = dense(problem)
    assert best == pytest.approx(np.linalg.lstsq(np.hstack([free, whole]), right)[1][0], rel=1e-9)


def test_what_rows_see(optimum: WholeOptimum) -> None:
    """Of more rows than one portion, of which one is empty."""
    chance = np.random.default_rng(1)
    rows = sp.csr_matrix(np.where(chance.random((40, 120)) < 0.1, 1.0, 0) * (np.arange(40) > 0)[:, None])
    slopes, offsets = optimum.seen_by(rows)
    for vector in (np.zeros(70), np.arange(70)):
        assert np.allclose(slopes @ vector + offsets, rows @ optimum.parts(vector), atol=1e-8)
    slopes, offsets = optimum.seen_by(rows[:0])
    assert slopes.shape == (0, 70)
    assert offsets.shape == (0,)


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_real_optimum_has_the_least_residual(problem: Problem, solver: type[LinearSolver]) -> None:
    free, whole, right = dense(problem)
    least = np.linalg.lstsq(np.hstack([free, whole]), right)[1][0]
    assert residual(problem, real_optimum(*problem, solver())) == pytest.approx(least, rel=1e-9)


def test_columns_are_solved_for_in_portions(problem: Problem, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whatever their size; no more of them are held at once."""
    once = whole_optimum(*problem, ScipyDirect())
    seen: list[int] = []
    solved = module.solved

    def noted(factor: module.Factor, right: np.ndarray) -> np.ndarray:
        seen.append(1 if right.ndim == 1 else right.shape[1])
        return solved(factor, right)

    monkeypatch.setattr(module, "solved", noted)
    monkeypatch.setattr(module, "_AT_ONCE", 8)
    assert np.allclose(whole_optimum(*problem, ScipyDirect()).metric, once.metric, atol=1e-12)
    assert max(seen) == 8
    assert sum(seen) == 71  # and the free values


def test_nothing_is_whole(problem: Problem) -> None:
    split = IntegerSplit(problem.split.free, problem.split.whole, np.zeros((90, 0), np.int64), problem.split.fixed)
    optimum = whole_optimum(problem.rows, problem.right, split, ScipyDirect())
    assert optimum.metric.shape == (0, 0)
    assert np.allclose(optimum.parts(optimum.target), real_optimum(problem.rows, problem.right, split, ScipyDirect()))


@pytest.mark.parametrize("name", SHAPES)
def test_the_real_optimum_is_that_of_whole_numbers_at_the_target(name: str) -> None:
    frames, graph = cut(*SHAPES[name])
    problem = problem_of(frames, graph, 0.2)[0]
    assert problem.split.basis.shape[1] > 0
    assert problem.split.fixed.any() == (name == "torus")
    optimum, jacobians = problem._optimum, problem.real_jacobians
    other = (problem.jacobians(np.arange(len(problem.density))) @ optimum.parts(optimum.target)).reshape(4, -1)
    assert np.abs(jacobians - other).max() < 1e-5 * np.abs(other).max()
