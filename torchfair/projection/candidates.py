"""What is tried in one step: the step, a corrected one, and a longer one."""

from __future__ import annotations

from .damped_solution import numbers
from .proposal import Proposal
from .state import ProjectionState
from .trials import Trials

_LONGEST_EXTRAPOLATION = 3.0
_LARGEST_CORRECTION = 0.75  # of the step, in the norm of the damping (Transtrum and Sethna 2012)


def try_candidates(trials: Trials, proposal: Proposal, state: ProjectionState) -> None:
    """Offers the step, the step corrected for curvature, and a longer one where it gained more than promised.

    Where every step is taken, that is all that is tried.
    """
    change, settings = proposal.change, state.settings
    if settings.takes_every_step:
        trials.take(change)
        return
    trial = trials.offer(change)
    bent = [gain < settings.least_uncorrected_gain for gain in trials.gains]
    if trial is not None and any(bent):
        correction = proposal.correction(trial, change, state.accuracy)
        proposal.system.spare()
        weights, layout = proposal.damping, proposal.system.structure.layout
        sizes = [layout.member_sums(weights * part.square()) for part in (correction, change)]
        moderate = (sizes[0] <= _LARGEST_CORRECTION**2 * sizes[1]).tolist()
        if any(map(all, zip(bent, moderate, strict=True))):
            trials.offer(change + correction, [b and m for b, m in zip(bent, moderate, strict=True)])
    # A reweighted model lies above the merit: with a gain of 1.5 its curvature is twice too large, and
    # the best step along the same line is twice as long.
    factors = [_extrapolation(gain) for gain in trials.gains]
    longer = [factor > settings.least_extrapolation for factor in factors]
    if any(longer):
        spread = proposal.system.structure.layout.member_spread(numbers(factors, change))
        trials.offer(spread * change, longer, again=True)


def _extrapolation(gain: float) -> float:
    """Length, in steps, at which a parabola is lowest that starts as promised and has the gain seen."""
    return min(1.0 / (2.0 - gain), _LONGEST_EXTRAPOLATION) if gain < 2.0 else _LONGEST_EXTRAPOLATION
