"""Damped steps that heed inequalities: also those which hold now and would not hold after the step."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from ..linear import LinearSolver
from .loss import is_one_sided
from .proposal import Proposal
from .system import LinearSystem

_MOST_SOLVES = 6
_ENOUGH = 0.1  # of the fall of the model: cost of inequalities wrongly heeded or ignored that is worth a solve
_WHOLE = 0.9  # of a change that is all but gone to its end
_HALVINGS = 40


class Inequalities:
    """A linearised problem with one-sided terms.

    Args:
        whole: The system that takes all their components for equations.
        numbers: Which terms of ``Structure.compiled`` are one-sided.

    Attributes:
        broken: (n,) bool: inequalities that do not hold at the state.
    """

    def __init__(self, whole: LinearSystem, numbers: list[int]) -> None:
        self._whole, self._numbers = whole, numbers
        equations = [r for number, r in enumerate(whole.residuals) if number not in numbers]
        if whole.affine_residual is not None:
            equations.append(whole.affine_residual)
        inequalities = [whole.residuals[number] for number in numbers]
        self._equations, self._inequalities = (_flat(part, inequalities[0]) for part in (equations, inequalities))
        self.broken = self._inequalities > 0.0

    @classmethod
    def of(cls, whole: LinearSystem) -> Inequalities | None:
        """None if no term is one-sided."""
        terms = [compiled.term for compiled in whole.structure.compiled]
        numbers = [number for number, term in enumerate(terms) if is_one_sided(term.loss)]
        return cls(whole, numbers) if numbers else None

    def heeding(self, heeded: Tensor) -> LinearSystem:
        """The system that takes inequalities (n,) bool for equations and leaves the others out."""
        jacobians, residuals, start = list(self._whole.jacobians), list(self._whole.residuals), 0
        for number in self._numbers:
            values = residuals[number]
            chosen = heeded[start : start + values.numel()].view(values.shape)
            start += values.numel()
            residuals[number] = values * chosen
            jacobians[number] = jacobians[number] * chosen[:, None]
        return LinearSystem(self._whole.structure, jacobians, residuals, self._whole.affine_residual)

    def propose(self, solver: LinearSolver, damping: Tensor, likely: Tensor | None, accuracy: float) -> Proposal:
        """The step that minimises the merit of linearised residuals, plus damping.

        That is a convex, piecewise quadratic function. Newton's method for it asks after every linear solve which
        inequalities the solution breaks, and goes as far towards the solution as the function falls. It stops at the
        minimum, or near it.

        Args:
            solver: Linear solver, prepared for the systems of this structure.
            damping: (N,) diagonal.
            likely: (n,) inequalities that are likely to be heeded, such as those of the step before.
            accuracy: Relative remainder of linear solutions that is good enough.
        """
        free = self._whole.structure.free
        start = at = _Point(torch.zeros_like(damping), self._equations, self._inequalities, damping)
        heeded = self.broken if likely is None else self.broken | likely
        iterations = 0
        for _ in range(_MOST_SOLVES):
            system = self.heeding(heeded)
            factor = solver.factorise(system, damping)
            solution = factor.solve(-system.gradient, accuracy)
            iterations += solution.iterations
            at, whole = at.lowest_along(*self._along(solution.values * free - at.change))
            broken = at.inequalities > 0.0
            missed = torch.where(broken != heeded, at.inequalities, 0.0)
            heeded = broken
            if whole and 0.5 * float(missed @ missed) <= _ENOUGH * (start.damped - at.damped):
                break
        return Proposal(at.change, start.merit - at.merit, iterations, system, factor, damping, heeded)

    def _along(self, change: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """A step (N,) and the changes of equations and inequalities that come with it, by the linear model."""
        structure = self._whole.structure
        equations: list[Tensor] = []
        inequalities: list[Tensor] = []
        for number, (compiled, jacobian) in enumerate(zip(structure.compiled, self._whole.jacobians, strict=True)):
            changes = torch.einsum("mkn,kn->mn", jacobian, change[compiled.unknowns])
            (inequalities if number in self._numbers else equations).append(changes)
        if structure.affine is not None:
            equations.append(structure.affine.change(change))
        return change, _flat(equations, change), _flat(inequalities, change)


class _Point(NamedTuple):
    """A step with the residuals after it."""

    change: Tensor
    equations: Tensor
    inequalities: Tensor
    damping: Tensor

    @property
    def merit(self) -> float:
        """Merit of the linearised residuals."""
        broken = self.inequalities.clamp_min(0.0)
        return 0.5 * float(self.equations @ self.equations + broken @ broken)

    @property
    def damped(self) -> float:
        """The same plus damping: what a step minimises."""
        return self.merit + 0.5 * float(self.change @ (self.damping * self.change))

    def lowest_along(self, change: Tensor, equations: Tensor, inequalities: Tensor) -> tuple[_Point, bool]:
        """Where :attr:`damped` is lowest along a change, with the changes of residuals given; whether near its end."""
        damped = self.damping * change
        slope = float(equations @ self.equations + damped @ self.change)
        curvature = float(equations @ equations + damped @ change)

        def rises(length: float) -> bool:
            broken = (self.inequalities + length * inequalities).clamp_min(0.0)
            return slope + length * curvature + float(broken @ inequalities) > 0.0

        length = 1.0
        if rises(1.0):
            length, beyond = 0.0, 1.0
            for _ in range(_HALVINGS):
                middle = 0.5 * (length + beyond)
                length, beyond = (length, middle) if rises(middle) else (middle, beyond)
        lowest = _Point(
            self.change + length * change,
            self.equations + length * equations,
            self.inequalities + length * inequalities,
            self.damping,
        )
        return lowest, length > _WHOLE


def _flat(parts: list[Tensor], like: Tensor) -> Tensor:
    return torch.cat([like.new_zeros(0), *(part.reshape(-1) for part in parts)])
