"""Going on where data, weights or fixed unknowns have changed, with index maps and analysis kept."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair.errors import ShapeError
from torchfair.projection import ElementTerm, GuidedProjection, ProjectionSettings, init, resume, step

SETTINGS = ProjectionSettings(initial_damping=0.3, damping_scale="identity")


def stretched(x: Tensor) -> Tensor:
    return torch.linalg.vector_norm(x[1] - x[0]) - 1.0


def drawn(x: Tensor) -> Tensor:
    return x[0]


def chain(count: int = 40, *, weight: float = 1.0) -> tuple[dict[str, Tensor], list[ElementTerm]]:
    """Links of length one, drawn to the origin by a linear term."""
    generator = torch.Generator().manual_seed(3)
    blocks = {"points": torch.randn(count, 3, dtype=DOUBLE, generator=generator)}
    every = torch.arange(count)
    links = torch.stack([every[:-1], every[1:]], 1)
    return blocks, [
        ElementTerm("links", stretched, [("points", links)], weight=weight),
        ElementTerm("drawn", drawn, [("points", every[:, None])], weight=0.1, linear=True),
    ]


def mask(*fixed: int, count: int = 40) -> dict[str, Tensor]:
    chosen = torch.zeros(count, dtype=torch.bool)
    chosen[list(fixed)] = True
    return {"points": chosen}


@pytest.mark.parametrize("solver", ["dense", "scipy", "rslab", "cg"])
def test_other_unknowns_can_be_fixed_with_the_same_maps(solver: str) -> None:
    blocks, terms = chain()
    compiled = GuidedProjection(blocks, terms, solver=solver, fixed=mask(7))
    compiled.solve(blocks, settings=SETTINGS)
    for fixed in (mask(0, 20), mask(), mask(7)):
        changed = compiled.with_fixed(fixed)
        fresh = GuidedProjection(blocks, terms, solver=solver, fixed=fixed)
        results = [problem.solve(blocks, settings=SETTINGS).blocks["points"] for problem in (changed, fresh)]
        torch.testing.assert_close(results[0], results[1], rtol=0.0, atol=1e-8)
        stays = fixed["points"]
        assert torch.equal(results[0][stays], blocks["points"][stays])
        assert not bool((results[0][~stays] == blocks["points"][~stays]).all(1).any())
        if solver in ("scipy", "rslab"):
            assert changed.structure.lower is compiled.structure.lower


def test_the_same_unknowns_are_the_same_problem() -> None:
    blocks, terms = chain()
    compiled = GuidedProjection(blocks, terms, fixed=mask(7))
    assert compiled.with_fixed(mask(7)) is compiled
    with pytest.raises(ShapeError, match="fixed\\['points'\\]"):
        compiled.with_fixed({"points": torch.zeros(3, dtype=torch.bool)})


def test_damping_is_carried_on_and_counts_begin_anew() -> None:
    blocks, terms = chain()
    problem = GuidedProjection(blocks, terms)
    state = init(problem, blocks, SETTINGS)
    for _ in range(3):
        state, _ = step(problem, state)
    assert state.damping != SETTINGS.initial_damping
    after = resume(problem, state)
    assert after.damping == state.damping
    assert after.courses[0].iteration == 0
    assert after.merit == pytest.approx(state.merit, rel=1e-12)
    assert torch.equal(after.linearised.stiffness, state.linearised.stiffness)
    one, other = (step(problem, start)[0].blocks["points"] for start in (state, after))
    torch.testing.assert_close(one, other, rtol=0.0, atol=1e-12)


def test_a_state_resumes_with_other_weights_and_from_other_blocks() -> None:
    blocks, terms = chain()
    problem = GuidedProjection(blocks, terms)
    state = init(problem, blocks, SETTINGS)
    heavier = problem.with_terms(chain(weight=5.0)[1])
    elsewhere = {"points": 2.0 * blocks["points"]}
    for given in (None, elsewhere):
        found = resume(heavier, state, given)
        expected = init(heavier, given or blocks, replace(SETTINGS, initial_damping=state.damping))
        assert found.merit == pytest.approx(expected.merit, rel=1e-12)
        assert torch.equal(found.blocks["points"], (given or blocks)["points"])


def test_linear_terms_that_are_the_very_same_are_assembled_once() -> None:
    """Others are not, and with fixed unknowns both leave them alone."""
    blocks, (links, drawing) = chain()
    problem = GuidedProjection(blocks, [links, drawing], fixed=mask(3))
    problem.prepare()
    same = problem.with_terms([replace(links, weight=5.0), drawing])
    other = problem.with_terms([links, replace(drawing, weight=0.4)])
    assert same.structure.affine is problem.structure.affine
    assert other.structure.affine is not problem.structure.affine
    for changed in (same, other):
        found, expected = (
            system.structure.linearise(blocks).lower_values
            for system in (changed, GuidedProjection(blocks, changed.terms, fixed=mask(3)))
        )
        torch.testing.assert_close(found, expected, rtol=1e-14, atol=1e-14)
