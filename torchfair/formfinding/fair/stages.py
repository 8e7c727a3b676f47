"""Stages of the job that lowers E: constraints in portions, then the absolute value sharper and sharper."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from ...projection import Callback, GuidedProjection, ProjectionResult
from ...projection.run import Observe
from ..stopping import stopped
from .problem import FairProblem

_SHARE_STEP = 1.0 / 6.0  # one power of ten of the default weight of planarity
_LARGEST_SHARE = 1.3


class Stage(NamedTuple):
    """What a run of guided projection imposes.

    Attributes:
        share: How far constraints that the start violates are imposed; above 1, planarity beyond its weight.
        blur: Factor of the smoothing of the absolute value.
    """

    share: float
    blur: float


class FairStages:
    """Runs one stage after the other, with one compiled problem.

    With a blunt absolute value edges turn freely, and all together find where the sharp one wants them; with a sharp
    one from the start many of them stick where they first become flat.

    Args:
        problem: Terms and guards.
        callback: See :func:`~torchfair.projection.guided_projection`.
        observe: Likewise.
    """

    def __init__(self, problem: FairProblem, callback: Callback | None, observe: Observe) -> None:
        self._problem, self._callback, self._observe = problem, callback, observe
        self._compiled: GuidedProjection | None = None
        self._blocks = problem.blocks(problem.vertices)

    def __iter__(self) -> Iterator[ProjectionResult]:
        """The runs, until the last stage or until someone stops one of them."""
        problem, stages = self._problem, self.planned()
        while stages:
            stage = stages.pop(0)
            run = self._run(stage, last=not stages)
            yield run
            if stopped(run):
                return
            self._blocks = problem.blocks(run.blocks["vertices"])
            if not stages and stage.share < _LARGEST_SHARE and not problem.is_planar(problem.placed(run.blocks)):
                stages.append(Stage(stage.share + _SHARE_STEP, 1.0))

    def planned(self) -> list[Stage]:
        """All stages but those that raise planarity once more where the last one was not enough."""
        blurs = self._problem.settings.continuation if self._problem.settings.formulation == "reduced" else ()
        *first, last = self._problem.shares()
        bluntest = max(blurs, default=1.0)
        return [*(Stage(share, bluntest) for share in first), *(Stage(last, blur) for blur in (*blurs, 1.0))]

    def _run(self, stage: Stage, *, last: bool) -> ProjectionResult:
        problem = self._problem
        terms = problem.terms(stage.share, stage.blur)
        settings = problem.settings.projection if last else problem.settings.stage()
        if self._compiled is None:
            self._compiled = GuidedProjection(self._blocks, terms, fixed=problem.fixed, solver=settings.solver)
        else:
            self._compiled = self._compiled.with_terms(terms)
        return self._compiled.solve(
            self._blocks, settings=settings, callback=self._callback, observe=self._observe, guard=problem.admits
        )
