"""Whether a state is a minimum: what an undamped step promises there."""

from __future__ import annotations

import torch
from torch import Tensor

from ..errors import SingularSystemError
from .course import Course, tightest_accuracy
from .damped_solution import culprits
from .problem import Problem
from .proposal import Proposal
from .state import ProjectionState
from .vanishing import vanishing

_PROBE = 1e-14  # damping, relative to the diagonal: as good as none
_ROUNDING = 2.0**-52
_NEAR = 1e-3  # of the size of the unknowns: length of the probe along which curvature is measured


def certified(problem: Problem, state: ProjectionState) -> list[bool]:
    """For each member, whether the undamped step promises no fall of the merit that is worth having.

    A small step may be due to heavy damping, a small gradient to the units of the unknowns. The predicted fall of the
    undamped step is free of both: relative to the merit it is the square of the relative offset of Bates and Watts
    (1981). It must be below ``merit_tolerance`` (or, where all residuals are zero as far as
    ``step_tolerance`` tells, below what that makes of the merit). Where the
    Jacobian is nearly singular this cannot be had at true minima either; there the curvature of the merit along the
    undamped step decides, by two more evaluations.
    """
    settings, layout, system = state.settings, problem.layout, state.linearised.system
    proposal, singular = _undamped(problem, state)
    if proposal is None:
        return [False] * layout.members
    diagonal = torch.where(system.diagonal > 0.0, system.diagonal, 1.0)
    flat = layout.flatten(state.evaluation.state)
    sizes = layout.member_sums(system.diagonal * flat.square())
    merits = state.evaluation.merits
    # Beside one stiff constraint what step_tolerance makes of the merit may be more than all else is worth. So it
    # counts only where no term has residuals to speak of; elsewhere rounding is all that may be left.
    zero = vanishing(system, state.evaluation.state, settings.step_tolerance)
    finest = min(settings.step_tolerance, 4.0 * torch.finfo(flat.dtype).eps)
    bounds = settings.merit_tolerance * merits + 0.5 * torch.where(zero, settings.step_tolerance, finest) ** 2 * sizes
    # The exact solution never promises a rise: if this one does, by more than that, it is too inaccurate to tell.
    promises_nothing = proposal.predicted.abs() <= bounds
    lengths = (_NEAR * (sizes / layout.member_sums(diagonal * proposal.change.square())).sqrt()).clamp(max=1.0)
    lengths = torch.where(torch.isfinite(lengths), lengths, 1.0)
    curvatures = _curvatures(problem, flat, layout.member_spread(lengths) * proposal.change, merits) / lengths.square()
    slopes = layout.member_sums(system.gradient * proposal.change)
    seen = torch.isfinite(curvatures) & (curvatures > 4.0 * _ROUNDING * merits / lengths.square())
    curved = seen & (0.5 * slopes.square() / torch.where(seen, curvatures, 1.0) <= bounds)
    flat_enough = merits.new_tensor([_is_flat(course, settings.merit_tolerance) for course in state.courses]) > 0.0
    lost = layout.member_largest(_lost(state).to(merits)) > 0.0
    answers: list[bool] = ((promises_nothing | (curved & flat_enough)) & ~lost).tolist()
    return [answer and number not in singular for number, answer in enumerate(answers)]


def _lost(state: ProjectionState) -> Tensor:
    """(N,) unknowns that were felt before and are felt no more, although their elements have residuals.

    They have run away to where the merit does not depend on them, as far as numbers can tell: no minimum.
    """
    system = state.linearised.system
    pairs = zip(system.residuals, system.structure.compiled, strict=True)
    residuals = [r.square().sum(0).expand(sum(compiled.widths), -1) for r, compiled in pairs]
    return (system.diagonal == 0.0) & (state.linearised.stiffness > 0.0) & (system.structure.scatter(residuals) > 0.0)


def _undamped(problem: Problem, state: ProjectionState) -> tuple[Proposal | None, set[int]]:
    """The step with as good as no damping, and the members without one, since their part of the system is singular."""
    singular = set(state.singular)
    while len(singular) < problem.layout.members:
        at = state.linearised.without(singular)
        damping = _PROBE * torch.where(at.system.diagonal > 0.0, at.system.diagonal, 1.0)
        try:
            return at.propose(problem.solver, damping, state.heeded, tightest_accuracy(state.settings)), singular
        except SingularSystemError as error:
            singular |= culprits(error, at.system, singular)
    return None, singular


def _curvatures(problem: Problem, flat: Tensor, step: Tensor, merits: Tensor) -> Tensor:
    """(members,) second differences of the merit along a step, to both sides."""
    both = [problem.structure.evaluate(problem.layout.unflatten(flat + sign * step)).merits for sign in (1.0, -1.0)]
    return both[0] + both[1] - 2.0 * merits


def _is_flat(course: Course, tolerance: float) -> bool:
    """Whether no single unknown can lower the merit by more than its tolerance."""
    return course.gradient**2 <= tolerance
