"""Guided projection as a layer: blocks that are differentiable functions of what the terms are made of."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

import torch
from torch import Tensor, nn
from torch.autograd import Function

from .._numbers import check_count, check_number
from ..errors import DerivativeError, SettingsError, ShapeError
from ..linear import LinearSolver
from ..settings.projection_settings import ProjectionSettings
from .adjoint import AdjointSolution, conjugate, stationary
from .guided_projection import GuidedProjection
from .layout import State
from .merit_derivatives import MeritDerivatives
from .problem import Problem
from .result import ProjectionResult
from .stationary_point import Preconditioner, StationaryPoint, polished
from .term import ElementTerm

Backward = Literal["implicit", "unroll"]
_LAX = 1e3  # times the accuracy asked for: rounding may not allow more

OnFault = Literal["error", "gauss-newton"]
MakeTerms = Callable[[Mapping[str, Tensor]], Sequence[ElementTerm]]


@dataclass
class LayerInfo:
    """What is known of a solve beside its blocks.

    Attributes:
        result: Of the solve.
        point: Of the check before derivatives; None where none was asked for.
        adjoint: Of the backward pass, None before it.
    """

    result: ProjectionResult
    point: StationaryPoint | None = None
    adjoint: AdjointSolution | None = None


class ProjectionLayer(nn.Module):
    r"""Minimises the merit of terms; the blocks found are differentiable functions of the *parameters* of the terms.

    With ``m(x, p)`` the merit, its minimiser has ``g(x, p) = dm/dx = 0``, so ``dx/dp = -H^{-1} dg/dp`` with the exact
    second derivatives ``H`` of the merit (implicit function theorem). The backward pass solves one system with H, by
    conjugate gradients that are preconditioned with the Gauss-Newton factor of the engine; products with H are double
    backward passes through the terms. The Gauss-Newton matrix in place of H is 15 to 30 % off for E.

    Gradients go to the declared parameters and to fixed entries of the start, nowhere else: free entries of the start
    have gradient zero, and what else terms were made of has none. What ``refresh`` finds counts as a function of the
    state (its change is a central difference), and of parameters as far as torch follows it. Of inequalities those
    count that are broken at the end.

    Args:
        blocks: Example blocks ``(n, d)``; only sizes, dtype and device matter.
        terms: ``terms(parameters)`` makes the terms, on the same stencils in the same order each time, with parameters
            in ``data``, ``element_weights`` or closures of ``refresh``. Units and normalisations that depend on
            parameters belong into it.
        fixed: Masks as for :func:`guided_projection`: unknowns that stay as they are.
        settings: Of the solve.
        backward: ``"implicit"``, or ``"unroll"`` through the last steps: ``unrolled_steps`` Gauss-Newton steps at the
            end found, as accurate as that iteration is after so many steps; refused where it moves away.
        unrolled_steps: See there.
        solver: Linear solver of the backward pass, by default that of the solve.
        tolerance: The end is polished by Newton steps until the next one is shorter than this, relative to the extent
            of the blocks.
        newton_steps: Most of these.
        accuracy: Relative remainder of the adjoint equations.
        products: Most products with H for one linear system.
        on_fault: What happens if the end is no such minimum: ``"error"``, or ``"gauss-newton"``, derivatives by the
            positive Gauss-Newton matrix with a warning that names the condition that failed.

    Raises:
        SettingsError: an option out of range.

    Example:
        >>> import torch
        >>> from torchfair.projection import ElementTerm, ProjectionLayer
        >>> def springs(given):
        ...     node = torch.arange(1)[:, None]
        ...     return [ElementTerm("target", lambda x, t: x[0] - t, [("x", node)], data=(given["target"],))]
        >>> layer = ProjectionLayer({"x": torch.zeros(1, 2)}, springs)
        >>> target = torch.ones(1, 2, requires_grad=True)
        >>> blocks, info = layer({"x": torch.zeros(1, 2)}, {"target": target})
        >>> blocks["x"].sum().backward()
        >>> target.grad
        tensor([[1., 1.]])
    """

    def __init__(
        self,
        blocks: State,
        terms: MakeTerms,
        *,
        fixed: Mapping[str, Tensor] | None = None,
        settings: ProjectionSettings | None = None,
        backward: Backward = "implicit",
        unrolled_steps: int = 10,
        solver: str | LinearSolver = "auto",
        tolerance: float = 1e-7,
        newton_steps: int = 8,
        accuracy: float = 1e-8,
        products: int = 500,
        on_fault: OnFault = "error",
    ) -> None:
        super().__init__()
        if backward not in get_args(Backward):
            raise SettingsError(f"backward must be 'implicit' or 'unroll', got {backward!r}")
        if on_fault not in get_args(OnFault):
            raise SettingsError(f"on_fault must be 'error' or 'gauss-newton', got {on_fault!r}")
        for name, count in (("unrolled_steps", unrolled_steps), ("newton_steps", newton_steps), ("products", products)):
            check_count(name, count, least=0 if name == "newton_steps" else 1)
        for name, number in (("tolerance", tolerance), ("accuracy", accuracy)):
            check_number(name, number, above=True, finite=True)
        self.terms, self.settings, self.backward_by, self.on_fault = terms, settings, backward, on_fault
        self.unrolled_steps, self.solver, self.tolerance = unrolled_steps, solver, tolerance
        self.newton_steps, self.accuracy, self.products = newton_steps, accuracy, products
        self._example = {name: torch.zeros_like(block) for name, block in blocks.items()}
        self._fixed = dict(fixed or {})
        self._problem: GuidedProjection | None = None

    if TYPE_CHECKING:  # torch says Any

        def __call__(
            self, blocks: State, parameters: Mapping[str, Tensor] | None = None
        ) -> tuple[dict[str, Tensor], LayerInfo | list[LayerInfo]]:
            """What ``forward`` gives."""
            ...

    def forward(
        self, blocks: State, parameters: Mapping[str, Tensor] | None = None
    ) -> tuple[dict[str, Tensor], LayerInfo | list[LayerInfo]]:
        """The blocks of least merit, and what is known of the solve.

        Args:
            blocks: Start, ``name -> (n, d)``; or ``(batch, n, d)``, then all parameters have a batch dimension, too,
                and members are solved one after the other, with one symbolic analysis.
            parameters: By name, as the terms want them.

        Returns:
            Blocks of the same shapes, and :class:`LayerInfo`, a list of them for a batch.

        Raises:
            ShapeError: blocks or parameters do not fit.
            DerivativeError: derivatives are asked for where they mean nothing; names the condition that failed. Second
                derivatives are refused when they are asked for.
        """
        parameters = dict(parameters or {})
        dimensions = {block.ndim for block in blocks.values()}
        if dimensions == {2}:
            return self._solved(dict(blocks), parameters)
        sizes = {len(tensor) for tensor in (*blocks.values(), *parameters.values()) if tensor.ndim}
        if dimensions != {3} or len(sizes) != 1:
            shapes = {name: tuple(tensor.shape) for name, tensor in (*blocks.items(), *parameters.items())}
            raise ShapeError("blocks and parameters", "(n, d), or all with one leading batch dimension", shapes)
        members = [
            self._solved({k: v[i] for k, v in blocks.items()}, {k: v[i] for k, v in parameters.items()})
            for i in range(sizes.pop())
        ]
        if not members:
            return {name: block.clone() for name, block in blocks.items()}, []
        together = {name: torch.stack([found[name] for found, _ in members]) for name in blocks}
        return together, [info for _, info in members]

    def _solved(self, blocks: dict[str, Tensor], parameters: dict[str, Tensor]) -> tuple[dict[str, Tensor], LayerInfo]:
        with torch.no_grad():
            problem = self._problem_with({name: value.detach() for name, value in parameters.items()})
            result = problem.solve(blocks, settings=self.settings)
        info = LayerInfo(result)
        inputs = (*parameters.values(), *blocks.values())
        if not (torch.is_grad_enabled() and any(tensor.requires_grad for tensor in inputs)):
            return result.blocks, info
        found = result.blocks
        info.point = polished(
            problem,
            problem.terms,
            found,
            tolerance=self.tolerance,
            most=self.newton_steps,
            products=self.products,
        )
        if info.point.fault:
            self._complain(info.point.fault)
        else:
            found = info.point.blocks
        call = _Call(self, problem, found, list(parameters), info)
        values = _Minimiser.apply(call, *inputs)  # type: ignore[no-untyped-call]
        return dict(zip(blocks, values, strict=True)), info

    def _problem_with(self, parameters: dict[str, Tensor]) -> GuidedProjection:
        terms = self.terms(parameters)
        if self._problem is None:
            self._problem = GuidedProjection(self._example, terms, fixed=self._fixed, solver=self._asked())
        return self._problem.with_terms(terms)

    def _asked(self) -> str | LinearSolver:
        return "auto" if self.settings is None else self.settings.solver

    def _fault_of(self, found: AdjointSolution) -> str:
        if self.backward_by == "unroll":
            return "" if found.remainder <= 1.0 else "Gauss-Newton steps move away from this end; take 'implicit'"
        if found.remainder <= _LAX * self.accuracy:
            return ""
        return "the curvature of the merit is not positive" if not found.lowest > 0.0 else "allow more products"

    def _complain(self, fault: str) -> None:
        message = f"the solve ended where it has no derivative: {fault}"
        if self.on_fault == "error":
            raise DerivativeError(message)
        warnings.warn(message + "; its Gauss-Newton matrix is used in place of it", stacklevel=5)


@dataclass(frozen=True)
class _Call:
    """All that the backward pass of one solve needs."""

    layer: ProjectionLayer
    problem: Problem
    found: dict[str, Tensor]
    names: list[str]
    info: LayerInfo

    def pulled_back(self, cotangents: Sequence[Tensor], values: Sequence[Tensor]) -> list[Tensor | None]:
        """Gradients of the parameters, then of the blocks of the start."""
        layer, layout, free = self.layer, self.problem.layout, self.problem.structure.free
        with torch.enable_grad():
            given = [value.detach().requires_grad_(value.is_floating_point()) for value in values]
            terms = list(layer.terms(dict(zip(self.names, given, strict=True))))
        merit = MeritDerivatives(layout, terms, self.found, free)
        right = layout.flatten(dict(zip(layout.sizes, cotangents, strict=True)))
        precondition = Preconditioner(self.problem.solved_by(layer.solver), self.found)
        multiplier = self._solve(merit, precondition, right * free)
        start = torch.where(free, 0.0, right - merit.product(multiplier))
        slopes: list[Tensor | None] = [None] * len(given)
        wanted = [number for number, value in enumerate(given) if value.requires_grad]
        if wanted and merit.gradient.requires_grad:
            for number, slope in zip(wanted, merit.pulled_back(-multiplier, [given[n] for n in wanted]), strict=True):
                slopes[number] = torch.zeros_like(given[number]) if slope is None else slope
        return [*slopes, *layout.unflatten(start).values()]

    def _solve(self, merit: MeritDerivatives, precondition: Preconditioner, right: Tensor) -> Tensor:
        layer = self.layer
        faulty = self.info.point is not None and bool(self.info.point.fault)
        if faulty:
            found = stationary(merit.free_product, precondition, right, 1)
        elif layer.backward_by == "unroll":
            found = stationary(merit.free_product, precondition, right, layer.unrolled_steps)
        else:
            found = conjugate(merit.free_product, precondition, right, layer.accuracy, layer.products)
        self.info.adjoint = found
        fault = "" if faulty else layer._fault_of(found)
        if fault:
            layer._complain(f"the adjoint equations are left at {found.remainder:.1e} of their right side: {fault}")
            return precondition(right)
        return found.values


class _Minimiser(Function):
    """``(call, *parameters, *start) -> blocks``."""

    @staticmethod
    def forward(ctx: Any, call: _Call, *inputs: Tensor) -> tuple[Tensor, ...]:
        ctx.call = call
        ctx.save_for_backward(*inputs)
        return tuple(block.clone() for block in call.found.values())

    @staticmethod
    def backward(ctx: Any, *cotangents: Tensor) -> tuple[Tensor | None, ...]:
        inputs = ctx.saved_tensors
        with torch.no_grad():
            slopes = ctx.call.pulled_back([c.detach() for c in cotangents], inputs[: len(ctx.call.names)])
        if torch.is_grad_enabled():
            slopes = [None if s is None else _Once.apply(s, *cotangents, *inputs) for s in slopes]  # type: ignore[no-untyped-call]
        return (None, *slopes)


class _Once(Function):
    """A gradient that says why it cannot be differentiated again."""

    @staticmethod
    def forward(ctx: Any, slope: Tensor, *others: Tensor) -> Tensor:
        return slope.clone()

    @staticmethod
    def backward(ctx: Any, *cotangents: Tensor) -> tuple[None, ...]:
        raise DerivativeError(
            "second derivatives of a solve are not there: the backward pass of ProjectionLayer is differentiable once. "
            "Take finite differences of its gradients, or leave out create_graph=True"
        )
