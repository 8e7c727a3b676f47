"""Converged is said only at minima, in whatever units; what a run does where it comes to rest is the user's choice."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair.errors import SettingsError
from torchfair.projection import (
    ElementTerm,
    GuidedProjection,
    IterationRecord,
    ProjectionResult,
    ProjectionSettings,
    Status,
    guided_projection,
    init,
)
from torchfair.projection.certificate import certified
from torchfair.projection.result import message_of

PAIR = [("u", torch.zeros(1, 1, dtype=torch.int64)), ("v", torch.zeros(1, 1, dtype=torch.int64))]


def rosenbrock(scale: float, blocks: int, solver: str) -> ProjectionResult:
    """In units (s, 1/s): the unknowns are s u and v / s."""

    def one(x: Tensor) -> Tensor:
        return torch.stack([10 * (x[1, 0] * scale - (x[0, 0] / scale) ** 2), 1 - x[0, 0] / scale])

    def two(u: Tensor, v: Tensor) -> Tensor:
        return one(torch.cat([u, v]))

    settings = ProjectionSettings(max_iterations=200, solver=solver)
    u, v = torch.tensor([[-1.2 * scale]], dtype=DOUBLE), torch.tensor([[1.0 / scale]], dtype=DOUBLE)
    if blocks == 2:
        return guided_projection({"u": u, "v": v}, [ElementTerm("rosenbrock", two, PAIR)], settings=settings)
    term = ElementTerm("rosenbrock", one, [("x", torch.tensor([[0, 1]]))])
    return guided_projection({"x": torch.cat([u, v])}, [term], settings=settings)


@pytest.mark.parametrize("solver", ["dense", "scipy"])
@pytest.mark.parametrize("blocks", [1, 2])
def test_steps_do_not_depend_on_units(blocks: int, solver: str) -> None:
    results = [rosenbrock(scale, blocks, solver) for scale in (1.0, 1e3, 1e6, 1e8)]
    assert len({result.iterations for result in results}) == 1
    assert all(result.status.converged and result.merit < 1e-18 for result in results)


def unknown(x: float) -> dict[str, Tensor]:
    return {"x": torch.full((1, 1), x, dtype=DOUBLE)}


def term(residual: object, **options: object) -> ElementTerm:
    return ElementTerm("r", residual, [("x", torch.zeros(1, 1, dtype=torch.int64))], **options)


def test_a_guard_that_refuses_everything_is_no_convergence() -> None:
    result = guided_projection(unknown(3.0), [term(lambda x: x[0, 0] + 1.0)], guard=lambda state, trial: False)
    assert result.status is Status.STALLED
    assert not result.status.converged
    assert "not converged" in result.message
    assert result.gradient == pytest.approx(1.0)


def test_the_scaled_gradient_is_a_cosine() -> None:
    """Between the residual (x, 1) and the column (1, 0) of the Jacobian; it has no unit and no weight."""
    for x, weight, size in ((2.0, 1.0, 1.0), (2.0, 1e6, 1.0), (2.0, 1.0, 1e4)):
        both = term(lambda x, size=size: torch.stack([x[0, 0], torch.full_like(x[0, 0], size)]), weight=weight)
        result = guided_projection(unknown(x * size), [both], settings=ProjectionSettings(max_iterations=0))
        assert result.gradient == pytest.approx(2.0 / 5.0**0.5)


SLOW = [term(lambda x: 1e-4 * x[0, 0]), term(lambda x: x[0, 0] * 0.0 + 1.0)]
"""A merit of which heavily damped steps take almost nothing, although the undamped one takes half."""


@pytest.mark.parametrize("choice", ["go on", "judge", "stop"])
def test_what_happens_where_steps_are_short_for_damping_alone(choice: str) -> None:
    settings = ProjectionSettings(
        initial_damping=1.0, damping_scale="identity", merit_tolerance=1e-6, when_settled=choice, max_iterations=60
    )
    result = guided_projection(unknown(1e4), SLOW, settings=settings)
    if choice == "go on":
        assert result.status.converged
        assert result.merit == pytest.approx(0.5, abs=1e-6)
    else:
        assert result.status is Status.SETTLED
        assert result.status.at_rest
        assert not result.status.converged
        assert result.merit > 0.9
        assert result.iterations < 10


@pytest.mark.parametrize(("choice", "status"), [("judge", Status.MERIT_TOLERANCE), ("stop", Status.SETTLED)])
def test_at_a_minimum_a_judge_says_converged(choice: str, status: Status) -> None:
    both = term(lambda x: torch.stack([x[0, 0] ** 2 - 1.0, x[0, 0] - 3.0]))
    result = guided_projection(unknown(2.0), [both], settings=ProjectionSettings(when_settled=choice))
    assert result.status is status


def test_an_unknown_that_ran_away_to_a_plateau_is_no_minimum() -> None:
    """A bell that is moved away from its only datum: the residual stays, the derivative is zero in numbers."""
    bell = term(lambda x: torch.exp(-(x[0, 0] ** 2)) - 2.0)
    result = guided_projection(unknown(2.0), [bell], settings=ProjectionSettings(max_iterations=200))
    if result.blocks["x"].abs().item() > 10.0:
        assert not result.status.converged
    else:
        assert result.merit == pytest.approx(0.5, abs=1e-8)  # at the top of the bell


def test_how_far_the_merit_still_fell_is_told() -> None:
    """Halved by every step on a quartic, until the limit: the last ten falls together."""
    quartic = term(lambda x: x[0, 0] ** 2)
    result = guided_projection(
        unknown(1.0), [quartic], settings=ProjectionSettings(max_iterations=12, initial_damping=1e-12)
    )
    merits = [record.merit for record in result.history if record.accepted]
    assert result.recent_fall == pytest.approx(1.0 - merits[-1] / merits[-11])
    assert guided_projection(unknown(0.0), [quartic]).recent_fall == 0.0


@pytest.mark.parametrize(("steps", "fall"), [(0, 0.0), (3, 3 / 100), (10, 10 / 100), (13, 10 / 97)])
def test_the_last_ten_accepted_steps_count_or_as_many_as_there_were(steps: int, fall: float) -> None:
    """Merits fall from 100 by one with every accepted step; between them, one is refused."""
    merits = [100.0, *(100.0 - (number + 1) // 2 for number in range(1, 2 * steps + 1))]
    history = [
        IterationRecord(number, merit, 1.0, 1.0, 1.0, 0.1, number % 2 == 1 or number == 0, 1, 0.0)
        for number, merit in enumerate(merits)
    ]
    result = ProjectionResult({}, Status.TIME_LIMIT, "", [], [], history, "dense", {})
    assert result.recent_fall == pytest.approx(fall)
    expected = f"the last {min(steps, 10)} steps have lowered the merit by {100.0 * fall:.2g} %" if steps else "no step"
    message = message_of(Status.TIME_LIMIT, history)
    assert expected in message
    assert "were refused" not in message  # half of them


def test_that_most_steps_were_refused_is_said() -> None:
    def message(refused: int) -> str:
        taken = [True, *([False] * refused), *([True] * 4)]
        history = [IterationRecord(n, 9.0 - n, 1.0, 1.0, 1.0, 0.1, on, 1, 0.0) for n, on in enumerate(taken)]
        return message_of(Status.TIME_LIMIT, history)

    assert "5 of 9 steps were refused" in message(5)
    assert "were refused" not in message(4)


def test_another_choice_is_refused() -> None:
    with pytest.raises(SettingsError, match="when_settled must be 'go on', 'judge' or 'stop'"):
        ProjectionSettings(when_settled="maybe")


@pytest.mark.parametrize(("sign", "minimum"), [(1.0, True), (-1.0, False)])
def test_where_the_jacobian_is_nearly_singular_curvature_decides(sign: float, minimum: bool) -> None:
    """Of ``(u + v - 2, 1 + sign (u - v)^2 / 2)`` next to u = v = 1: a minimum, or a saddle.

    Along u - v the Jacobian all but vanishes, so that the undamped step promises to do away with the residual 1.
    """
    both = ElementTerm(
        "r",
        lambda x: torch.stack([x[0, 0] + x[1, 0] - 2.0, 1.0 + 0.5 * sign * (x[0, 0] - x[1, 0]) ** 2]),
        [("x", torch.tensor([[0, 1]]))],
    )
    blocks = {"x": torch.tensor([[1.0 + 1e-6], [1.0 - 1e-6]], dtype=DOUBLE)}
    problem = GuidedProjection(blocks, [both], solver="dense")
    assert certified(problem, init(problem, blocks)) == [minimum]


def test_an_unknown_that_is_felt_no_more_is_at_a_minimum_only_if_it_never_was() -> None:
    """Far out on ``exp(-x^2) + 1`` the derivative is zero in numbers, the residual is not."""
    problem = GuidedProjection(unknown(40.0), [term(lambda x: torch.exp(-(x[0, 0] ** 2)) + 1.0)])
    state = init(problem, unknown(40.0))
    assert certified(problem, state) == [True]
    felt = replace(state.linearised, stiffness=torch.ones(1, dtype=DOUBLE))
    assert certified(problem, replace(state, linearised=felt)) == [False]
