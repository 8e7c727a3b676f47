"""A minimum as a function of what its terms were made of: the backward pass of layers that solve."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, Protocol, TypedDict, get_args

import torch
from torch import Tensor
from torch.autograd import Function

from .._numbers import check_count, check_number
from ..errors import DerivativeError, SettingsError
from ..linear import LinearSolver
from .adjoint import AdjointSolution, conjugate, stationary
from .merit_derivatives import MeritDerivatives
from .problem import Problem
from .stationary_point import Preconditioner, StationaryPoint
from .term import ElementTerm

Backward = Literal["implicit", "unroll"]
OnFault = Literal["error", "gauss-newton"]
MakeTerms = Callable[[Mapping[str, Tensor]], Sequence[ElementTerm]]

_LAX = 1e3  # times the accuracy asked for: rounding may not allow more


class Told(Protocol):
    """What is known of a solve: the backward pass reads the point and leaves the adjoint."""

    adjoint: AdjointSolution | None

    @property
    def point(self) -> StationaryPoint | None:
        """The check before derivatives."""


class BackwardOptions(TypedDict, total=False):
    """What layers take of a :class:`BackwardRule`, by name."""

    backward: Backward
    unrolled_steps: int
    solver: str | LinearSolver
    accuracy: float
    products: int
    on_fault: OnFault


@dataclass(frozen=True)
class BackwardRule:
    """How derivatives of a minimum are found.

    Attributes:
        backward: ``"implicit"``, or ``"unroll"`` through the last steps: ``unrolled_steps`` Gauss-Newton steps at the
            end found, as accurate as that iteration is after so many steps; refused where it moves away.
        unrolled_steps: See there.
        solver: Linear solver of the backward pass, by default that of the solve.
        accuracy: Relative remainder of the adjoint equations.
        products: Most products with H for one linear system.
        on_fault: What happens if the end is no such minimum: ``"error"``, or ``"gauss-newton"``, derivatives by the
            positive Gauss-Newton matrix with a warning that names the condition that failed.

    Raises:
        SettingsError: an option out of range.
    """

    backward: Backward = "implicit"
    unrolled_steps: int = 10
    solver: str | LinearSolver = "auto"
    accuracy: float = 1e-8
    products: int = 500
    on_fault: OnFault = "error"

    def __post_init__(self) -> None:
        if self.backward not in get_args(Backward):
            raise SettingsError(f"backward must be 'implicit' or 'unroll', got {self.backward!r}")
        if self.on_fault not in get_args(OnFault):
            raise SettingsError(f"on_fault must be 'error' or 'gauss-newton', got {self.on_fault!r}")
        for name, count in (("unrolled_steps", self.unrolled_steps), ("products", self.products)):
            check_count(name, count, least=1)
        check_number("accuracy", self.accuracy, above=True, finite=True)

    def complain(self, fault: str) -> None:
        """An error, or a warning where the rule goes on with the Gauss-Newton matrix."""
        message = f"the solve ended where it has no derivative: {fault}"
        if self.on_fault == "error":
            raise DerivativeError(message)
        warnings.warn(message + "; its Gauss-Newton matrix is used in place of it", stacklevel=5)

    def fault_of(self, found: AdjointSolution) -> str:
        """What is wrong with a solution of the adjoint equations; empty if nothing is."""
        if self.backward == "unroll":
            return "" if found.remainder <= 1.0 else "Gauss-Newton steps move away from this end; take 'implicit'"
        if found.remainder <= _LAX * self.accuracy:
            return ""
        return "the curvature of the merit is not positive" if not found.lowest > 0.0 else "allow more products"


@dataclass(frozen=True)
class Minimum:
    """All that the backward pass of one solve needs.

    Attributes:
        rule: How.
        terms: Makes the terms from parameters.
        problem: With terms as they are.
        found: The minimum.
        info: What is told of it.
    """

    rule: BackwardRule
    terms: MakeTerms
    problem: Problem
    found: dict[str, Tensor]
    info: Told

    def as_function_of(self, parameters: Mapping[str, Tensor], start: Mapping[str, Tensor]) -> dict[str, Tensor]:
        """The blocks found, with derivatives with respect to parameters and to fixed entries of the start."""
        inputs = (*parameters.values(), *start.values())
        values = _Minimiser.apply(self, list(parameters), *inputs)  # type: ignore[no-untyped-call]
        return dict(zip(self.found, values, strict=True))

    def pulled_back(
        self, names: Sequence[str], cotangents: Sequence[Tensor], values: Sequence[Tensor]
    ) -> list[Tensor | None]:
        """Gradients of the parameters of these names and values, then of the blocks of the start."""
        layout, free = self.problem.layout, self.problem.structure.free
        with torch.enable_grad():
            given = [value.detach().requires_grad_(value.is_floating_point()) for value in values]
            terms = list(self.terms(dict(zip(names, given, strict=True))))
        merit = MeritDerivatives(layout, terms, self.found, free)
        right = layout.flatten(dict(zip(layout.sizes, cotangents, strict=True)))
        precondition = Preconditioner(self.problem.solved_by(self.rule.solver), self.found)
        multiplier = self._solve(merit, precondition, right * free)
        start = torch.where(free, 0.0, right - merit.product(multiplier))
        slopes: list[Tensor | None] = [None] * len(given)
        wanted = [number for number, value in enumerate(given) if value.requires_grad]
        if wanted and merit.gradient.requires_grad:
            for number, slope in zip(wanted, merit.pulled_back(-multiplier, [given[n] for n in wanted]), strict=True):
                slopes[number] = torch.zeros_like(given[number]) if slope is None else slope
        return [*slopes, *layout.unflatten(start).values()]

    def _solve(self, merit: MeritDerivatives, precondition: Preconditioner, right: Tensor) -> Tensor:
        rule = self.rule
        faulty = self.info.point is not None and bool(self.info.point.fault)
        if faulty:
            found = stationary(merit.free_product, precondition, right, 1)
        elif rule.backward == "unroll":
            found = stationary(merit.free_product, precondition, right, rule.unrolled_steps)
        else:
            found = conjugate(merit.free_product, precondition, right, rule.accuracy, rule.products)
        self.info.adjoint = found
        fault = "" if faulty else rule.fault_of(found)
        if fault:
            rule.complain(f"the adjoint equations are left at {found.remainder:.1e} of their right side: {fault}")
            return precondition(right)
        return found.values


class _Minimiser(Function):
    """``(minimum, names, *parameters, *start) -> blocks``."""

    @staticmethod
    def forward(ctx: Any, minimum: Minimum, names: list[str], *inputs: Tensor) -> tuple[Tensor, ...]:
        ctx.minimum, ctx.names = minimum, names
        ctx.save_for_backward(*inputs)
        return tuple(block.clone() for block in minimum.found.values())

    @staticmethod
    def backward(ctx: Any, *cotangents: Tensor) -> tuple[Tensor | None, ...]:
        inputs = ctx.saved_tensors
        with torch.no_grad():
            parameters = inputs[: len(ctx.names)]
            slopes = ctx.minimum.pulled_back(ctx.names, [c.detach() for c in cotangents], parameters)
        if torch.is_grad_enabled():
            slopes = [None if s is None else _Once.apply(s, *cotangents, *inputs) for s in slopes]  # type: ignore[no-untyped-call]
        return (None, None, *slopes)


class _Once(Function):
    """A gradient that says why it cannot be differentiated again."""

    @staticmethod
    def forward(ctx: Any, slope: Tensor, *others: Tensor) -> Tensor:
        return slope.clone()

    @staticmethod
    def backward(ctx: Any, *cotangents: Tensor) -> tuple[None, ...]:
        raise DerivativeError(
            "second derivatives of a solve are not there: the backward pass of a layer that solves is differentiable "
            "once. Take finite differences of its gradients, or leave out create_graph=True"
        )
