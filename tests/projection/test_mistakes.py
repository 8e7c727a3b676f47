"""Mistakes in terms: each is an error that names the term, the place and how to mend it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
import torch
from bars import EDGES, LENGTHS, VERTICES, all_stretched, derivative, solved, stretched, term
from helpers import DOUBLE
from torch import Tensor

from torchfair import ShapeError, TorchfairError
from torchfair.projection import (
    ElementTerm,
    GuidedProjection,
    OneSided,
    SmoothAbsolute,
    SmoothNuclearNorm,
    Squares,
    guided_projection,
)

NAN = float("nan")


def test_without_a_mistake_there_is_no_error() -> None:
    for right in (term(), term(jacobian=derivative), term(residual=all_stretched, batched=True)):
        assert solved(right).residuals[0].largest < 1e-3


STENCIL = r"term 'bars', stencil.*: expected pairs .* such as \[\(\"vertices\", edges\)\]"
INDICES = "term 'bars', stencil of 'vertices': expected indices, a tensor of int64, got "
MISSHAPEN = {
    "float indices": ({"stencil": [("vertices", EDGES.double())]}, INDICES + r"\(3, 2\) torch.float64"),
    "a list of indices": ({"stencil": [("vertices", EDGES.tolist())]}, INDICES + "a list"),
    "indices of NumPy": ({"stencil": [("vertices", EDGES.numpy())]}, INDICES + "a NumPy array .*torch.as_tensor"),
    "a mask for indices": ({"stencil": [("vertices", EDGES > 0)]}, INDICES + r"\(3, 2\) torch.bool"),
    "flat indices": ({"stencil": [("vertices", EDGES[:, 0])]}, r"indices \(n, k\), a row for each.*got \(3,\)"),
    "fewer indices": ({"stencil": [("vertices", EDGES), ("vertices", EDGES[:2])]}, r"indices \(3, k\).*got \(2, 2\)"),
    "indices outside": ({"stencil": [("vertices", EDGES + 2)]}, r"'vertices': .* in 0\.\.3, got 4 at \[1, 1\]"),
    "indices elsewhere": ({"stencil": [("vertices", EDGES.to("meta"))]}, "indices on cpu like the blocks.*on meta"),
    "a bare pair": ({"stencil": ("vertices", EDGES)}, STENCIL),
    "a bare index": ({"stencil": EDGES}, STENCIL),
    "no name of a block": ({"stencil": [EDGES]}, STENCIL),
    "a dictionary": ({"stencil": {"vertices": EDGES}}, STENCIL + ", got a dict"),
    "no stencil": ({"stencil": []}, STENCIL + ", got an empty list"),
    "no name": ({"name": stretched}, "the first argument of ElementTerm: expected the name"),
    "no function": ({"residual": LENGTHS}, "term 'bars', residual: expected a function"),
    "no refresh": ({"data": (), "refresh": (LENGTHS,)}, "term 'bars', refresh: expected a function, got a tuple"),
    "residual (1, 3)": ({"residual": lambda x, length: x[1:] - x[:1]}, r"scalar or \(m,\), got \(1, 3\)"),
    "residual (2, 3)": ({"residual": lambda x, length: x}, r"'bars', residual of an element.*\(m,\), got \(2, 3\)"),
    "empty residual": ({"residual": lambda x, length: x[0, :0]}, r"scalar or \(m,\), got \(0,\)"),
    "a number": ({"residual": lambda x, length: 1.0}, "'bars', residual of an element: expected a tensor.*got 1.0"),
    "two tensors": ({"residual": lambda x, length: (x[0], x[1])}, "expected a tensor.*got a tuple"),
    "whole numbers": ({"residual": lambda x, length: (x[0] > 0).long()}, "float64 like the blocks.*got .*int64"),
    "float32": ({"residual": lambda x, length: x[0].float()}, "'bars', residual.*float64 like the blocks.*float32"),
    "batched rows": ({"residual": lambda x, length: x[1:, 0], "batched": True}, r"\(n,\) or \(n, m\), got \(2, 3\)"),
    "refreshed tensor": ({"data": (), "refresh": lambda s: LENGTHS}, "'bars', data that refresh.*sequence of tensors"),
    "refreshed nothing": ({"data": (), "refresh": lambda s: None}, "sequence of tensors.*got None"),
    "refreshed rows": (
        {"data": (), "refresh": lambda s: (LENGTHS[1:],)},
        r"\(3, \.\.\.\), a row for each element.*\(2,\)",
    ),
    "refreshed float32": ({"data": (), "refresh": lambda s: (LENGTHS.float(),)}, "float64 like the blocks.*float32"),
    "data and refresh": ({"refresh": lambda s: (LENGTHS,)}, "'bars': expected data or refresh"),
    "bare data": ({"data": LENGTHS}, r"'bars', data: expected a sequence of tensors, such as \(lengths,\)"),
    "data of NumPy": ({"data": (LENGTHS.numpy(),)}, r"'bars', data\[0\]: expected a tensor.*torch.as_tensor"),
    "one number as data": ({"data": (LENGTHS, 1.0)}, r"'bars', data\[1\]: expected a tensor.*got 1.0"),
    "a scalar as data": ({"data": (LENGTHS[0],)}, r"'bars', data\[0\]: expected \(3, \.\.\.\)"),
    "data of float32": ({"data": (LENGTHS.float(),)}, r"'bars', data\[0\]: expected torch.float64 like the blocks"),
    "data elsewhere": ({"data": (LENGTHS.to("meta"),)}, r"'bars', data\[0\]: expected a tensor on cpu.*on meta"),
    "weights of NumPy": ({"element_weights": np.ones(3)}, "'bars', element_weights: .*torch.as_tensor"),
    "weights (n, 1)": ({"element_weights": LENGTHS[:, None]}, r"element_weights: expected \(3,\).*got \(3, 1\)"),
    "weights elsewhere": ({"element_weights": LENGTHS.to("meta")}, "element_weights: .*on cpu.*on meta"),
    "bad weights": (
        {"element_weights": torch.tensor([1.0, -2.0, NAN], dtype=DOUBLE)},
        r"'bars', element_weights: expected finite numbers of at least 0, got \[-2.0, nan\] at elements \[1, 2\]",
    ),
    "infinite weights": ({"element_weights": torch.tensor([1.0, 1.0, math.inf], dtype=DOUBLE)}, r"elements \[2\]"),
    "infinite weight": ({"weight": math.inf}, "'bars', weight: expected a finite number of at least 0.*got inf"),
    "many weights": ({"weight": LENGTHS}, "'bars', weight: expected a finite number .*element_weights"),
    "weight in words": ({"weight": "1"}, "'bars', weight: expected a finite number"),
    "class of a loss": ({"loss": Squares}, r"'bars', loss: expected an object such as Squares\(\)"),
    "loss in words": ({"loss": "squares"}, "'bars', loss: expected an object"),
    "loss of matrices": ({"loss": SmoothNuclearNorm(0.1)}, r"symmetric_components, got \(3, 1\)"),
    "vector merit": ({"merit": lambda x, length: x[0]}, r"'bars', merit of an element: expected a scalar, got \(3,\)"),
    "short derivative": (
        {"jacobian": lambda x, length: x[0]},
        r"'bars', jacobian of an element: .*\(m, 6\), got \(3,\)",
    ),
    "unflat derivative": ({"jacobian": lambda x, length: x}, r"'bars', jacobian of an element: .*got \(2, 3\)"),
    "more components": (
        {"jacobian": lambda x, length: derivative(x, length).expand(2, 6)},
        r"'bars', jacobian of an element: expected \(1, 6\) as residual and unknowns, got \(2, 6\)",
    ),
    "linear, short derivative": (
        {"residual": lambda x, length: x[0, 0], "jacobian": lambda x, length: x[0], "linear": True},
        r"'bars', jacobian of an element: .*\(m, 6\), got \(3,\)",
    ),
}


@pytest.mark.parametrize("mistake", MISSHAPEN)
def test_parts_of_a_term_that_do_not_fit(mistake: str) -> None:
    options, message = MISSHAPEN[mistake]
    with pytest.raises(ShapeError, match=message):
        solved(term(**options))


def fails_with(kind: str) -> str:
    return rf"term 'bars': its residual fails for unknowns \(2, 3\) and data \(\) with {kind}: "


FAILING: dict[str, tuple[Callable[..., object], type[Exception], str]] = {
    "branches on values": (lambda x, y: x[0] if x[0, 0] > 0 else x[1], RuntimeError, ".*control flow.*torch.where"),
    "leaves torch": (lambda x, y: math.sqrt(x.square().sum()), RuntimeError, ".*without .item"),
    "is changed in place": (lambda x, y: x.sub_(1.0).sum(), RuntimeError, ".*in-place.*changes in place"),
    "takes too little": (lambda x: x[0], TypeError, ".*a tensor for each entry of the stencil, then one for each"),
    "knows no third": (lambda x, y: x[2], IndexError, ".*for one element"),
    "broadcasts": (lambda x, y: x[0] - torch.zeros(4, dtype=DOUBLE), RuntimeError, "The size.*for one element"),
}


@pytest.mark.parametrize("mistake", FAILING)
def test_a_function_that_fails_is_named_and_its_error_is_the_cause(mistake: str) -> None:
    function, kind, message = FAILING[mistake]
    with pytest.raises(TorchfairError, match=fails_with(kind.__name__) + message) as caught:
        solved(term(residual=function))
    assert type(caught.value.__cause__) is kind


def test_errors_on_purpose_pass_as_they_are() -> None:
    def refuses(x: Tensor, length: Tensor) -> Tensor:
        raise ShapeError("own", "this", "that")

    def exhausted(x: Tensor, length: Tensor) -> Tensor:
        raise MemoryError

    with pytest.raises(ShapeError, match=r"^own: expected this, got that"):
        solved(term(residual=refuses))
    with pytest.raises(MemoryError):
        solved(term(residual=exhausted))


def test_residuals_without_derivative_are_refused() -> None:
    for function in (lambda x, y: y + 1.0, lambda x, y: x[0].detach(), lambda x, y: (x[0] > 0).to(x)):
        with pytest.raises(TorchfairError, match=r"residual of term 'bars' does not depend on its unknowns.*detach"):
            solved(term(residual=function))
    with torch.inference_mode(), pytest.raises(TorchfairError, match=r"'bars' is differentiated.*use torch.no_grad"):
        solved(term())


NOT_FINITE: dict[str, tuple[dict[str, object], str]] = {
    "data": ({"data": (torch.tensor([1.0, NAN, 1.0], dtype=DOUBLE),)}, r"elements \[1\]: nor are its data\[0\] there"),
    "merit": ({"merit": lambda x, y: 1.0 / x[0, 0].square()}, r"merit of term 'bars' is not finite.*elements \[0, 2\]"),
    "overflow": ({"residual": lambda x, y: 1e200 * x[1, 1:]}, r"merit of term 'bars' is not finite.*lower its weight"),
    "negative": ({"merit": lambda x, y: -x[0, 0].square()}, r"merit of term 'bars' is negative.*elements \[1\]"),
    "linear": (
        {"residual": lambda x, y: x.square().sum().sqrt(), "linear": True},
        "'bars' is declared linear, but not",
    ),
}


@pytest.mark.parametrize("mistake", NOT_FINITE)
def test_starts_that_cannot_be_evaluated(mistake: str) -> None:
    options, message = NOT_FINITE[mistake]
    with pytest.raises(TorchfairError, match=message):
        solved(term(**options))


def test_derivatives_that_are_not_finite_at_the_start_are_refused_with_inequalities_and_fixed_vertices_too() -> None:
    ends = torch.tensor([[0, 1], [2, 3]])
    same = VERTICES[[0, 1, 2, 2]]

    def length(x: Tensor) -> Tensor:
        return (x[1] - x[0]).square().sum().sqrt() + 1.0

    for loss in (Squares(), OneSided(), SmoothAbsolute(0.1)):
        one = ElementTerm("roots", length, [("vertices", ends)], loss=loss)
        for fixed in ({}, {"vertices": torch.arange(4) > 1}):
            with pytest.raises(
                TorchfairError, match=r"derivative of term 'roots' is not finite at the start, elements \[1\]"
            ):
                guided_projection({"vertices": same}, [one], fixed=fixed)


def test_derivatives_that_are_not_finite_later_end_the_run() -> None:
    def steep(x: Tensor) -> Tensor:
        return torch.where(x[0] < 0.5, NAN, 1.0).to(x)

    one = ElementTerm("steep", lambda x: x[0], [("x", torch.zeros(1, 1, dtype=torch.int64))], jacobian=steep)
    result = guided_projection({"x": torch.ones(1, 1, dtype=DOUBLE)}, [one])
    assert result.status.name == "SINGULAR"
    assert "'steep', not finite at elements [0]" in result.message


class Norm:
    """A loss that forgets to sum over components."""

    def __init__(self, part: str) -> None:
        self.part = part

    def value(self, residuals: Tensor) -> Tensor:
        return 0.5 * (residuals.square() if self.part == "value" else residuals.square().sum(1))

    def root(self, residuals: Tensor) -> Tensor:
        return torch.ones_like(residuals if self.part == "root" else residuals[:, 0])


@pytest.mark.parametrize(("part", "shape"), [("value", r"\(3,\)"), ("root", r"\(3,\) or \(3, 1, 1\)")])
def test_losses_of_the_wrong_shape_are_named(part: str, shape: str) -> None:
    with pytest.raises(ShapeError, match=rf"term 'bars', {part} of its loss: expected {shape}, got \(3, 1\)"):
        solved(term(loss=Norm(part)))


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
