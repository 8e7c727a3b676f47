"""The solution of the damped system, with more damping where it is singular."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import torch
from torch import Tensor

from ..errors import SingularSystemError
from .damping import Damping
from .linear_system import LinearSystem
from .problem import Problem
from .proposal import Proposal
from .state import ProjectionState


def propose(problem: Problem, state: ProjectionState) -> tuple[Proposal | None, list[Damping]]:
    """A step, None where the system is singular at every damping; and the damping that it needed.

    Members of a batch whose part is singular get more damping than the others. Those for which none is enough are left
    out of the step: ``Proposal.lost``.
    """
    dampings, lost = [course.damping for course in state.courses], set(state.singular)
    lost |= {number for number, damping in enumerate(dampings) if damping.exhausted and not _ended(state, number)}
    while len(lost) < len(dampings):
        at = state.linearised.without(lost)
        diagonal = _damping(problem, state, dampings, lost)
        try:
            proposal = at.propose(problem.solver, diagonal, state.heeded, state.accuracy)
        except SingularSystemError as error:
            for number in culprits(error, at.system, lost):
                dampings[number] = dampings[number].rejected()
                if dampings[number].exhausted:
                    lost.add(number)
            continue
        if not lost:
            return proposal, dampings
        still = torch.where(_spread(problem, lost), 0.0, proposal.change)
        return replace(proposal, change=still, lost=frozenset(lost)), dampings
    return None, dampings


def culprits(error: SingularSystemError, system: LinearSystem, known: set[int]) -> set[int]:
    """Members of a batch that make its system singular, as far as can be told, without those known before."""
    layout = system.structure.layout
    found = set(error.blocks or ()) - known
    if layout.members > 1 and not found:
        finite = torch.isfinite(layout.member_sums(system.diagonal) + layout.member_sums(system.gradient.abs()))
        found = {number for number, is_finite in enumerate(finite.tolist()) if not is_finite} - known
    return found or set(range(layout.members)) - known


def numbers(values: Sequence[float], like: Tensor) -> Tensor:
    """(members,) numbers; a single one needs no copy to another device."""
    return like.new_full((1,), values[0]) if len(values) == 1 else like.new_tensor(values)


def _ended(state: ProjectionState, number: int) -> bool:
    return state.courses[number].finished(state.settings) is not None


def _damping(problem: Problem, state: ProjectionState, dampings: Sequence[Damping], lost: set[int]) -> Tensor:
    """(N,) the diagonal to be added; one where nothing is felt."""
    stiffness = state.linearised.stiffness
    values = problem.layout.member_spread(numbers([damping.value for damping in dampings], stiffness))
    scaled = values if state.settings.damping_scale == "identity" else values * stiffness
    diagonal = torch.where(stiffness > 0.0, scaled.clamp_min(torch.finfo(scaled.dtype).tiny), 1.0)
    return torch.where(_spread(problem, lost), 1.0, diagonal) if lost else diagonal


def _spread(problem: Problem, members: set[int]) -> Tensor:
    """(N,) bool: unknowns of these members."""
    chosen = torch.zeros(problem.layout.members, dtype=torch.bool)
    chosen[list(members)] = True
    return problem.layout.member_spread(chosen.to(problem.layout.device))
