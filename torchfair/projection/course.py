"""How one problem, or one member of a batch, goes on: merit, damping, and why it ends."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from ..settings.projection_settings import ProjectionSettings
from .damping import Damping
from .result import Status

_MOST_IDLE = 8  # steps in a row


@dataclass(frozen=True)
class Standing:
    """Numbers of one member at its best state.

    Attributes:
        merit: Sum of the true losses.
        gradient: Largest cosine between the residual and a column of the Jacobian, ``|J_i . r| / (|J_i| |r|)``.
        floor: Merit below which all residuals are zero, as far as ``step_tolerance`` tells: what a relative change of
            the unknowns by that much makes of it.
    """

    merit: float
    gradient: float
    floor: float

    @property
    def is_zero(self) -> bool:
        """Whether all residuals are zero, as far as can be told."""
        return self.merit == 0.0 or self.merit <= self.floor

    def is_flat(self, settings: ProjectionSettings) -> bool:
        """Whether there are residuals, but no gradient."""
        return self.gradient <= settings.gradient_tolerance and not self.is_zero


@dataclass(frozen=True)
class Outcome:
    """What became of a step.

    Attributes:
        damping: With which it was made.
        gain: Actual decrease of the merit over the predicted one.
        size: Largest change of an unknown.
        short: Whether the step is below ``step_tolerance``, or promises a fall that cannot be computed.
        accepted: Whether it was taken.
        halvings: How often it was halved as a whole.
    """

    damping: Damping
    gain: float
    size: float
    short: bool
    accepted: bool
    halvings: int = 0


@dataclass(frozen=True)
class Course:
    """The numbers that are carried from step to step.

    Attributes:
        standing: At the best state.
        damping: Of the next step.
        accuracy: Relative remainder asked of an iterative linear solver.
        iteration: Damped steps tried so far.
        falls: Relative decreases of the merit in the last accepted steps; negative ones only where every step is taken.
        last: What became of the last step.
        suspicion: Status that the run ends with if a minimum is certified here.
        doubted: Whether this state was suspected before.
        idle: Damping of the last steps, as far back as all were short and lowered the merit by less than its tolerance.
        status: Why the run ends, if it does.
    """

    standing: Standing
    damping: Damping
    accuracy: float
    iteration: int = 0
    falls: tuple[float, ...] = ()
    last: Outcome | None = None
    suspicion: Status | None = None
    doubted: bool = False
    idle: tuple[float, ...] = ()
    status: Status | None = None

    @property
    def merit(self) -> float:
        """Of the best state."""
        return self.standing.merit

    @property
    def gradient(self) -> float:
        """Its scaled gradient, see :class:`Standing`."""
        return self.standing.gradient

    def after(self, outcome: Outcome, standing: Standing, settings: ProjectionSettings, *, inexact: bool) -> Course:
        """After a step.

        Args:
            outcome: What became of it.
            standing: At the best state now.
            settings: Tolerances.
            inexact: Whether the linear solver is only as accurate as asked for.
        """
        iteration = self.iteration + 1
        if not outcome.accepted and settings.takes_every_step:
            return replace(self, iteration=iteration, last=outcome, status=Status.DIVERGED)
        if not outcome.accepted:
            damping = outcome.damping.rejected(outcome.gain)
            suspected = damping.exhausted or (outcome.short and not self.doubted)
            return Course(
                self.standing,
                damping,
                self.accuracy,
                iteration,
                self.falls,
                outcome,
                suspicion=Status.STEP_TOLERANCE if suspected else None,
                doubted=self.doubted or suspected,
                idle=self._idle_after(outcome) if outcome.short else (),
            )
        fall = (self.merit - standing.merit) / self.merit
        moved = Course(
            standing,
            outcome.damping.shortened(outcome.halvings) if outcome.halvings else outcome.damping.accepted(outcome.gain),
            self.accuracy,
            iteration,
            (*self.falls, fall)[-settings.patience_when_damped * settings.patience :],
            outcome,
        )
        if outcome.short:
            is_idle = fall < settings.merit_tolerance and not settings.takes_every_step
            return replace(moved, idle=self._idle_after(outcome) if is_idle else (), suspicion=Status.STEP_TOLERANCE)
        return moved._rested(outcome.damping.value, settings, inexact)

    def _idle_after(self, outcome: Outcome) -> tuple[float, ...]:
        return (*self.idle, outcome.damping.value)[-_MOST_IDLE:]

    def _rested(self, damping: float, settings: ProjectionSettings, inexact: bool) -> Course:
        """Whether the merit has come to rest; if so, with an iterative linear solver also when that is tightened.

        It rises in no step, unless every step is taken.

        Steps that heavy damping kept short say little, so more of them are waited for where no certificate is asked for
        that sees through them. A relative remainder changes the decrease of the merit by its square, hence the tightest
        one worth asking for.
        """
        if self.standing.is_flat(settings):
            return replace(self, suspicion=Status.GRADIENT_TOLERANCE)
        heavy = damping > settings.initial_damping and settings.when_settled != "go on"
        patience = settings.patience * (settings.patience_when_damped if heavy else 1)
        if len(self.falls) < patience or max(map(abs, self.falls[-patience:])) >= settings.merit_tolerance:
            return self
        if inexact and self.accuracy > tightest_accuracy(settings):
            return replace(self, accuracy=max(0.1 * self.accuracy, tightest_accuracy(settings)), falls=())
        return replace(self, suspicion=Status.MERIT_TOLERANCE)

    def judged(self, *, certified: bool, goes_on: bool) -> Course:
        """After a suspicion.

        Args:
            certified: Whether this is a minimum.
            goes_on: Whether the run goes on where it is none (unless no damping is left, or the last steps have been
                idle, and the damping that kept them short has not fallen meanwhile).
        """
        idle = len(self.idle) == _MOST_IDLE and self.idle[-1] >= self.idle[0]
        is_stuck = self.damping.exhausted or idle
        otherwise = Status.STALLED if is_stuck else None if goes_on else Status.SETTLED
        status = self.suspicion if certified else otherwise
        return replace(self, suspicion=None, falls=self.falls if certified else (), status=status)

    def finished(self, settings: ProjectionSettings) -> Status | None:
        """Why it ends; None if it goes on."""
        if self.status is not None:
            return self.status
        if self.standing.is_zero:
            return Status.ZERO_MERIT
        return Status.MAX_ITERATIONS if self.iteration >= settings.max_iterations else None


def tightest_accuracy(settings: ProjectionSettings) -> float:
    """Relative remainder beyond which an iterative linear solver is not asked to go."""
    return max(0.1 * math.sqrt(settings.merit_tolerance), 1e-8)
