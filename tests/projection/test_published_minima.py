"""Least-squares problems of More, Garbow and Hillstrom (1981) with the default settings, from near and far starts."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from more_garbow_hillstrom import PROBLEMS, Problem
from scipy.optimize import least_squares

from torchfair.projection import ProjectionResult, ProjectionSettings, Status, guided_projection

_BY_NAME = {problem.name: problem for problem in PROBLEMS}
_FAR = [(problem.name, factor) for problem in PROBLEMS for factor in problem.scaled_starts if factor > 1]
_NOT_REACHED = {
    ("bard", 10): "the iteration follows a path to infinity, where the sum of squares tends to 17.4286",
    ("bard", 100): "the same",
    ("biggs", 100): "a path to infinity, where the sum of squares tends to 0.3063668",
    ("box", 10): "a path to infinity, where the sum of squares tends to 0.07558874",
    ("box", 100): "the same",
}


def solve(problem: Problem, factor: int) -> ProjectionResult:
    settings = ProjectionSettings(max_iterations=1000, solver="dense")
    return guided_projection(problem.scaled_start(factor), [problem.term], settings=settings)


def is_minimum(problem: Problem, value: float, *, factor: int = 1) -> bool:
    """Whether a sum of squares is one of those published; of zero there must be ten digits, as seen from the start."""
    start = float(problem.residuals(problem.scaled_start(factor)["x"][:, 0]).square().sum())
    return any(abs(value - known) <= (1e-5 * known if known else 1e-10 * start) for known in problem.minima)


@pytest.mark.parametrize("name", _BY_NAME)
def test_data_and_formulas_give_the_published_minimum(name: str) -> None:
    """Another solver reaches a published minimum; a published minimiser has it."""
    problem = _BY_NAME[name]
    if problem.minimiser is not None:
        value = float(problem.residuals(problem.minimiser).square().sum())
        assert value == pytest.approx(problem.minima[0], rel=1e-5, abs=1e-20)

    def residuals(x: np.ndarray) -> np.ndarray:
        values: np.ndarray = problem.residuals(torch.tensor(x)).numpy().copy()
        return values

    def jacobian(x: np.ndarray) -> np.ndarray:
        arguments = problem.term.arguments({"x": torch.tensor(x)[:, None]})
        values: np.ndarray = problem.term.jacobians(arguments).reshape(-1, len(x)).numpy().copy()
        return values

    found = least_squares(
        residuals,
        problem.start.numpy(),
        jacobian,
        method="trf",
        x_scale="jac",
        max_nfev=5000,
        xtol=1e-12,
        ftol=1e-12,
        gtol=1e-12,
    )
    assert is_minimum(problem, 2 * found.cost)


@pytest.mark.parametrize("name", _BY_NAME)
def test_minimum_is_reached_from_the_published_start(name: str) -> None:
    problem = _BY_NAME[name]
    result = solve(problem, 1)
    assert result.status.converged, result.message
    assert is_minimum(problem, 2 * result.merit), result.message


@pytest.mark.slow
@pytest.mark.parametrize(("name", "factor"), _FAR)
def test_converged_is_said_only_at_a_minimum(name: str, factor: int) -> None:
    """From ten and a hundred times the start; where no minimum is reached, the status says so."""
    problem = _BY_NAME[name]
    result = solve(problem, factor)
    if (name, factor) in _NOT_REACHED:
        assert result.status in (Status.MAX_ITERATIONS, Status.STALLED), _NOT_REACHED[name, factor]
    else:
        assert result.status.converged, result.message
        assert is_minimum(problem, 2 * result.merit, factor=factor), result.message
