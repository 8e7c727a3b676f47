"""What large problems keep: nothing that can be made anew while a state is tried, and the same results for it."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair.projection import (
    ElementTerm,
    GuidedProjection,
    OneSided,
    ProjectionSettings,
    SmoothAbsolute,
    Squares,
    init,
    portions,
    step,
)
from torchfair.projection.layout import State
from torchfair.projection.linear_system import LinearSystem
from torchfair.projection.proposal import Proposal

MATRICES = ("_matrices", "_term_matrices", "diagonal_blocks", "lower_values")
SETTINGS = ProjectionSettings(least_uncorrected_gain=1e9)  # every step is corrected


def stretch(x: Tensor, length: Tensor) -> Tensor:
    return torch.stack([(x[1] - x[0]).square().sum() - length**2, (x[1] - x[0]).sum()])


def umbrella(x: Tensor) -> Tensor:
    return x[1] - x[0]


def terms(smoothing: float, weight: float) -> list[ElementTerm]:
    """On stencils of their own at each call."""
    _, topology = wavy_grid(7, 6, triangles=True)
    lengths = torch.full((topology.num_edges,), 1.0 - smoothing, dtype=DOUBLE)
    edges = [("vertices", topology.edges.clone())]
    return [
        ElementTerm("edges", stretch, edges, data=(lengths,), loss=SmoothAbsolute(smoothing)),
        ElementTerm("even", umbrella, [("vertices", topology.edges[::2].clone())], weight=weight, linear=True),
    ]


def start() -> State:
    return {"vertices": wavy_grid(7, 6, triangles=True)[0]}


@pytest.fixture
def many(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every problem of more than four unknowns is large."""
    monkeypatch.setattr(portions, "_PORTION", 2)


def of_many_steps(count: int = 4) -> list[Tensor]:
    problem = GuidedProjection(start(), terms(0.3, 1.0), solver="cg")
    state, found = init(problem, start(), replace(SETTINGS, solver="cg")), []
    for _ in range(count):
        state, _ = step(problem, state)
        found.append(state.blocks["vertices"])
    return found


def test_no_matrices_are_kept_while_states_are_tried_also_after_a_correction(
    many: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    corrected: list[LinearSystem] = []
    correction = Proposal.correction

    def noted(self: Proposal, *given: object) -> Tensor:
        found: Tensor = correction(self, *given)
        assert "_term_matrices" in self.system.__dict__  # made anew for it
        corrected.append(self.system)
        return found

    monkeypatch.setattr(Proposal, "correction", noted)
    kept: list[set[str]] = []

    def guard(before: State, trial: State) -> bool:
        kept.append(set(MATRICES) & set(state.linearised.system.__dict__))
        return True

    problem = GuidedProjection(start(), terms(0.3, 1.0), solver="cg")
    state = init(problem, start(), replace(SETTINGS, solver="cg"))
    step(problem, state, guard)
    assert corrected == [state.linearised.system]
    assert len(kept) > 1  # the step, and the corrected one
    assert set().union(*kept) == set()


def test_a_state_that_was_left_keeps_no_jacobians_and_makes_the_same_ones_where_asked_again(many: None) -> None:
    problem = GuidedProjection(start(), terms(0.3, 1.0), solver="cg")
    state = init(problem, start(), replace(SETTINGS, solver="cg"))
    before = [jacobian.clone() for jacobian in state.linearised.system.jacobians]
    after, record = step(problem, state)
    assert record.accepted
    assert "jacobians" not in state.linearised.system.__dict__
    assert "jacobians" in after.linearised.system.__dict__
    assert all(map(torch.equal, state.linearised.system.jacobians, before))
    again, _ = step(problem, state)
    assert torch.equal(again.blocks["vertices"], after.blocks["vertices"])


def test_steps_of_large_problems_are_those_of_small_ones(monkeypatch: pytest.MonkeyPatch) -> None:
    small = of_many_steps()
    monkeypatch.setattr(portions, "_PORTION", 2)
    for mine, other in zip(of_many_steps(), small, strict=True):
        torch.testing.assert_close(mine, other, atol=1e-11, rtol=0)


def test_equal_stencils_are_held_once_and_rows_are_not_numbered_again() -> None:
    first = GuidedProjection(start(), terms(0.3, 1.0), solver="cg")
    first.solve(start(), settings=replace(SETTINGS, max_iterations=1))
    again = first.with_terms(terms(0.1, 0.5))
    for mine, other in zip(again.terms, first.terms, strict=True):
        assert mine.stencil[0][1] is other.stencil[0][1]
    assert again.structure.terms == again.terms  # reports know terms by what they are
    held = first.with_fixed({"vertices": torch.arange(42) < 5})
    rows = first.structure.row_pattern((2,), whole=False)
    for problem in (again, held, again.with_fixed({"vertices": torch.arange(42) < 5})):
        assert problem.structure.row_pattern((2,), whole=False) is rows
        assert problem.structure.row_pattern((2,)) is not first.structure.row_pattern((2,))  # linear terms are others


def test_other_stencils_are_not_taken_for_those_before() -> None:
    first = GuidedProjection(start(), terms(0.3, 1.0))
    edges, even = terms(0.3, 1.0)
    turned = replace(edges, stencil=[("vertices", edges.stencil[0][1].flip(1))])
    with pytest.raises(Exception, match="stencil"):
        first.with_terms([turned, even])


@pytest.mark.parametrize("loss", [Squares(), OneSided()])
def test_equal_roots_are_one_number(loss: Squares | OneSided) -> None:
    residuals = torch.linspace(-1.0, 1.0, 30, dtype=DOUBLE).view(10, 3)
    (term, _), weights = terms(0.3, 1.0), torch.linspace(0.5, 2.0, 10, dtype=DOUBLE)
    plain = replace(term, loss=loss, weight=3.0)
    roots = plain.roots(residuals)
    assert roots.untyped_storage().nbytes() == 8
    assert torch.equal(roots, torch.full((10,), 3.0, dtype=DOUBLE).sqrt())
    assert torch.equal(replace(plain, element_weights=weights).roots(residuals), (3.0 * weights).sqrt())
    assert plain.roots(residuals[:0]).shape == (0,)
