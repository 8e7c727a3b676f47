"""Guided projection interrupted before, within and after its steps: the best state, with the history of just that."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from interruptions import WAYS, nth, press, stop
from torch import Tensor

from torchfair.projection import ElementTerm, GuidedProjection, IterationRecord, ProjectionResult, Status, run, unbegun


def stretched(x: Tensor) -> Tensor:
    return torch.linalg.vector_norm(x[1] - x[0]).reshape(1) - 1.0


def problem() -> tuple[GuidedProjection, dict[str, Tensor]]:
    vertices, topology = wavy_grid(4, 4, triangles=True)
    return GuidedProjection({"x": vertices}, [ElementTerm("length", stretched, [("x", topology.edges)])]), {
        "x": vertices
    }


def length(x: Tensor, edges: Tensor) -> float:
    """The merit of ``problem``."""
    sizes = torch.linalg.vector_norm(x[edges[:, 1]] - x[edges[:, 0]], dim=1)
    return 0.5 * float((sizes - 1.0).square().sum())


def check(result: ProjectionResult, start: Tensor, edges: Tensor) -> None:
    """The merit of the history, that of the table and that of the blocks are one; no worse than the start."""
    merit = length(result.blocks["x"], edges)
    assert result.merit == pytest.approx(merit)
    assert result.residuals[0].merit == pytest.approx(merit)
    assert result.initial_residuals[0].merit == pytest.approx(length(start, edges))
    assert merit <= length(start, edges)
    assert [record.iteration for record in result.history] == list(range(len(result.history)))


@WAYS
@pytest.mark.parametrize("after", [False, True])
@pytest.mark.parametrize("n", [1, 2, 3])
@pytest.mark.parametrize("phase", ["init", "step"])
def test_interrupted_in_a_phase_state_and_history_are_of_one_step(
    monkeypatch: pytest.MonkeyPatch, phase: str, n: int, after: bool, act: Callable[[], None]
) -> None:
    solver, blocks = problem()
    monkeypatch.setattr(run, phase, nth(getattr(run, phase), n, act, after=after))
    result = solver.solve(blocks)
    if phase == "init" and n > 1:
        assert result.status.converged  # a start is judged once
        return
    assert result.status is Status.INTERRUPTED
    assert result.iterations == (0 if phase == "init" else n - 1)
    check(result, blocks["x"], solver.terms[0].stencil[0][1])


@WAYS
@pytest.mark.parametrize("after", [False, True])
def test_a_large_start_is_not_evaluated_once_it_is_interrupted_and_says_so(
    monkeypatch: pytest.MonkeyPatch, after: bool, act: Callable[[], None]
) -> None:
    solver, blocks = problem()
    monkeypatch.setattr(unbegun, "_LARGE", blocks["x"].numel())
    monkeypatch.setattr(run, "init", nth(run.init, 1, act, after=after))
    result = solver.solve(blocks)
    assert result.status is Status.INTERRUPTED
    assert "not evaluated" in result.message
    assert math.isnan(result.merit)
    assert result.residuals == result.initial_residuals == []
    assert torch.equal(result.blocks["x"], blocks["x"])
    monkeypatch.setattr(unbegun, "_LARGE", blocks["x"].numel() + 1)
    monkeypatch.setattr(run, "init", nth(run.init, 1, act, after=after))
    smaller = solver.solve(blocks)
    assert smaller.message == Status.INTERRUPTED.value
    check(smaller, blocks["x"], solver.terms[0].stencil[0][1])


@WAYS
def test_interrupted_while_observing_the_step_is_kept(act: Callable[[], None]) -> None:
    solver, blocks = problem()
    observe = nth(lambda state: {"first": float(state["x"][0, 0])}, 3, act)
    result = solver.solve(blocks, observe=observe)
    assert result.status is Status.INTERRUPTED
    assert [record.accepted for record in result.history].count(True) == 3
    assert result.history[-1].accepted
    assert [sorted(record.quantities) for record in result.history[:-1]] == [["first"]] * (len(result.history) - 1)
    assert result.history[-1].quantities == {}
    check(result, blocks["x"], solver.terms[0].stencil[0][1])


@WAYS
def test_interrupted_at_the_end_the_tables_are_made_and_the_status_stays(
    monkeypatch: pytest.MonkeyPatch, act: Callable[[], None]
) -> None:
    solver, blocks = problem()
    undisturbed = solver.solve(blocks)
    monkeypatch.setattr(run, "residual_table", nth(run.residual_table, 2, act))
    result = solver.solve(blocks)
    assert result.status is undisturbed.status
    assert torch.equal(result.blocks["x"], undisturbed.blocks["x"])
    check(result, blocks["x"], solver.terms[0].stencil[0][1])


def test_interrupted_for_ever_the_start_comes_back() -> None:
    _, blocks = problem()
    original = blocks["x"].clone()

    def never(x: Tensor) -> Tensor:
        raise KeyboardInterrupt

    x = torch.zeros(2, 3, dtype=DOUBLE)
    solver = GuidedProjection({"x": x}, [ElementTerm("never", never, [("x", torch.tensor([[0, 1]]))], batched=True)])
    result = solver.solve({"x": x})
    assert result.status is Status.INTERRUPTED
    assert torch.equal(result.blocks["x"], x)
    assert math.isnan(result.merit)
    assert result.residuals == []
    assert torch.equal(blocks["x"], original)


def test_the_start_that_comes_back_is_not_the_tensor_that_was_given(monkeypatch: pytest.MonkeyPatch) -> None:
    solver, blocks = problem()
    monkeypatch.setattr(run, "init", nth(run.init, 1, stop))
    result = solver.solve(blocks)
    assert torch.equal(result.blocks["x"], blocks["x"])
    assert result.blocks["x"].data_ptr() != blocks["x"].data_ptr()


@WAYS
def test_a_batch_interrupted_at_its_start_gives_every_member_its_own(
    monkeypatch: pytest.MonkeyPatch, act: Callable[[], None]
) -> None:
    from torchfair.projection import batch

    solver, blocks = problem()
    starts = torch.stack([blocks["x"], 1.1 * blocks["x"], 0.7 * blocks["x"]])
    monkeypatch.setattr(batch, "init", nth(batch.init, 1, act))
    for start, result in zip(starts, solver.solve_batch({"x": starts}), strict=True):
        assert result.status is Status.INTERRUPTED
        assert torch.equal(result.blocks["x"], start)
        check(result, start, solver.terms[0].stencil[0][1])


@pytest.mark.parametrize(
    ("phase", "act"),
    [("step", stop), ("of_members", stop), *((phase, press) for phase in ("step", "of_members", "record_of"))],
)
def test_a_batch_interrupted_in_any_phase_keeps_what_each_member_has(
    monkeypatch: pytest.MonkeyPatch, phase: str, act: Callable[[], None]
) -> None:
    from torchfair.projection import batch

    solver, blocks = problem()
    starts = torch.stack([blocks["x"], 1.1 * blocks["x"], 2.7 * blocks["x"]])
    monkeypatch.setattr(batch, phase, nth(getattr(batch, phase), 1 if phase == "of_members" else 4, act))
    results = solver.solve_batch({"x": starts})
    assert len(results) == 3
    for start, result in zip(starts, results, strict=True):
        check(result, start, solver.terms[0].stencil[0][1])


def test_callbacks_hear_nothing_of_a_run_that_an_earlier_interrupt_ends() -> None:
    from torchfair._interrupts import deferred_interrupts

    solver, blocks = problem()
    seen: list[IterationRecord] = []
    with deferred_interrupts():
        press()
        result = solver.solve(blocks, callback=seen.append)
    assert result.status is Status.INTERRUPTED
    assert seen == []
    check(result, blocks["x"], solver.terms[0].stencil[0][1])
