"""What a run of guided projection returns."""

from __future__ import annotations

import enum
from dataclasses import dataclass, field, fields
from typing import TYPE_CHECKING

from torch import Tensor

from .._short_repr import short_repr

if TYPE_CHECKING:
    from .state import ProjectionState

_RECENT = 10  # steps
_FEW = 5  # steps, of which nothing is said


class Status(enum.Enum):
    """Why the iteration ended. ``message`` says what it means and what to do about it."""

    STEP_TOLERANCE = "converged: steps are shorter than step_tolerance, and longer ones would not lower the merit"
    GRADIENT_TOLERANCE = "converged: the gradient is smaller than gradient_tolerance"
    MERIT_TOLERANCE = (
        "converged: the merit falls by less than merit_tolerance in a step, and no other step would lower it"
    )
    ZERO_MERIT = "converged: there is nothing left to lower, every residual is zero (to step_tolerance)"
    SETTLED = (
        "not converged: the merit falls by less than merit_tolerance in a step, but other steps would lower it more"
    )
    MAX_ITERATIONS = "max_iterations reached: allow more iterations, or accept the result"
    TIME_LIMIT = "time_limit reached: allow more time, or accept the result"
    STALLED = (
        "not converged: no damped step lowers the merit although the gradient is not small; residuals are not smooth "
        "here, their derivatives wrong, or the guard refuses what would help"
    )
    INTERRUPTED = "interrupted: the result is the best state found until then"
    CALLBACK = "stopped by the callback: the result is the best state found until then"
    DIVERGED = (
        "diverged: a step led to residuals that are not finite; the result is the state before it. Where every step is "
        "taken, raise initial_damping, or let steps be judged"
    )
    SINGULAR = "the linear system stayed singular at the largest damping: check the term named below"

    @property
    def converged(self) -> bool:
        """Whether a tolerance was met at a state that was certified to be a minimum."""
        return self in {
            Status.STEP_TOLERANCE,
            Status.GRADIENT_TOLERANCE,
            Status.MERIT_TOLERANCE,
            Status.ZERO_MERIT,
        }

    @property
    def at_rest(self) -> bool:
        """Whether a tolerance was met, be it at a minimum or not."""
        return self.converged or self is Status.SETTLED


@dataclass(frozen=True)
class TermResidual:
    """One row of the residual table: unweighted residual norms over the elements of a term.

    Attributes:
        mean, largest: of the norm of the residual of an element, in the units of the residual.
        merit: weighted share of the merit.
    """

    name: str
    weight: float
    elements: int
    mean: float
    largest: float
    merit: float


@dataclass(frozen=True)
class IterationRecord:
    """One damped step.

    Attributes:
        iteration: Counted from 1; record 0 is the start.
        merit: Merit of the best state after this iteration; never rises, unless every step is taken: then that of the
            last state, which stands for the best one everywhere here.
        damping: Levenberg-Marquardt parameter with which the step was made.
        gain: Actual decrease of the merit over the predicted one.
        step: Largest change of an unknown.
        gradient: Scaled gradient of the best state: the largest cosine between the residual and a column of the
            Jacobian. It has no unit; at a minimum with residuals it is nearly zero, where all residuals vanish it means
            nothing.
        accepted: Whether the step was taken.
        inner_iterations: Iterations of the linear solver; with inequalities, over all systems solved for the step.
        elapsed: Seconds since the start.
        quantities: What ``observe`` returned for the best state, for example energies.
        timings: Seconds spent in ``linearise``, ``solve`` and ``merit``.
        state: Where the run stands; only for callbacks, None in the history.
    """

    iteration: int
    merit: float
    damping: float
    gain: float
    step: float
    gradient: float
    accepted: bool
    inner_iterations: int
    elapsed: float
    quantities: dict[str, float] = field(default_factory=dict)
    timings: dict[str, float] = field(default_factory=dict, compare=False, repr=False)
    state: ProjectionState | None = field(default=None, compare=False, repr=False)

    def as_dict(self) -> dict[str, object]:
        """For JSON; the quantities stand beside the other entries."""
        hidden = ("quantities", "timings", "state")
        return {f.name: getattr(self, f.name) for f in fields(self) if f.name not in hidden} | self.quantities


@dataclass(frozen=True)
class ProjectionResult:
    """The best state found, and how it was found.

    Attributes:
        blocks: The state.
        status: Why the iteration ended; ``message`` is its text with details.
        residuals: Residual table at the final state.
        initial_residuals: Residual table at the start.
        history: One record for each damped step, the start first.
        solver: Name of the linear solver; ``"none"`` where a large problem was interrupted before it was set up.
        timings: Seconds spent in ``linearise``, ``solve`` and ``merit``, and ``total``.
    """

    blocks: dict[str, Tensor]
    status: Status
    message: str
    residuals: list[TermResidual]
    initial_residuals: list[TermResidual]
    history: list[IterationRecord]
    solver: str
    timings: dict[str, float]

    __repr__ = short_repr

    @property
    def merit(self) -> float:
        """Final merit."""
        return self.history[-1].merit

    @property
    def gradient(self) -> float:
        """Scaled gradient of the final state, see :class:`IterationRecord`."""
        return self.history[-1].gradient

    @property
    def recent_fall(self) -> float:
        """By which fraction the merit still fell in the last ten accepted steps (or in as many as there were)."""
        return _recent_fall(self.history)

    @property
    def iterations(self) -> int:
        """Number of damped steps tried."""
        return self.history[-1].iteration

    def table(self) -> str:
        """The residual table as text."""
        lines = [f"{'term':<28}{'weight':>10}{'elements':>10}{'mean':>12}{'max':>12}{'merit':>12}"]
        lines += [
            f"{r.name:<28}{r.weight:>10.3g}{r.elements:>10}{r.mean:>12.3e}{r.largest:>12.3e}{r.merit:>12.3e}"
            for r in self.residuals
        ]
        return "\n".join(lines)


def message_of(status: Status, history: list[IterationRecord], detail: str = "") -> str:
    """What a status means, and how near a minimum the last state is."""
    parts = [status.value, *([detail] if detail else [])]
    if history and status is not Status.ZERO_MERIT:
        parts += [_nearness(history), *_refusals(history)]
    return "; ".join(parts)


def _nearness(history: list[IterationRecord]) -> str:
    """How fast the merit fell at last, and how steep it is."""
    gradient, fall = history[-1].gradient, 100.0 * _recent_fall(history)
    steps = min(sum(record.accepted for record in history) - 1, _RECENT)
    steep = f"scaled gradient {gradient:.1e} (0 at a minimum)"
    if steps < 1:
        return f"no step has lowered the merit; {steep}"
    words = "1 step has" if steps == 1 else f"{steps} steps have"
    way = "lowered" if fall >= 0.0 else "raised"
    return f"the last {words} {way} the merit by {abs(fall):.2g} %; {steep}"


def _refusals(history: list[IterationRecord]) -> list[str]:
    """Says so where most steps were refused."""
    steps = len(history) - 1
    refused = sum(not record.accepted for record in history[1:])
    if steps < _FEW or refused <= steps / 2:
        return []
    return [
        f"{refused} of {steps} steps were refused, since they would have raised the merit: terms of very different "
        "weights or elements of very different sizes allow short ones only"
    ]


def _recent_fall(history: list[IterationRecord]) -> float:
    merits = [record.merit for record in history if record.accepted][-_RECENT - 1 :]
    return (merits[0] - merits[-1]) / merits[0] if merits and merits[0] > 0.0 else 0.0
