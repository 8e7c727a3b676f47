"""How one problem, or one member of a batch, goes on: merit, damping, and why it ends."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from .damping import Damping
from .result import Status
from .settings import ProjectionSettings

_TIGHTEST_ACCURACY = 1e-8
_PATIENCE_WHEN_DAMPED = 4


@dataclass(frozen=True)
class Outcome:
    """What became of a step.

    Attributes:
        damping: With which it was made.
        gain: Actual decrease of the merit over the predicted one.
        size: Largest change of an unknown.
        short: Whether that is below the tolerance of steps.
        accepted: Whether it was taken.
    """

    damping: Damping
    gain: float
    size: float
    short: bool
    accepted: bool


@dataclass(frozen=True)
class Course:
    """The numbers that are carried from step to step.

    Attributes:
        merit: Of the best state.
        gradient: Its largest scaled component there.
        damping: Of the next step.
        accuracy: Relative remainder asked of an iterative linear solver.
        iteration: Damped steps tried so far.
        falls: Relative decreases of the merit in accepted steps, the last ones.
        last: What became of the last step.
        status: Why the last step ended the run, if it did.
    """

    merit: float
    gradient: float
    damping: Damping
    accuracy: float
    iteration: int = 0
    falls: tuple[float, ...] = ()
    last: Outcome | None = None
    status: Status | None = None

    def after(
        self, outcome: Outcome, merit: float, gradient: float, settings: ProjectionSettings, *, inexact: bool
    ) -> Course:
        """After a step.

        Args:
            outcome: What became of it.
            merit: Of the best state now.
            gradient: Likewise.
            settings: Tolerances.
            inexact: Whether the linear solver is only as accurate as asked for.
        """
        tried = replace(self, iteration=self.iteration + 1, last=outcome)
        if not outcome.accepted:
            damping = outcome.damping.rejected()
            status = Status.STALLED if outcome.short or damping.exhausted else None
            return replace(tried, damping=damping, status=status)
        moved = replace(tried, merit=merit, gradient=gradient, damping=outcome.damping.accepted(outcome.gain))
        moved = moved._settled((self.merit - merit) / self.merit, outcome.damping.value, settings, inexact)
        return replace(moved, status=Status.STEP_TOLERANCE) if outcome.short else moved

    def _settled(self, fall: float, damping: float, settings: ProjectionSettings, inexact: bool) -> Course:
        """Whether the merit has come to rest; if so, with an iterative linear solver also when that is tightened.

        Steps that heavy damping kept short say little, so more of them are waited for. A relative remainder
        changes the decrease of the merit by its square, hence the tightest one worth asking for.
        """
        patience = settings.patience * (1 if damping <= settings.initial_damping else _PATIENCE_WHEN_DAMPED)
        falls = (*self.falls, fall)[-_PATIENCE_WHEN_DAMPED * settings.patience :]
        after = replace(self, falls=falls)
        if len(falls) < patience or max(falls[-patience:]) >= settings.merit_tolerance:
            return after
        tightest = max(0.1 * math.sqrt(settings.merit_tolerance), _TIGHTEST_ACCURACY)
        if inexact and self.accuracy > tightest:
            return replace(after, accuracy=max(0.1 * self.accuracy, tightest), falls=())
        return replace(after, status=Status.MERIT_TOLERANCE)

    def finished(self, settings: ProjectionSettings) -> Status | None:
        """Why it ends; None if it goes on."""
        if self.status is not None:
            return self.status
        if self.merit == 0.0:
            return Status.ZERO_MERIT
        if self.gradient <= settings.gradient_tolerance:
            return Status.GRADIENT_TOLERANCE
        return Status.MAX_ITERATIONS if self.iteration >= settings.max_iterations else None
