"""What a solve as a layer refuses, and what it says then: faults of the point, second derivatives, options."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, replace
from typing import get_type_hints

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from layer_cases import Case, judged, several_blocks, slopes, solved_again
from torch import Tensor

from torchfair.errors import DerivativeError, SettingsError
from torchfair.formfinding import FairRecipe, JobLayer
from torchfair.projection import BackwardRule, ElementTerm, ProjectionLayer, ProjectionSettings
from torchfair.projection.implicit import BackwardOptions


def test_unrolled_steps_that_move_away_are_refused() -> None:
    """The residual itself, not its slope, is what bends this merit: by more than twice what its model knows."""
    node = torch.tensor([[0]])

    def bowl(given):
        pull = ElementTerm("pull", lambda x, p: x[0] - p, [("x", node)], data=(given["p"],), weight=0.5)
        return [ElementTerm("bowl", lambda x: x[0].square() + 1.0, [("x", node)]), pull]

    made = Case({"x": torch.full((1, 1), 0.5, dtype=DOUBLE)}, bowl, {"p": torch.full((1, 1), 0.5, dtype=DOUBLE)})
    torch.testing.assert_close(slopes(made)[0], solved_again(made, 1e-5), rtol=1e-6, atol=1e-8)
    with pytest.raises(DerivativeError, match=r"Gauss-Newton steps move away.*'implicit'"):
        slopes(made, backward="unroll", unrolled_steps=40)


def well(given: Mapping[str, Tensor]) -> list[ElementTerm]:
    """A double well, at the top between both: least at -1 and 1."""
    return [
        ElementTerm(
            "well", lambda x, p: x[0] ** 2 - 1.0 + p, [("x", torch.tensor([[0]]))], data=(given["p"],), weight=1.0
        )
    ]


TOP = {"x": torch.zeros(1, 1, dtype=DOUBLE)}
NOTHING = torch.zeros(1, 1, dtype=DOUBLE)


def early(given: Mapping[str, Tensor]) -> list[ElementTerm]:
    return [replace(well(given)[0], residual=lambda x, p: x[0].exp() - 2.0 + p)]


def test_faults_name_the_condition_that_fails() -> None:
    ahead = {"x": torch.full((1, 1), 3.0, dtype=DOUBLE)}
    few = ProjectionSettings(max_iterations=1)
    with pytest.raises(DerivativeError, match=r"curvature of the merit is not positive.*weak term"):
        at_the_top()
    with pytest.raises(DerivativeError, match="gradient is not small: after 0 Newton steps"):
        ProjectionLayer(TOP, early, settings=few, newton_steps=0)(ahead, {"p": NOTHING.clone().requires_grad_()})
    found, info = ProjectionLayer(TOP, early, settings=few)(ahead, {"p": NOTHING.clone().requires_grad_()})
    assert info.point.steps > 1  # polished to the minimum
    assert found["x"].item() == pytest.approx(torch.tensor(2.0).log().item())


def at_the_top() -> None:
    """Not one step is taken, so that the solve stays at the top."""
    layer = ProjectionLayer(TOP, well, settings=ProjectionSettings(max_iterations=0))
    layer({"x": TOP["x"] + 1e-3}, {"p": NOTHING.clone().requires_grad_()})


def test_faults_may_be_warnings() -> None:
    layer = ProjectionLayer(TOP, well, settings=ProjectionSettings(max_iterations=0), on_fault="gauss-newton")
    p = NOTHING.clone().requires_grad_()
    with pytest.warns(UserWarning, match="not positive.*Gauss-Newton matrix is used"):
        found, info = layer({"x": TOP["x"] + 1e-3}, {"p": p})
    found["x"].sum().backward()
    # J = 2 x, so -(J^T J)^-1 J^T dr/dp = -1 / (2 x).
    assert float(p.grad) == pytest.approx(-500.0, rel=1e-6)
    assert info.point.fault


def test_second_derivatives_are_refused() -> None:
    made = several_blocks()
    given = {name: value.clone().requires_grad_() for name, value in made.parameters.items()}
    found, _ = made.layer()(made.blocks, given)
    slopes = torch.autograd.grad(judged(found), list(given.values()), create_graph=True)
    with pytest.raises(DerivativeError, match="differentiable once"):
        torch.autograd.grad(slopes[0].sum(), list(given.values()))


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"backward": "explicit"}, "'implicit' or 'unroll'"),
        ({"on_fault": "ignore"}, "'error' or 'gauss-newton'"),
        ({"unrolled_steps": 0}, "unrolled_steps"),
        ({"tolerance": 0.0}, "tolerance"),
    ],
)
def test_options_out_of_range(option: dict[str, object], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        ProjectionLayer(TOP, well, **option)


def test_both_layers_take_the_options_of_one_rule() -> None:
    """A new one is known to type checkers as well, and reaches the rule."""
    kinds = {field.name: get_type_hints(BackwardRule)[field.name] for field in fields(BackwardRule)}
    assert get_type_hints(BackwardOptions) == kinds
    options: BackwardOptions = {"unrolled_steps": 3, "accuracy": 1e-3, "products": 7, "on_fault": "gauss-newton"}
    assert ProjectionLayer(TOP, well, **options).rule == BackwardRule(**options)
    mesh = wavy_grid(3, 3)
    assert JobLayer(FairRecipe(*mesh), **options).rule == BackwardRule(**options)
    with pytest.raises(TypeError, match="newton"):
        ProjectionLayer(TOP, well, newton=3)  # type: ignore[call-arg]
