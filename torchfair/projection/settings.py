"""Settings of the damped iteration."""

from __future__ import annotations

from dataclasses import dataclass

from ..linear import LinearSolver


@dataclass(frozen=True)
class ProjectionSettings:
    """Settings of the damped iteration; all dimensionless.

    Attributes:
        max_iterations: Bound on damped steps, rejected ones included.
        initial_damping: First Levenberg-Marquardt parameter, relative to the damping scale.
        damping_scale: ``"diagonal"`` damps each unknown in proportion to its stiffness (the largest diagonal entry of
            ``J^T J`` met so far, More 1978), which makes the iteration independent of the units of the unknowns;
            ``"identity"`` damps all unknowns alike, the paper's ``w_reg |X - X_prev|^2``.
        gradient_tolerance: Stop when the scaled gradient, the largest cosine between the residual and a column of the
            Jacobian, is below this.
        step_tolerance: Stop when a step is below this, relative to the size of the unknowns, both weighted by
            stiffness; or when the merit is below what a change of the unknowns by this fraction makes of it.
        merit_tolerance: Stop when the last ``patience`` accepted steps together lowered the merit by less than this
            fraction.
        patience: See ``merit_tolerance``. A run ends as converged only if, besides one of these tests, an undamped step
            promises no fall of the merit by more than ``merit_tolerance``; otherwise it goes on.
        least_extrapolation: A step that gained more than predicted is tried again at the length at which a
            parabola through what was seen is smallest, if that is more than this many times longer;
            infinity never tries.
        least_uncorrected_gain: A step that gained less than this, relative to what the model promised, is tried again
            with a second-order correction; minus infinity never tries.
        time_limit: Seconds, or None.
        accuracy: Relative remainder with which an iterative linear solver starts; tightened as the merit
            settles.
        solver: Name of a linear solver (see ``choose_solver``) or an object with that protocol.
    """

    max_iterations: int = 100
    initial_damping: float = 1e-3
    damping_scale: str = "diagonal"
    gradient_tolerance: float = 1e-12
    step_tolerance: float = 1e-10
    merit_tolerance: float = 1e-9
    patience: int = 3
    least_extrapolation: float = 1.25
    least_uncorrected_gain: float = 0.9
    time_limit: float | None = None
    accuracy: float = 1e-2
    solver: str | LinearSolver = "auto"

    def __post_init__(self) -> None:
        if self.damping_scale not in ("diagonal", "identity"):
            raise ValueError(f"damping_scale must be 'diagonal' or 'identity', got {self.damping_scale!r}")
        if self.max_iterations < 0 or not self.initial_damping > 0.0:
            raise ValueError("max_iterations must be at least 0 and initial_damping above 0")
