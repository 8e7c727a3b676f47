"""Damped steps that heed inequalities: also those which hold now and would not hold after the step."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from ..linear import LinearSolver
from .linear_system import LinearSystem
from .loss import is_one_sided
from .proposal import Proposal, descend
from .system import Structure

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
        self._equations, self._inequalities = self._split(list(whole.residuals), whole.affine_residual)
        self._rows = _Members(whole.structure, numbers, whole)
        self.broken = self._inequalities > 0.0

    @classmethod
    def of(cls, whole: LinearSystem) -> Inequalities | None:
        """None if no term is one-sided."""
        terms = [compiled.term for compiled in whole.structure.compiled]
        numbers = [number for number, term in enumerate(terms) if is_one_sided(term.loss)]
        return cls(whole, numbers) if numbers else None

    def heeding(self, heeded: Tensor) -> LinearSystem:
        """The system that takes inequalities (n,) bool for equations and leaves the others out."""
        whole, start = self._whole, 0
        jacobians, residuals, felt = list(whole.jacobians), list(whole.residuals), list(whole.felt)
        for number in self._numbers:
            values = residuals[number]
            chosen = heeded[start : start + values.numel()].view(values.shape)
            start += values.numel()
            residuals[number] = values * chosen
            if whole.structure.partial[number]:
                known, some = felt[number], chosen.any(0)
                places = torch.nonzero(some if known is None else some[known]).squeeze(1)
                felt[number] = places if known is None else known[places]
                jacobians[number], chosen = jacobians[number][..., places], chosen[:, felt[number]]
            jacobians[number] = jacobians[number] * chosen[:, None]
        return LinearSystem(whole.structure, jacobians, residuals, whole.roots, whole.affine_residual, felt)

    def without(self, members: Collection[int]) -> Inequalities:
        """The same without some members of a batch, see :meth:`LinearSystem.without`."""
        return Inequalities(self._whole.without(members), self._numbers)

    def chosen_members(self, heeded: Tensor, chosen: list[int]) -> Tensor:
        """(n',) the inequalities heeded of some of the members of a batch alone, in the order of ``chosen``."""
        shapes = [self._whole.residuals[number].shape for number in self._numbers]
        parts = zip(torch.split(heeded, [shape.numel() for shape in shapes]), shapes, strict=True)
        count = self._whole.structure.layout.members
        views = [part.view(shape[0], count, shape[1] // count) for part, shape in parts]
        return torch.cat([view[:, chosen].reshape(-1) for view in views])

    def propose(self, solver: LinearSolver, damping: Tensor, likely: Tensor | None, accuracy: float) -> Proposal:
        """The step that minimises the merit of linearised residuals, plus damping.

        That is a convex, piecewise quadratic function. Newton's method for it asks after every linear solve which
        inequalities the solution breaks, and goes as far towards the solution as the function falls. It stops at the
        minimum, or near it; in a batch every member for itself.

        Args:
            solver: Linear solver, prepared for the systems of this structure.
            damping: (N,) diagonal.
            likely: (n,) inequalities that are likely to be heeded, such as those of the step before.
            accuracy: Relative remainder of linear solutions that is good enough.
        """
        structure, rows = self._whole.structure, self._rows
        start = at = _Point(torch.zeros_like(damping), self._equations, self._inequalities, damping, rows)
        heeded = self.broken if likely is None else self.broken | likely
        iterations, going = 0, torch.ones(structure.layout.members, dtype=torch.bool, device=damping.device)
        for _ in range(_MOST_SOLVES):
            system = self.heeding(heeded)
            factor = solver.factorise(system, damping)
            solution = descend(factor, -system.gradient, accuracy)
            iterations += solution.iterations
            change = (solution.values * structure.free - at.change) * structure.layout.member_spread(going)
            at, length = at.lowest_along(change, *self._split(*self._whole.changes(change)))
            broken = at.inequalities > 0.0
            missed = torch.where(broken != heeded, at.inequalities, 0.0)
            heeded = broken
            cost = 0.5 * rows.sums_of_inequalities(missed.square())
            going = going & ~((length > _WHOLE) & (cost <= _ENOUGH * (start.damped - at.damped)))
            if not bool(going.any()):
                break
        return Proposal(at.change, start.merit - at.merit, iterations, system, factor, damping, heeded)

    def _split(self, terms: list[Tensor], affine: Tensor | None) -> tuple[Tensor, Tensor]:
        """Equations and inequalities apart, each as one vector."""
        equations = [part for number, part in enumerate(terms) if number not in self._numbers]
        inequalities = [terms[number] for number in self._numbers]
        return _flat([*equations, *([] if affine is None else [affine])], inequalities[0]), _flat(inequalities)


class _Members:
    """To which member of a batch equations and inequalities belong."""

    def __init__(self, structure: Structure, numbers: list[int], system: LinearSystem) -> None:
        self._layout, self._count = structure.layout, structure.layout.members
        if self._count > 1:
            every = torch.arange(self._count, device=structure.device)
            owners = [every.repeat_interleave(r.shape[1] // self._count).expand_as(r) for r in system.residuals]
            affine = [] if structure.affine is None else [structure.affine.member_owners(self._count)]
            equations = [owner for number, owner in enumerate(owners) if number not in numbers]
            self._equations = _flat([*equations, *affine], every)
            self._inequalities = _flat([owners[number] for number in numbers])

    def sums(self, unknowns: Tensor, equations: Tensor, inequalities: Tensor) -> Tensor:
        """(members,) sums over all three."""
        total = self._layout.member_sums(unknowns) + self.sums_of_inequalities(inequalities)
        if self._count == 1:
            return total + equations.sum()
        return total.index_add(0, self._equations, equations)

    def sums_of_inequalities(self, values: Tensor) -> Tensor:
        """(members,) sums over inequalities."""
        if self._count == 1:
            return values.sum()[None]
        return values.new_zeros(self._count).index_add_(0, self._inequalities, values)

    def spread(self, values: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Values (members,) for unknowns, equations and inequalities."""
        if self._count == 1:
            return values, values, values
        return self._layout.member_spread(values), values[self._equations], values[self._inequalities]


@dataclass(frozen=True)
class _Point:
    """A step with the residuals after it."""

    change: Tensor
    equations: Tensor
    inequalities: Tensor
    damping: Tensor
    rows: _Members

    @property
    def merit(self) -> Tensor:
        """(members,) merits of the linearised residuals."""
        broken = self.inequalities.clamp_min(0.0)
        return 0.5 * self.rows.sums(torch.zeros_like(self.change), self.equations.square(), broken.square())

    @property
    def damped(self) -> Tensor:
        """The same plus damping: what a step minimises."""
        broken = self.inequalities.clamp_min(0.0)
        return 0.5 * self.rows.sums(self.damping * self.change.square(), self.equations.square(), broken.square())

    def lowest_along(self, change: Tensor, equations: Tensor, inequalities: Tensor) -> tuple[_Point, Tensor]:
        """Where :attr:`damped` is lowest along a change with these changes of residuals; and how far (members,)."""
        damped = self.damping * change
        nothing = torch.zeros_like(inequalities)
        slope = self.rows.sums(damped * self.change, equations * self.equations, nothing)
        curvature = self.rows.sums(damped * change, equations.square(), nothing)

        def rises(length: Tensor) -> Tensor:
            broken = (self.inequalities + self.rows.spread(length)[2] * inequalities).clamp_min(0.0)
            return slope + length * curvature + self.rows.sums_of_inequalities(broken * inequalities) > 0.0

        beyond = torch.ones_like(slope)
        too_far = rises(beyond)
        length = torch.where(too_far, 0.0, beyond)
        if bool(too_far.any()):
            for _ in range(_HALVINGS):
                middle = 0.5 * (length + beyond)
                falls = ~rises(middle)
                length, beyond = torch.where(falls, middle, length), torch.where(falls, beyond, middle)
        along, along_equations, along_inequalities = self.rows.spread(length)
        lowest = replace(
            self,
            change=self.change + along * change,
            equations=self.equations + along_equations * equations,
            inequalities=self.inequalities + along_inequalities * inequalities,
        )
        return lowest, length


def _flat(parts: list[Tensor], like: Tensor | None = None) -> Tensor:
    start = [] if like is None else [like.new_zeros(0)]
    return torch.cat([*start, *(part.reshape(-1) for part in parts)])
