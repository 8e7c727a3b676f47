"""Where a run of guided projection stands."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

from torch import Tensor

from ..linear import LinearSolver
from ..settings.projection_settings import ProjectionSettings
from .course import Course
from .evaluation import Evaluation
from .inequalities import Inequalities
from .linear_system import LinearSystem
from .proposal import Proposal
from .result import Status


@dataclass(frozen=True)
class Linearised:
    """What the next steps from a state need of its linearisation.

    Attributes:
        system: Jacobians and residuals; of the inequalities those that are broken.
        inequalities: All of them, None if there are none.
        stiffness: (N,) largest diagonal of ``J^T J`` that was met so far.
    """

    system: LinearSystem
    inequalities: Inequalities | None
    stiffness: Tensor

    def without(self, members: Collection[int]) -> Linearised:
        """The same without some members of a batch, see :meth:`LinearSystem.without`."""
        if not members:
            return self
        inequalities = None if self.inequalities is None else self.inequalities.without(members)
        return replace(self, system=self.system.without(members), inequalities=inequalities)

    def propose(self, solver: LinearSolver, damping: Tensor, likely: Tensor | None, accuracy: float) -> Proposal:
        """The damped step; see :meth:`Proposal.of` and :meth:`Inequalities.propose`."""
        if self.inequalities is None:
            return Proposal.of(self.system, solver, damping, accuracy)
        return self.inequalities.propose(solver, damping, likely, accuracy)


@dataclass(frozen=True)
class ProjectionState:
    """The best blocks found so far and all that is carried from step to step. Immutable.

    Attributes:
        evaluation: Blocks, residuals and merits.
        linearised: There.
        settings: Tolerances and damping.
        courses: Merit, damping and status of each member of a batch; one for a single problem.
        heeded: (k,) inequalities that the last step took for equations.
    """

    evaluation: Evaluation
    linearised: Linearised
    settings: ProjectionSettings
    courses: tuple[Course, ...]
    heeded: Tensor | None = None

    @property
    def singular(self) -> frozenset[int]:
        """Members that have ended because their part of the system is singular."""
        return frozenset(n for n, course in enumerate(self.courses) if course.status is Status.SINGULAR)

    @property
    def blocks(self) -> dict[str, Tensor]:
        """The variable blocks, of all members one after the other."""
        return dict(self.evaluation.state)

    @property
    def merit(self) -> float:
        """Sum over members."""
        return sum(course.merit for course in self.courses)

    @property
    def gradient(self) -> float:
        """Largest scaled component of the gradient, see ``ProjectionResult``."""
        return max(course.gradient for course in self.courses)

    @property
    def damping(self) -> float:
        """Levenberg-Marquardt parameter of the next step, of the first member."""
        return self.courses[0].damping.value

    @property
    def accuracy(self) -> float:
        """Relative remainder asked of an iterative linear solver."""
        return min(course.accuracy for course in self.courses)
