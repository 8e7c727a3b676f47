"""Where a run of guided projection stands."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from .damping import Damping
from .inequalities import Inequalities
from .result import Status
from .settings import ProjectionSettings
from .system import Evaluation, LinearSystem


@dataclass(frozen=True)
class Linearised:
    """What the next steps from a state need of its linearisation.

    Attributes:
        system: Jacobians and residuals; of the inequalities those that are broken.
        inequalities: All of them, None if there are none.
        scale: (N,) positive diagonal that the damping multiplies.
        gradient: Largest scaled component of the gradient of the merit.
    """

    system: LinearSystem
    inequalities: Inequalities | None
    scale: Tensor
    gradient: float


@dataclass(frozen=True)
class ProjectionState:
    """The best blocks found so far and all that is carried from step to step. Immutable.

    Attributes:
        evaluation: Blocks, residuals and merit.
        linearised: There.
        settings: Tolerances and damping.
        damping: Levenberg-Marquardt parameter of the next step.
        accuracy: Relative remainder asked of an iterative linear solver.
        iteration: Damped steps tried so far.
        falls: Relative decreases of the merit in accepted steps, the last ones.
        heeded: Inequalities that the last step took for equations.
        status: Why the last step ended the run, if it did.
    """

    evaluation: Evaluation
    linearised: Linearised
    settings: ProjectionSettings
    damping: Damping
    accuracy: float
    iteration: int = 0
    falls: tuple[float, ...] = ()
    heeded: Tensor | None = None
    status: Status | None = None

    @property
    def blocks(self) -> dict[str, Tensor]:
        """The variable blocks."""
        return dict(self.evaluation.state)

    @property
    def merit(self) -> float:
        """Their merit."""
        return self.evaluation.merit

    @property
    def gradient(self) -> float:
        """Largest scaled component of the gradient."""
        return self.linearised.gradient
