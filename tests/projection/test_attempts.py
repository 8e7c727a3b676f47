"""Large problems: a few elements at the border of their domain do not decide on the step of all."""

from __future__ import annotations

from collections.abc import Sequence

import pytest
import torch
from torch import Tensor

from torchfair.projection import ElementTerm, GuidedProjection, ProjectionSettings, init, step
from torchfair.projection.attempts import Attempts, Spoilt
from torchfair.projection.damped_solution import propose
from torchfair.projection.evaluation import Evaluation
from torchfair.projection.layout import State
from torchfair.projection.proposal import Proposal
from torchfair.projection.state import ProjectionState
from torchfair.projection.stopwatch import Stopwatch
from torchfair.projection.trials import Trials

MANY = 40_000
FEW = 12


def away(x: Tensor, target: Tensor) -> Tensor:
    """Falls to the target, and is not linear."""
    difference = x[:, 0] - target
    return difference + 0.05 * difference**2


def wall(x: Tensor, place: Tensor) -> Tensor:
    """Infinite from the place on."""
    return torch.where(x[:, 0] < place, 0.01 / (place - x[:, 0]), torch.inf)


def proposed(problem: GuidedProjection, state: ProjectionState) -> Proposal:
    """The whole step."""
    problem.prepare()
    proposal, _ = propose(problem, state)
    assert proposal is not None
    return proposal


def targets_with_walls(places: Tensor) -> tuple[dict[str, Tensor], list[ElementTerm]]:
    every, walled = torch.arange(MANY)[:, None], torch.arange(len(places))[:, None]
    targets = torch.ones(MANY, dtype=torch.float64)
    terms = [
        ElementTerm("target", away, [("x", every)], data=(targets,)),
        ElementTerm("wall", wall, [("x", walled)], data=(places,), silent=True),
    ]
    return {"x": torch.zeros(MANY, 1, dtype=torch.float64)}, terms


def test_elements_near_their_border_go_less_far_and_all_others_go_all_the_way() -> None:
    blocks, terms = targets_with_walls(torch.linspace(0.2, 0.9, FEW, dtype=torch.float64))
    problem = GuidedProjection(blocks, terms)
    state = init(problem, blocks)
    proposal = proposed(problem, state)
    after, record = step(problem, state)
    moved = after.blocks["x"][:, 0]
    assert record.accepted
    assert record.gain > 0.5
    assert bool((moved[:FEW] < torch.linspace(0.2, 0.9, FEW, dtype=torch.float64)).all())
    assert bool((moved[:FEW] < proposal.change[:FEW]).any())
    factors = moved[FEW:] / proposal.change[FEW:]
    assert float(factors.max() - factors.min()) < 1e-12
    assert float(factors.min()) > 1.0 - 1e-12


def test_the_end_is_that_of_a_small_problem() -> None:
    places = torch.linspace(0.2, 1.5, FEW, dtype=torch.float64)
    blocks, terms = targets_with_walls(places)
    large = GuidedProjection(blocks, terms).solve(blocks)
    some = torch.arange(FEW)[:, None]
    small_terms = [
        ElementTerm("target", away, [("x", some)], data=(torch.ones(FEW, dtype=torch.float64),)),
        ElementTerm("wall", wall, [("x", some)], data=(places,)),
    ]
    few = {"x": blocks["x"][:FEW]}
    small = GuidedProjection(few, small_terms).solve(few, settings=ProjectionSettings(merit_tolerance=1e-14))
    torch.testing.assert_close(large.blocks["x"][:FEW], small.blocks["x"], rtol=0, atol=1e-4)
    assert all(record.gain > 0.5 for record in large.history[1:5])  # until all but the walled ones are at rest


def test_dear_data_are_found_for_states_that_are_not_spoilt_otherwise() -> None:
    blocks, terms = targets_with_walls(torch.full((FEW,), 0.2, dtype=torch.float64))
    asked: list[float] = []

    def refresh(state: State) -> Sequence[Tensor]:
        asked.append(float(state["x"][0, 0]))
        return (torch.ones(MANY, dtype=torch.float64),)

    every = torch.arange(MANY)[:, None]
    found = ElementTerm("found", away, [("x", every)], refresh=refresh, weight=0.1)
    problem = GuidedProjection(blocks, [found, *terms])
    state = init(problem, blocks)
    asked.clear()
    after, _ = step(problem, state)
    assert asked
    assert max(asked) < 0.2  # never asked beyond the wall
    assert float(after.blocks["x"][0, 0]) < 0.2


