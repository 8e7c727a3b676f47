"""How the job that lowers E goes on: constraints in portions, then the absolute value sharper and sharper."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from torch import Tensor

from ...projection.layout import State
from ..job.plan import Plan, Stages
from .iterative import with_solver
from .problem import FairProblem

_SHARE_STEP = 1.0 / 6.0  # one power of ten of the default weight of planarity
_LARGEST_SHARE = 1.3
_HEAVIEST = 1.0 + 2.0 * _SHARE_STEP  # the share that this leads to
_WEAK = 1.0 / 3.0
_LARGE_PATIENCE = 2  # of stages before the last: what they gain late costs a large mesh more than sharper ones need
_LITTLE_MORE = 1.02  # times E of the start: what planar faces cost on a mesh that had hardly more than the least
_WORTHWHILE = 0.1  # of the largest deviation from planarity at the start: less is better than nothing
_ROOM = 1.25  # times the distance of planar faces: on their limits, vertices would have nowhere to go
_PLANAR_SHARES = (1.0 / 3.0, 2.0 / 3.0, 1.0, 7.0 / 6.0, 8.0 / 6.0)  # that make faces planar without E


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
        """All stages; once one ends with faces whose sides cross, it is done again with no step after which they do.

        Within a stage they may cross, as where vertices that glide along the boundary pass each other and come back.
        Where some have in a stage before, all is done again from the start. Faces that cannot become planar even so are
        not tried again.
        """
        problem, start = self._problem, self.state["vertices"]
        put_back, from_the_start = self._snapshot(), False
        problem.sides_may_cross = not problem.settings.projection.takes_every_step
        problem.sides_have_crossed = False
        try:
            for stage in self._solved():
                anew, had_crossed = self._snapshot(), problem.sides_have_crossed
                yield stage
                if not (problem.sides_may_cross and problem.crosses_sides(self.state["vertices"])):
                    continue
                problem.sides_may_cross, from_the_start = False, had_crossed
                if from_the_start:
                    break
                anew()
                yield stage
        finally:
            problem.sides_may_cross = False
        if from_the_start:
            are_warped = problem.planarity.most_warped < math.inf
            put_back()
            warp = problem.planarity.largest_warp(start)
            yield from self._not_warped_more(warp) if are_warped else self._solved()

    def _snapshot(self) -> Callable[[], None]:
        """A function that puts back the state and what was decided since then."""
        state, notes, put_back_problem = self.state, len(self._problem.notes), self._problem.snapshot()

        def put_back() -> None:
            self.state = state
            put_back_problem()
            del self._problem.notes[notes:]

        return put_back

    def _solved(self) -> Stages:
        """All portions; where that leaves faces warped or raises E much, faces are made planar first, E lowered then.

        Where neither helps, they are made planar from where the planes of faces meet. The best is kept, of those within
        the distance limit if there are any; the start is where it had planar faces and least E. Where none has planar
        faces, the start is, with E lowered as far as no face is warped more than the worst one was. Where that is
        likely, it is tried at once whether faces become planar at all, which takes less time than to find out with E.
        """
        problem, start = self._problem, self.state["vertices"]
        every = problem.settings.projection.takes_every_step
        problem.planarity.most_warped = math.inf
        if not every and problem.planarity.is_far(start):
            yield from self._planar_alone(start, problem.settings.planar_distance)
            tried = self.state["vertices"]
            if not problem.planarity.is_reached(tried):
                yield from self._best_of(start, [tried])
                return
            problem.near.put_back()
            self.state = problem.blocks(start)
        yield from self._lowered(self.planned(), start, _LARGEST_SHARE if not every else 1.0)
        if every or not problem.panels.makes_planar:
            return
        energy, first = problem.energy(start), self.state["vertices"]
        near_enough = problem.planarity.is_reached_within_limits(first)
        if near_enough and problem.energy(first) <= _LITTLE_MORE * energy:
            if problem.energy(first) > energy and self._may_stay(start):
                self.state = problem.blocks(start)
            return
        yield from self._made_planar(start, 0.0 if near_enough else problem.settings.planar_distance)
        yield from self._best_of(start, [first, self.state["vertices"]])

    def _best_of(self, start: Tensor, found: list[Tensor]) -> Stages:
        """The best of the meshes that were found and, if none has planar faces, what else can be made of the start."""
        problem, planarity = self._problem, self._problem.planarity
        warp = planarity.largest_warp(start)
        planar = [vertices for vertices in found if planarity.is_reached(vertices)]
        meeting = None if planar else planarity.where_planes_meet(start)
        if meeting is not None:
            yield from self._made_planar(meeting, problem.settings.planar_distance)
            found.append(self.state["vertices"])
            planar = [found[-1]] if planarity.is_reached(found[-1]) else []
        if planar:
            best = min(planar, key=lambda mesh: (not planarity.is_reached_within_limits(mesh), problem.energy(mesh)))
        else:
            best = min(found, key=planarity.largest_warp)
            if planarity.largest_warp(best) > _WORTHWHILE * warp:
                self.state = problem.blocks(start)
                yield from self._not_warped_more(warp)
                return
        planarity.takes(best)
        self.state = problem.blocks(best)

    def _may_stay(self, start: Tensor) -> bool:
        """Whether the start has planar faces, flat edges and all else that is asked for already."""
        problem = self._problem
        asked = problem.panels.are_planar(problem.placed(problem.blocks(start))) and not problem.pulls.pulled.any()
        return asked and problem.planarity.is_reached_within_limits(start)

    def _lowered(self, portions: list[Portion], start: Tensor, most: float) -> Stages:
        """The portions, and planarity once more where the last one was not enough; none that cannot make it enough."""
        problem = self._problem
        while portions:
            share, blur = portions.pop(0)
            problem.pulls.aim(share, start)
            settings = problem.settings.stage() if portions else problem.settings.projection
            if portions and problem.scales.is_large:
                settings = replace(settings, patience=_LARGE_PATIENCE)
            yield problem.stage(self.state, share, blur, with_solver(settings, problem))
            self.state = problem.blocks(self.state["vertices"])
            placed = problem.placed(self.state)
            if share >= 1.0 and most > 1.0 and not problem.panels.may_become_planar(placed, _HEAVIEST - share):
                return
            if not portions and share < most and not problem.panels.are_planar(placed):
                portions.append(Portion(share + _SHARE_STEP, 1.0))

    def _made_planar(self, start: Tensor, most: float) -> Stages:
        """Makes faces planar near the start, as far away as that takes and at most so far, and lowers E from there."""
        yield from self._planar_alone(start, most)
        problem, planar = self._problem, self.state["vertices"]
        if not problem.planarity.is_reached(planar):
            return
        problem.near.lift(planar, room=_ROOM)
        yield from self._lowered([Portion(1.0, 1.0)], planar, _LARGEST_SHARE)
        lowered = self.state["vertices"]
        if not problem.planarity.is_reached(lowered) or problem.energy(lowered) > problem.energy(planar):
            self.state = problem.blocks(planar)

    def _planar_alone(self, start: Tensor, most: float) -> Stages:
        """Makes faces planar near the start, as far away as that takes and at most so far."""
        problem = self._problem
        problem.near.lift(start, most)
        problem.has_other_goals = True
        problem.pulls.aim(1.0, start)
        self.state = problem.blocks(start)
        for share in _PLANAR_SHARES:
            yield problem.planar_stage(self.state, share)
            self.state = problem.blocks(self.state["vertices"])
            if problem.panels.are_planar(problem.placed(self.state)):
                break

    def _not_warped_more(self, warp: float) -> Stages:
        """Lowers E where faces cannot become planar: none becomes worse than the worst one was."""
        problem = self._problem
        problem.near.put_back()
        problem.reconsider()
        problem.planarity.most_warped = warp
        yield problem.stage(self.state, _WEAK, 1.0, problem.settings.projection)
        self.state = problem.blocks(self.state["vertices"])

    def planned(self) -> list[Portion]:
        """All portions that are known beforehand; one where every step is taken."""
        settings = self._problem.settings
        if settings.projection.takes_every_step:
            return [Portion(1.0, 1.0)]
        blurs = settings.continuation if settings.formulation == "reduced" else ()
        *first, last = self._problem.shares(self.state["vertices"])
        bluntest = max(blurs, default=1.0)
        return [*(Portion(share, bluntest) for share in first), *(Portion(last, blur) for blur in (*blurs, 1.0))]
