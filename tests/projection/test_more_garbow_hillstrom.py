"""The engine as a general least-squares solver: problems of More, Garbow and Hillstrom (1981).

Each has its published start and minimum; every row of the problem is one element.
"""

from __future__ import annotations

import math

import pytest
import torch
from torch import Tensor

from torchfair.projection import ElementTerm, ProjectionSettings, guided_projection

ROOT5, ROOT10, ROOT90 = math.sqrt(5), math.sqrt(10), math.sqrt(90)


def rosenbrock(x: Tensor) -> Tensor:
    return torch.stack([10 * (x[1] - x[0] ** 2), 1 - x[0]])


def powell_singular(x: Tensor) -> Tensor:
    a, b, c, d = x
    return torch.stack([a + 10 * b, ROOT5 * (c - d), (b - 2 * c) ** 2, ROOT10 * (a - d) ** 2])


def wood(x: Tensor) -> Tensor:
    a, b, c, d = x
    last = [ROOT10 * (b + d - 2), (b - d) / ROOT10]
    return torch.stack([10 * (b - a**2), 1 - a, ROOT90 * (d - c**2), 1 - c, *last])


def brown_badly_scaled(x: Tensor) -> Tensor:
    return torch.stack([x[0] - 1e6, x[1] - 2e-6, x[0] * x[1] - 2])


def freudenstein_roth(x: Tensor) -> Tensor:
    a, b = x
    return torch.stack([-13 + a + ((5 - b) * b - 2) * b, -29 + a + ((b + 1) * b - 14) * b])


def helical_valley(x: Tensor) -> Tensor:
    a, b, c = x
    angle = torch.atan(b / a) / (2 * math.pi) + torch.where(a < 0, 0.5, 0.0)
    return torch.stack([10 * (c - 10 * angle), 10 * (torch.sqrt(a**2 + b**2) - 1), c])


def box_row(x: Tensor, t: Tensor) -> Tensor:
    return torch.exp(-t * x[0]) - torch.exp(-t * x[1]) - x[2] * (torch.exp(-t) - torch.exp(-10 * t))


def unknowns_term(residual: object, count: int, rows: Tensor | None = None) -> ElementTerm:
    """The unknowns are rows of width one; the element sees them as a vector."""
    elements = 1 if rows is None else rows.shape[0]
    stencil = [("x", torch.arange(count).repeat(elements, 1))]
    if rows is None:
        return ElementTerm("rows", lambda x: residual(x[:, 0]), stencil)
    return ElementTerm("rows", lambda x, t: residual(x[:, 0], t), stencil, data=(rows,))


PROBLEMS = {
    # name: (term, start, published minimum of the sum of squares, published minimiser or None)
    "rosenbrock": (unknowns_term(rosenbrock, 2), [-1.2, 1.0], 0.0, [1.0, 1.0]),
    "powell_singular": (unknowns_term(powell_singular, 4), [3.0, -1.0, 0.0, 1.0], 0.0, None),
    "wood": (unknowns_term(wood, 4), [-3.0, -1.0, -3.0, -1.0], 0.0, [1.0] * 4),
    "brown_badly_scaled": (unknowns_term(brown_badly_scaled, 2), [1.0, 1.0], 0.0, [1e6, 2e-6]),
    "freudenstein_roth": (unknowns_term(freudenstein_roth, 2), [0.5, -2.0], 48.98425, [11.4128, -0.896805]),
    "helical_valley": (unknowns_term(helical_valley, 3), [-1.0, 0.0, 0.0], 0.0, [1.0, 0.0, 0.0]),
    "box": (unknowns_term(box_row, 3, 0.1 * torch.arange(1, 11).double()), [0.0, 10.0, 20.0], 0.0, None),
}


@pytest.mark.parametrize("solver", ["dense", "scipy", "cg"])
@pytest.mark.parametrize("name", PROBLEMS)
def test_published_minimum_is_reached(name: str, solver: str) -> None:
    term, start, minimum, minimiser = PROBLEMS[name]
    x = torch.tensor(start, dtype=torch.float64)[:, None]
    settings = ProjectionSettings(
        max_iterations=1000, solver=solver, merit_tolerance=1e-16, step_tolerance=1e-15, gradient_tolerance=1e-15
    )
    result = guided_projection({"x": x}, [term], settings=settings)
    assert 2 * result.merit == pytest.approx(minimum, rel=1e-6, abs=1e-16), (result.status, result.iterations)
    if minimiser is not None:
        torch.testing.assert_close(
            result.blocks["x"][:, 0], torch.tensor(minimiser, dtype=torch.float64), rtol=1e-5, atol=1e-7
        )
    merits = [record.merit for record in result.history]
    assert merits == sorted(merits, reverse=True)
