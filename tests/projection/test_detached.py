"""A solve is not differentiated through."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from bars import VERTICES
from helpers import DOUBLE
from torch import Tensor

from torchfair.projection import ElementTerm, GuidedProjection


@pytest.mark.parametrize("linear", [False, True])
def test_blocks_data_and_weights_that_require_gradients_are_detached(linear: bool) -> None:
    """Nothing of the solve is recorded: the result requires no gradient, and none arrives at the inputs."""
    values = {"x": VERTICES, "place": VERTICES + 1.0, "weight": torch.ones(4, dtype=DOUBLE)}
    inputs = {name: value.clone().requires_grad_() for name, value in values.items()}
    factor = torch.ones((), dtype=DOUBLE, requires_grad=True)  # not known to the term
    recorded: list[bool] = []

    def off(x: Tensor, place: Tensor) -> Tensor:
        recorded.append(place.requires_grad)
        return (x[:, 0] - place) * factor

    def scaled_identity(x: Tensor, place: Tensor) -> Tensor:
        return (factor * torch.eye(3, dtype=DOUBLE)).expand(x.shape[0], 3, 3)

    row = torch.arange(4)[:, None]
    one = ElementTerm(
        "places",
        off,
        [("x", row)],
        (inputs["place"],),
        element_weights=inputs["weight"],
        jacobian=scaled_identity,
        linear=linear,
        batched=True,
    )
    for terms in ([one], [replace(one, jacobian=None)]):
        problem = GuidedProjection({"x": inputs["x"]}, terms)
        for same in (problem, problem.with_terms(terms)):
            result = same.solve({"x": inputs["x"]})
            assert result.blocks["x"].allclose(values["place"])
            assert not result.blocks["x"].requires_grad
    assert recorded
    assert not any(recorded)
    assert all(tensor.grad is None for tensor in (*inputs.values(), factor))