@pytest.mark.parametrize(("share", "few"), [(0.04, True), (0.06, False)])
def test_where_many_barriers_are_dear_the_whole_step_is_too_long(share: float, few: bool) -> None:
    count = round(share * MANY)
    blocks, terms = targets_with_walls(torch.full((count,), 0.5, dtype=torch.float64))
    problem = GuidedProjection(blocks, terms)
    state = init(problem, blocks)
    attempts = Attempts(state.evaluation, proposed(problem, state))
    far = blocks["x"].clone()
    far[:count] = 0.5 - 1e-6  # each costs far more than all others gain
    found = attempts.evaluated({"x": far})
    assert isinstance(found, Spoilt if few else Evaluation)
    if isinstance(found, Spoilt):
        assert found.terms == [1]
        assert int(found.unknowns.sum()) == count
        assert bool(found.unknowns[:count].all())
    else:
        torch.testing.assert_close(found.merits, problem.structure.evaluate({"x": far}).merits, rtol=0, atol=0)


def test_what_is_no_barrier_may_cost_what_it_does() -> None:
    """Where few elements hold most of the merit, they are what has to move."""
    blocks, terms = targets_with_walls(torch.full((FEW,), 1e9, dtype=torch.float64))
    problem = GuidedProjection(blocks, terms)
    state = init(problem, blocks)
    attempts = Attempts(state.evaluation, proposed(problem, state))
    far = blocks["x"].clone()
    far[:FEW] = -1e6
    assert isinstance(attempts.evaluated({"x": far}), Evaluation)


def test_what_the_model_says_that_a_barrier_costs_is_not_dear() -> None:
    """One soft barrier against many pulls: the model knows that it is entered, and the step is taken as it is."""

    def entered(x: Tensor) -> Tensor:
        return 3.0 * x[0].clamp_min(0.0) * (1.0 + 1e-9 * x[0])

    def pull(x: Tensor, target: Tensor) -> Tensor:
        return (x - target)[0] * (1.0 + 1e-9 * x[0])

    every, one = torch.arange(MANY)[:, None], torch.zeros(1, 1, dtype=torch.int64)
    blocks = {"x": torch.full((MANY, 1), 1e-3, dtype=torch.float64)}
    targets = torch.full((MANY, 1), 1.1e-3, dtype=torch.float64)
    targets[0] = 10.0
    terms = [
        ElementTerm("entered", entered, [("x", one)], silent=True),
        ElementTerm("pull", pull, [("x", every)], data=(targets,)),
    ]
    problem = GuidedProjection(blocks, terms)
    state = init(problem, blocks)
    proposal = proposed(problem, state)
    assert float(proposal.system.rises(0, proposal.change)[0]) > 0.05 * float(proposal.predicted)
    found = Attempts(state.evaluation, proposal).evaluated(
        problem.layout.unflatten(state.blocks["x"][:, 0] + proposal.change)
    )
    assert isinstance(found, Evaluation)


def test_longer_steps_than_that_of_the_model_stay_as_long_where_no_barrier_is() -> None:
    """They are uphill in the model, by which they are not judged."""
    blocks, terms = targets_with_walls(torch.full((FEW,), 1.5, dtype=torch.float64))
    problem = GuidedProjection(blocks, terms)
    state = init(problem, blocks)
    proposal = proposed(problem, state)
    trials = Trials(problem, state, proposal, None, Stopwatch())
    trials.offer(proposal.change)
    assert trials.taken == [True]
    longer = 2.2 * proposal.change
    assert float(proposal.system.predicted_fall(longer)) < 0.0
    trial = trials.offer(longer, again=True)
    assert trial is not None
    assert bool((trial.state["x"][:FEW, 0] < 1.5).all())
    torch.testing.assert_close(trial.state["x"][FEW:, 0], longer[FEW:], rtol=0, atol=0)


def test_rises_are_those_of_the_model() -> None:
    blocks, terms = targets_with_walls(torch.full((FEW,), 0.2, dtype=torch.float64))
    problem = GuidedProjection(blocks, terms)
    system = init(problem, blocks).linearised.system
    change = 1e-3 * torch.sin(torch.arange(MANY, dtype=torch.float64))
    changes, _ = system.changes(change)
    for number, (residual, difference) in enumerate(zip(system.residuals, changes, strict=True)):
        naive = 0.5 * ((residual + difference).square() - residual.square()).sum(0)
        torch.testing.assert_close(system.rises(number, change), naive, rtol=1e-9, atol=1e-15)
