"""Guided projection as a layer: blocks that are differentiable functions of what the terms are made of."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Unpack

import torch
from torch import Tensor, nn

from .._numbers import check_count, check_number
from ..errors import ShapeError
from ..linear import LinearSolver
from ..settings.projection_settings import ProjectionSettings
from .adjoint import AdjointSolution
from .guided_projection import GuidedProjection
from .implicit import BackwardOptions, BackwardRule, MakeTerms, Minimum
from .layout import State
from .result import ProjectionResult
from .stationary_point import StationaryPoint, polished


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
        tolerance: The end is polished by Newton steps until the next one is shorter than this, relative to the extent
            of the blocks.
        newton_steps: Most of these.
        options: Of the backward pass, see :class:`BackwardRule`.

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
        tolerance: float = 1e-7,
        newton_steps: int = 8,
        **options: Unpack[BackwardOptions],
    ) -> None:
        super().__init__()
        self.rule = BackwardRule(**options)
        check_count("newton_steps", newton_steps, least=0)
        check_number("tolerance", tolerance, above=True, finite=True)
        self.terms, self.settings, self.tolerance, self.newton_steps = terms, settings, tolerance, newton_steps
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
            products=self.rule.products,
        )
        if info.point.fault:
            self.rule.complain(info.point.fault)
        else:
            found = info.point.blocks
        return Minimum(self.rule, self.terms, problem, found, info).as_function_of(parameters, blocks), info

    def _problem_with(self, parameters: dict[str, Tensor]) -> GuidedProjection:
        terms = self.terms(parameters)
        if self._problem is None:
            self._problem = GuidedProjection(self._example, terms, fixed=self._fixed, solver=self._asked())
        return self._problem.with_terms(terms)

    def _asked(self) -> str | LinearSolver:
        return "auto" if self.settings is None else self.settings.solver
