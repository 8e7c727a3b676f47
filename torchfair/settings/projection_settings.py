"""Settings of the damped iteration."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, get_args

from .._numbers import check_count, check_number
from .._solver_names import SOLVERS
from ..errors import SettingsError
from .setting import setting

if TYPE_CHECKING:
    from ..linear import LinearSolver
else:
    LinearSolver = Any  # those who ask for the types of fields do not need torch for them

DampingScale = Literal["diagonal", "identity"]
WhenSettled = Literal["go on", "judge", "stop"]
StepPolicy = Literal["judged", "every"]


@dataclass(frozen=True)
class ProjectionSettings:
    """Settings of the damped iteration; all dimensionless.

    Attributes:
        max_iterations: Bound on the damped steps of a run, rejected ones included.
        step_policy: ``"judged"`` takes a step only if it lowers the merit, tries better ones, and lets the damping
            follow what steps gain. ``"every"`` is guided projection as the paper prints it: every step is taken,
            whatever becomes of the merit and of what guards would say, and the damping stays ``initial_damping``.
            Nothing holds such a run back; where a step leads to what is not finite it ends, with ``Status.DIVERGED``.
        initial_damping: First Levenberg-Marquardt parameter, relative to the damping scale.
        damping_scale: ``"diagonal"`` damps each unknown in proportion to its stiffness (the largest diagonal entry of
            ``J^T J`` met so far, More 1978), which makes the iteration independent of the units of the unknowns;
            ``"identity"`` damps all unknowns alike, the paper's ``w_reg |X - X_prev|^2``.
        gradient_tolerance: Stop when the scaled gradient, the largest cosine between the residual and a column of the
            Jacobian, is below this.
        step_tolerance: Stop when a step is below this, relative to the size of the unknowns, both weighted by
            stiffness; or when the merit is below what a change of the unknowns by this fraction makes of it.
        merit_tolerance: Stop when each of the last ``patience`` accepted steps lowered the merit by less than this
            fraction.
        patience: See ``merit_tolerance``.
        patience_when_damped: Patience is so many times as long where the damping is above its start, unless runs go on.
        when_settled: What happens when one of these tests is met. ``"go on"`` ends the run only at a minimum, where an
            undamped step promises no fall of the merit by more than ``merit_tolerance``; ``"judge"`` ends it and says
            whether it is one; ``"stop"`` ends it without asking, as stages do that others follow.
        least_extrapolation: A step that gained more than predicted is tried again at the length at which a
            parabola through what was seen is smallest, if that is more than this many times longer;
            infinity never tries.
        least_uncorrected_gain: A step that gained less than this, relative to what the model promised, is tried again
            with a second-order correction; minus infinity never tries.
        time_limit: After so many seconds the best state so far is returned; None for no limit.
        accuracy: Relative remainder with which an iterative linear solver starts; tightened as the merit
            settles.
        solver: Linear solver by name (see ``choose_solver``), ``"auto"`` for the fastest at this size; or an object
            with that protocol.

    Raises:
        SettingsError: a setting is out of its range; names it.
    """

    max_iterations: int = 100
    step_policy: StepPolicy = "judged"
    initial_damping: float = 1e-3
    damping_scale: DampingScale = "diagonal"
    gradient_tolerance: float = 1e-12
    step_tolerance: float = 1e-10
    merit_tolerance: float = 1e-9
    patience: int = 3
    patience_when_damped: int = 4
    when_settled: WhenSettled = "go on"
    least_extrapolation: float = 1.25
    least_uncorrected_gain: float = 0.9
    time_limit: float | None = setting(None, unit="seconds")
    accuracy: float = 1e-2
    solver: str | LinearSolver = setting("auto", choices=SOLVERS)

    @classmethod
    def given(cls, settings: object) -> ProjectionSettings:
        """Settings as given, or the defaults for None; SettingsError for anything else."""
        if settings is None:
            return cls()
        if not isinstance(settings, cls):
            from .._shown import shown

            raise SettingsError(f"settings must be ProjectionSettings(...) or None, got {shown(settings)}")
        return settings

    @property
    def takes_every_step(self) -> bool:
        """Whether steps are taken without asking what becomes of the merit."""
        return self.step_policy == "every"

    def __post_init__(self) -> None:
        if self.step_policy not in get_args(StepPolicy):
            raise SettingsError(f"step_policy must be 'judged' or 'every', got {self.step_policy!r}")
        if self.damping_scale not in get_args(DampingScale):
            raise SettingsError(f"damping_scale must be 'diagonal' or 'identity', got {self.damping_scale!r}")
        if self.when_settled not in get_args(WhenSettled):
            raise SettingsError(f"when_settled must be 'go on', 'judge' or 'stop', got {self.when_settled!r}")
        check_count("max_iterations", self.max_iterations, least=0)
        check_count("patience", self.patience, least=1)
        check_count("patience_when_damped", self.patience_when_damped, least=1)
        check_number("initial_damping", self.initial_damping, above=True, finite=True)
        for name in ("gradient_tolerance", "step_tolerance", "merit_tolerance"):
            check_number(name, getattr(self, name))
        check_number("least_extrapolation", self.least_extrapolation, least=1.0)
        check_number("least_uncorrected_gain", self.least_uncorrected_gain, least=-math.inf)
        check_number("accuracy", self.accuracy, above=True, most=1.0)
        check_number("time_limit", self.time_limit, or_none=True)
        if not isinstance(self.solver, str) and (
            isinstance(self.solver, type) or not hasattr(self.solver, "factorise")
        ):
            raise SettingsError(
                f"solver must be the name of a linear solver or an object such as ScipyDirect(), got {self.solver!r}"
            )
