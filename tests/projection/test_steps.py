"""Steps as pure functions: the loop is nothing but them, states never change, anything can be taken up again."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair.errors import SettingsError
from torchfair.projection import (
    ElementTerm,
    GuidedProjection,
    IterationRecord,
    OneSided,
    ProjectionSettings,
    ProjectionState,
    SmoothAbsolute,
    Status,
    finished,
    guided_projection,
    init,
    step,
)


def stretched(x: Tensor) -> Tensor:
    return torch.linalg.vector_norm(x[1] - x[0]) - 1.0


def height(x: Tensor) -> Tensor:
    return x[0, 2]


def net(solver: str = "auto") -> tuple[GuidedProjection, dict[str, Tensor]]:
    """Edges of unit length, vertices below a ceiling, heights small in the mean."""
    vertices, topology = wavy_grid(6, 5, triangles=True)
    every = torch.arange(30)[:, None]
    terms = [
        ElementTerm("length", stretched, [("x", topology.edges)]),
        ElementTerm("ceiling", lambda x: x[0, 2] - 0.1, [("x", every)], weight=10.0, loss=OneSided()),
        ElementTerm("flat", height, [("x", every)], weight=0.1, loss=SmoothAbsolute(0.01)),
    ]
    fixed = {"x": torch.arange(30) < 2}
    return GuidedProjection({"x": vertices}, terms, fixed=fixed, solver=solver), {"x": vertices}


def walk(problem: GuidedProjection, state: ProjectionState) -> tuple[ProjectionState, list[IterationRecord]]:
    records = []
    while finished(state) is None:
        state, record = step(problem, state)
        records.append(record)
    return state, records


@pytest.mark.parametrize("solver", ["auto", "scipy", "cg"])
def test_the_loop_is_made_of_the_steps(solver: str) -> None:
    problem, blocks = net(solver)
    settings = ProjectionSettings(max_iterations=30)
    state, records = walk(problem, init(problem, blocks, settings))
    result = problem.solve(blocks, settings=settings)
    assert result.status is finished(state)
    assert torch.equal(state.blocks["x"], result.blocks["x"])
    assert state.merit == result.merit
    assert [(r.iteration, r.merit, r.damping, r.gain) for r in records] == [
        (r.iteration, r.merit, r.damping, r.gain) for r in result.history[1:]
    ]


def test_a_state_does_not_change_when_steps_are_made_from_it() -> None:
    """Two steps from one state are the same, bit by bit, and leave it as it was."""
    problem, blocks = net()
    start = init(problem, blocks)
    middle, _ = step(problem, start)
    before = {name: block.clone() for name, block in middle.blocks.items()}
    first, one = step(problem, middle)
    second, two = step(problem, middle)
    assert torch.equal(first.blocks["x"], second.blocks["x"])
    assert (one.merit, one.damping, one.gain) == (two.merit, two.damping, two.gain)
    assert torch.equal(middle.blocks["x"], before["x"])
    assert torch.equal(start.blocks["x"], blocks["x"])
    with pytest.raises(AttributeError):
        middle.courses = ()


def test_a_rejected_step_keeps_the_blocks_and_raises_the_damping() -> None:
    problem, blocks = net()
    state = init(problem, blocks)
    after, record = step(problem, state, guard=lambda old, new: False)
    assert not record.accepted
    assert record.gain == -math.inf
    assert torch.equal(after.blocks["x"], state.blocks["x"])
    assert after.damping > state.damping
    assert after.linearised is state.linearised


def test_damping_is_carried_from_step_to_step() -> None:
    problem, blocks = net()
    state = init(problem, blocks, ProjectionSettings(initial_damping=0.7))
    state, first = step(problem, state)
    _, second = step(problem, state)
    assert first.damping == 0.7
    assert second.damping == state.damping < 0.7


def test_a_callback_sees_the_state_and_the_history_does_not_keep_it() -> None:
    problem, blocks = net()
    seen: list[Tensor] = []

    def look(record: IterationRecord) -> None:
        assert record.state is not None
        assert record.state.merit == record.merit
        seen.append(record.state.blocks["x"])

    result = problem.solve(blocks, callback=look, settings=ProjectionSettings(max_iterations=4))
    assert torch.equal(seen[0], blocks["x"])
    assert torch.equal(seen[-1], result.blocks["x"])
    assert all(record.state is None for record in result.history)
    assert len(seen) == len(result.history) == 5


def test_one_element_at_the_border_of_its_domain_does_not_stop_all_others() -> None:
    """150 independent unknowns; Newton steps for two of them lead to the square root of a negative number."""
    generator = torch.Generator().manual_seed(0)
    targets = 1.0 + torch.rand(150, dtype=DOUBLE, generator=generator)
    targets[3], targets[7] = 1e-3, 1e-4
    start = 0.5 + 4.0 * torch.rand(150, 1, dtype=DOUBLE, generator=generator)
    every = torch.arange(150)[:, None]
    root = ElementTerm("root", lambda x, target: torch.sqrt(x[0, 0]) - target, [("x", every)], (targets,))
    result = guided_projection({"x": start}, [root])
    assert all(record.accepted for record in result.history)
    assert result.iterations < 15
    torch.testing.assert_close(result.blocks["x"][:, 0], targets.square(), rtol=1e-6, atol=1e-12)


def test_a_status_of_the_start_needs_no_step() -> None:
    problem, blocks = net()
    assert finished(init(problem, blocks, ProjectionSettings(max_iterations=0))) is Status.MAX_ITERATIONS


def test_a_linear_solver_in_the_settings_is_honoured() -> None:
    problem, blocks = net("scipy")
    assert problem.solve(blocks).solver == "scipy"
    iterative = problem.solve(blocks, settings=ProjectionSettings(solver="cg"))
    assert iterative.solver == "conjugate gradients"
    assert max(record.inner_iterations for record in iterative.history) > 1
    assert problem.solve(blocks, settings=ProjectionSettings(solver="scipy")).solver == "scipy"
    assert problem.solve(blocks, settings=ProjectionSettings()).solver == "scipy"
    (result, *_) = problem.solve_batch({"x": blocks["x"][None]}, settings=ProjectionSettings(solver="cg"))
    assert result.solver == "conjugate gradients"


def test_steps_refuse_settings_that_ask_for_another_linear_solver() -> None:
    problem, blocks = net("scipy")
    settings = ProjectionSettings(solver="dense")
    with pytest.raises(SettingsError, match="made for the linear solver 'scipy'"):
        init(problem, blocks, settings)
    assert init(problem.solved_by("dense"), blocks, settings).merit == init(problem, blocks).merit


def test_an_own_one_sided_loss_is_heeded_like_ours() -> None:
    class Walls:
        """Half the squares of what is above zero."""

        one_sided = True

        def value(self, residuals: Tensor) -> Tensor:
            return 0.5 * torch.relu(residuals).square().sum(1)

        def root(self, residuals: Tensor) -> Tensor:
            return residuals.new_ones(residuals.shape[0])

    problem, blocks = net()
    terms = [replace(term, loss=Walls()) if term.name == "ceiling" else term for term in problem.terms]
    mine = GuidedProjection(blocks, terms).solve(blocks)
    known = GuidedProjection(blocks, problem.terms).solve(blocks)
    assert mine.iterations == known.iterations
    assert torch.equal(mine.blocks["x"], known.blocks["x"])


def test_the_gain_of_a_shortened_step_is_that_over_what_the_shortened_step_promised() -> None:
    """The whole step leads to the square root of a negative number, half of it does not; one term is linear."""
    row = torch.zeros(1, 1, dtype=torch.int64)
    terms = [
        ElementTerm("root", lambda x: torch.sqrt(x[0]) - 0.1, [("x", row)]),
        ElementTerm("held", lambda x: x[0] + 1.0, [("x", row)], linear=True),
    ]
    settings = ProjectionSettings(initial_damping=1e-13, max_iterations=1, least_extrapolation=math.inf)
    result = guided_projection({"x": torch.ones(1, 1, dtype=DOUBLE)}, terms, settings=settings)
    half = -0.5 * (0.5 * 0.9 + 2.0) / (0.5**2 + 1.0)
    assert float(result.blocks["x"]) == pytest.approx(1.0 + half)
    promised = 0.5 * (0.9**2 + 2.0**2) - 0.5 * ((0.9 + 0.5 * half) ** 2 + (2.0 + half) ** 2)
    actual = 0.5 * (0.9**2 + 2.0**2) - 0.5 * ((math.sqrt(1.0 + half) - 0.1) ** 2 + (2.0 + half) ** 2)
    assert result.history[1].gain == pytest.approx(actual / promised)


def test_a_step_that_is_not_downhill_with_parts_held_back_is_shortened_as_a_whole() -> None:
    """Two unknowns that have to go together: one may not go beyond 0.3, and the other alone would be wrong."""

    def together(x: Tensor) -> Tensor:
        return torch.stack([x[0, 0] - 1.0, 100.0 * (x[0, 0] - x[1, 0])])

    def below(x: Tensor) -> Tensor:
        return 1e-3 * torch.log(0.3 - x[0])

    both, first = torch.tensor([[0, 1]]), torch.tensor([[0]])
    terms = [ElementTerm("together", together, [("x", both)]), ElementTerm("below", below, [("x", first)])]
    start = {"x": torch.zeros(2, 1, dtype=DOUBLE)}
    settings = ProjectionSettings(initial_damping=1e-9, max_iterations=1, solver="dense")
    result = guided_projection(start, terms, settings=settings)
    assert result.history[1].accepted
    x, y = result.blocks["x"].flatten().tolist()
    assert 0.1 < x < 0.3
    assert abs(x - y) < 1e-3
