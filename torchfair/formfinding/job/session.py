"""A job that can be steered while it goes on: handles move, weights change, the mesh follows."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Generic, TypeVar, cast

import torch
from torch import Tensor

from ..._interrupts import deferred_interrupts
from ..._memory import hand_back_free_memory
from ..._threads import threads_for
from ...errors import SettingsError
from ...progress import phase
from ...projection import Callback, ProjectionResult, Status
from ...projection.layout import State
from ...projection.stopwatch import Stopwatch
from ...projection.unbegun import is_large, not_set_up
from ..handles import vertex_numbers
from ..stopping import interrupted, stopped
from .compiled_problems import CompiledProblems
from .live import Following, Progress, followed, live_step
from .plan import Plan, Stage
from .recipe import Recipe
from .snapshot import Snapshot

R = TypeVar("R", bound=Recipe[Any])

_LONGEST_PULL = 0.5  # mean edge lengths that a handle moves in one live step


class Session(Generic[R]):
    """One mesh of a job, compiled for the next move.

    :meth:`solve` does the whole job from where the mesh is. Between :meth:`move` and :meth:`settle`, each
    :meth:`step` is one accepted damped step, with everything carried on from the step before: the mesh follows a handle
    that is dragged.

    Args:
        recipe: The job.
        callback: Called with every iteration record; returning True stops a solve.
        live: Whether any vertex may become a handle later without new index maps.

    Attributes:
        state: The blocks found so far, normalised.
        runs: Every run of guided projection so far.
        watch: Called with the vertices (V, 3) of every state that :meth:`settle` and :meth:`solve` pass through, in the
            unit of the input; None for nobody.

    Example::

        session = Session(FairRecipe(vertices, topology))
        session.move({17: (0.1, 0.0, 0.4)})
        while session.step().accepted:
            show(session.vertices)
        session.settle()
    """

    def __init__(self, recipe: R, *, callback: Callback | None = None, live: bool = True) -> None:
        self.recipe, self.callback = recipe, callback
        recipe.pulls.everywhere = live
        self.state: State = recipe.state()
        self.runs: list[ProjectionResult] = []
        self.watch: Callable[[Tensor], None] | None = None
        self._problems = CompiledProblems()
        self._following: Following | None = None
        self._moved = False

    # ---- what it is ------------------------------------------------------------------------------------

    @property
    def vertices(self) -> Tensor:
        """(V, 3) float64, in the unit of the input."""
        return self.recipe.vertices(self.state)

    def measures(self) -> dict[str, float]:
        """Energies and what the job promises, of the mesh as it is."""
        return self.recipe.measures(self.vertices)

    # ---- steering --------------------------------------------------------------------------------------

    def move(self, places: Mapping[int, Sequence[float]]) -> None:
        """Pulls vertices to places, in the unit of the input; vertices that were no handles become some.

        Raises:
            ShapeError: a target is not a point with finite coordinates.
            MeshError: a handle is no vertex, or one that does not move.
        """
        self.recipe.pull(places)
        self._moved = True

    def hold(self, vertices: Iterable[int]) -> None:
        """Keeps vertices where they are, from now on."""
        self.recipe.pulls.hold(vertex_numbers(vertices, self.recipe.topology))
        self.recipe.reconsider()
        self._moved = True

    def free(self, vertices: Iterable[int]) -> None:
        """Lets vertices go that were pulled or held."""
        self.recipe.pulls.free(vertex_numbers(vertices, self.recipe.topology))
        self.recipe.reconsider()
        self._moved = True

    def place(self, vertices: Tensor) -> None:
        """Puts the mesh where it is told to be, (V, 3) in the unit of the input, such as where it was before.

        Handles, held vertices and weights stay; so does what is compiled.
        """
        self.recipe.topology.check_vertices(vertices)
        self.state = self.recipe.state_at(vertices.to("cpu", torch.float64))
        self.recipe.forget()
        self.recipe.reconsider()
        self.recipe.put_at(self.state)
        self._following, self._moved = None, True

    def weigh(self, **weights: float) -> None:
        """Changes weights of the settings by their names, such as ``fairness=0.1``; index maps and analysis are kept.

        Raises:
            SettingsError: there is no such weight, or it is negative or not finite.
        """
        settings = self.recipe.settings
        known = [name.removesuffix("_weight") for name in vars(settings) if name.endswith("_weight")]
        wrong = sorted(weights.keys() - set(known))
        if wrong:
            raise SettingsError(f"weights of this job are {', '.join(sorted(known))}, got {', '.join(wrong)}")
        changed = {f"{name}_weight": value for name, value in weights.items()}
        self.recipe.take_settings(replace(settings, **changed))
        self._moved = True

    # ---- live ------------------------------------------------------------------------------------------

    def step(self) -> Progress:
        """One accepted damped step, or more where it was too short for a handle; or the reason why there is none.

        Interrupted, or where the callback raises an error, the mesh is as it was.
        """
        recipe = self.recipe
        recipe.pulls.aim_near(recipe.placed(self.state), _LONGEST_PULL)
        with torch.no_grad(), threads_for(recipe.start.numel(), recipe.start.device):
            following = self._follow()
            progress, state, result = live_step(following, recipe, self.state)
            if progress.accepted and self.callback is not None and progress.record is not None:
                self.callback(progress.record)
        following.state = state
        if progress.accepted:
            self.state, self._moved = result, bool((recipe.pulls.aims != recipe.pulls.targets).any())
        return progress

    def _follow(self) -> Following:
        """The compiled problem of live steps and where they stand, with what has changed taken in."""
        known = self._following
        if known is not None and not self._moved:
            return known
        stage = self.recipe.follower(self.recipe.predicted(self.state))
        self._following = followed(stage, self._problems.of, known)
        return self._following

    def settle(self) -> bool:
        """Brings the mesh to rest, with the damping of the last live step; whether someone stopped it.

        Handles that live steps have not caught up with go all the way.
        """
        damping = None if self._following is None else self._following.state.damping

        def plan(state: State) -> Plan:
            self.recipe.pulls.aim(1.0, self.recipe.placed(state))
            return self.recipe.settling(state, damping)

        return self._edited(plan)

    # ---- whole -----------------------------------------------------------------------------------------

    def solve(self) -> bool:
        """Does the whole job from where the mesh is; whether someone stopped it.

        The best state found is kept, also after Ctrl-C. Where a callback raises an error, everything is as it was.
        """
        return self._edited(self.recipe.plan)

    def _edited(self, begin: Callable[[State], Plan]) -> bool:
        with deferred_interrupts() as interrupts:
            snapshot = interrupts.insist(self.snapshot)
            watch, before = Stopwatch(), len(self.runs)
            plans: list[Plan] = []

            def runs() -> Iterator[ProjectionResult]:
                plans[:] = [begin(self.state)]
                return self._carried_out(plans[0], watch)

            try:
                with torch.no_grad(), threads_for(self.recipe.start.numel(), self.recipe.start.device):
                    made, cut = interrupts.collect(runs)
                    if cut:
                        made[-1] = interrupted(made[-1])
                    best = interrupts.insist(plans[0].best)
            except BaseException as error:
                self.restore(snapshot)
                if not isinstance(error, Exception):
                    self.forget_compiled()
                raise
            self.state, self.runs = best, [*self.runs[:before], *made]
            self._following, self._moved = None, True
            if made and made[-1].status is Status.INTERRUPTED:
                self.forget_compiled()
        return bool(made) and self._ended(made[-1], watch)

    def _carried_out(self, plan: Plan, watch: Stopwatch) -> Iterator[ProjectionResult]:
        """The runs of a plan, until its end or until someone stops one."""
        stages = plan.stages()
        stage = next(stages, None)
        while stage is not None:
            run = self._run(stage, watch)
            plan.state = stage.result(run.blocks)
            yield run
            if self._ended(run, watch):
                return
            try:
                stage = stages.send(run)
            except StopIteration:
                return

    def _run(self, stage: Stage, watch: Stopwatch) -> ProjectionResult:
        with deferred_interrupts() as interrupts:
            if is_large(stage.blocks) and interrupts.taken():
                return not_set_up(stage.blocks, Stopwatch())  # nothing would be made of it
        hand_back_free_memory(self.recipe.start.numel())
        limit, settings = self.recipe.settings.projection.time_limit, stage.settings
        if limit is not None:
            settings = replace(settings, time_limit=max(0.0, limit - watch.elapsed))
        with phase("setting up the solver"):
            problem = self._problems.of(stage)
        return problem.solve(
            stage.blocks,
            settings=replace(settings, solver="auto"),
            callback=self.callback,
            observe=lambda state: self._observe(stage.result(state)),
            guard=stage.guard,
        )

    def _observe(self, state: State) -> dict[str, float]:
        if self.watch is not None:
            self.watch(self.recipe.vertices(state))
        return self.recipe.observe(state)

    def _ended(self, run: ProjectionResult, watch: Stopwatch) -> bool:
        limit = self.recipe.settings.projection.time_limit
        late = run.status is Status.TIME_LIMIT or (limit is not None and watch.elapsed > limit)
        return stopped(run) or late

    # ---- snapshots -------------------------------------------------------------------------------------

    def forget_compiled(self) -> None:
        """Compiles anew from now on: what was interrupted while it searched or factorised may not be whole."""
        self._problems.clear()
        self._following = None
        self.recipe.forget()

    def snapshot(self) -> Snapshot:
        """Everything that steering and solving may change; shares nothing with the session that can change."""
        recipe = self.recipe
        return Snapshot(
            {name: block.clone() for name, block in self.state.items()},
            recipe.pulls.copy(),
            recipe.settings,
            recipe.snapshot(),
            list(self.runs),
            self._problems.snapshot(),
            copy.copy(self._following),
            self._moved,
        )

    def restore(self, snapshot: Snapshot) -> None:
        """Puts everything back, bit for bit: what follows is what would have followed then."""
        self.state = {name: block.clone() for name, block in snapshot.state.items()}
        self.recipe.take_settings(snapshot.settings)
        self.recipe.pulls.restore(snapshot.pulls)
        self.recipe.reconsider()
        self.recipe.pulls.version = snapshot.pulls.version
        snapshot.of_recipe()
        self.runs = list(snapshot.runs)
        snapshot.of_problems()
        self._following, self._moved = copy.copy(snapshot.following), snapshot.moved

    def refined(self) -> Session[R]:
        """A session on the refinement of the mesh as it is, with handles and held vertices carried along.

        Raises:
            MeshError: the job works on one mesh.
        """
        finer = cast(R, self.recipe.refined(self.state))
        return Session(finer, callback=self.callback, live=self.recipe.pulls.everywhere)
