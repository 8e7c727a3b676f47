"""How the job that lowers E goes on: constraints in portions, then the absolute value sharper and sharper."""

from __future__ import annotations

from typing import NamedTuple

from ...projection.layout import State
from ..job.plan import Plan, Stages
from .problem import FairProblem

_SHARE_STEP = 1.0 / 6.0  # one power of ten of the default weight of planarity
_LARGEST_SHARE = 1.3


class Portion(NamedTuple):
    """What a stage imposes.

    Attributes:
        share: How far constraints that the start violates are imposed; above 1, planarity beyond its weight.
        blur: Factor of the smoothing of the absolute value.
    """

    share: float
    blur: float


class FairPlan(Plan):
    """One portion after the other.

    With a blunt absolute value edges turn freely, and all together find where the sharp one wants them; with a sharp
    one from the start many of them stick where they first become flat.

    Args:
        problem: Terms and guards.
        state: Where it starts.
    """

    def __init__(self, problem: FairProblem, state: State) -> None:
        super().__init__(state)
        self._problem = problem

    def stages(self) -> Stages:
        """All portions, and planarity once more where the last one was not enough, unless every step is taken."""
        problem, start = self._problem, self.state["vertices"]
        portions, most = self.planned(), 1.0 if problem.settings.projection.takes_every_step else _LARGEST_SHARE
        while portions:
            share, blur = portions.pop(0)
            problem.pulls.aim(share, start)
            settings = problem.settings.stage() if portions else problem.settings.projection
            yield problem.stage(self.state, share, blur, settings)
            self.state = problem.blocks(self.state["vertices"])
            if not portions and share < most and not problem.is_planar(problem.placed(self.state)):
                portions.append(Portion(share + _SHARE_STEP, 1.0))

    def planned(self) -> list[Portion]:
        """All portions that are known beforehand; one where every step is taken."""
        settings = self._problem.settings
        if settings.projection.takes_every_step:
            return [Portion(1.0, 1.0)]
        blurs = settings.continuation if settings.formulation == "reduced" else ()
        *first, last = self._problem.shares(self.state["vertices"])
        bluntest = max(blurs, default=1.0)
        return [*(Portion(share, bluntest) for share in first), *(Portion(last, blur) for blur in (*blurs, 1.0))]
