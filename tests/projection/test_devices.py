"""Guided projection on another device: the same steps as on the CPU."""

from __future__ import annotations

import pytest
import torch
from helpers import wavy_grid
from pretended_device import PRETENDED, PretendedDevice
from term_cases import CASES

from torchfair.constraints import handle_terms, interior_fairness_terms, normal_variation_terms
from torchfair.projection import (
    ElementTerm,
    GuidedProjection,
    ProjectionResult,
    ProjectionSettings,
    guided_projection,
    init,
    step,
)

CPU = torch.device("cpu")

PROBLEMS = {
    "closeness": ("normal_variation_terms", "interior_fairness_terms", "corner_angle_terms", "closeness_terms"),
    "spheres and inequalities": ("cospherical_terms", "coplanar_terms", "even_star_terms", "SaddleSides.terms"),
    "matrices": ("absolute_curvature_terms", "even_fairness_terms", "gliding_terms"),
}


def solved(problem: str, device: torch.device) -> ProjectionResult:
    blocks: dict[str, torch.Tensor] = {}
    terms: list[ElementTerm] = []
    for name in PROBLEMS[problem]:
        state, more = CASES[name](device)[0]
        blocks = {**state, **blocks}
        terms += more
    fixed = {"vertices": torch.zeros_like(blocks["vertices"], dtype=torch.bool)}
    fixed["vertices"][0] = True
    settings = ProjectionSettings(solver="cg", max_iterations=2, initial_damping=1.0)
    return guided_projection(blocks, terms, fixed=fixed, settings=settings)


@pytest.mark.parametrize("problem", PROBLEMS)
def test_steps_by_conjugate_gradients_are_those_on_the_cpu(problem: str, device: torch.device) -> None:
    expected, found = solved(problem, CPU), solved(problem, device)
    assert found.history[-1].merit < 0.9 * found.history[0].merit
    assert [record.merit for record in found.history] == pytest.approx([record.merit for record in expected.history])
    for name, block in expected.blocks.items():
        assert found.blocks[name].device == device
        torch.testing.assert_close(found.blocks[name].cpu(), block, rtol=1e-6, atol=1e-8)
    assert [r.mean for r in found.residuals] == pytest.approx([r.mean for r in expected.residuals], rel=1e-6)


def test_a_step_waits_for_the_device_a_few_times_whatever_its_linear_iterations() -> None:
    """At a trial, for the end of the step and the new gradient; conjugate gradients look every ten iterations."""
    vertices, topology = wavy_grid(9, 9, triangles=True)
    with PretendedDevice() as pretended:
        there, places = vertices.to(PRETENDED), (1.1 * vertices).to(PRETENDED)
        other = topology.to(PRETENDED)
        terms = [
            *normal_variation_terms(other, smoothing=1e-2),
            *interior_fairness_terms(other, weight=0.1),
            *handle_terms(torch.arange(81, device=PRETENDED), places, weight=10.0),
        ]
        made = GuidedProjection({"vertices": there}, terms, solver="cg")
        state = init(made, {"vertices": there}, ProjectionSettings(solver="cg", accuracy=1e-5))
        state, _ = step(made, state)  # makes the index maps
        for _ in range(3):
            pretended.waits.clear()
            state, record = step(made, state)
            assert record.inner_iterations > 20
            assert len(pretended.waits) <= 6 + record.inner_iterations // 10 + 1
            tensors = [*state.blocks.values(), state.evaluation.merits, state.linearised.stiffness]
            assert {tensor.device for tensor in tensors} == {PRETENDED}
