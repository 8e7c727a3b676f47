"""How the problem of lowering C is solved on one level: shape first, then the places of vertices."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator, Sequence
from dataclasses import replace

import torch
from torch import Tensor

from ...projection import Callback, ElementTerm, GuidedProjection, ProjectionResult, ProjectionSettings
from ...projection.layout import State
from ..face_guard import FaceGuard
from ..stopping import stopped
from .problem import FormProblem

Observe = Callable[[Tensor], dict[str, float]]
Stage = tuple[Tensor, ProjectionResult]

_TANGENT_ROUNDS = 3
_ROUGHLY, _THOROUGHLY = 10.0, 0.1  # tolerances of stages along normals, over those in space


class FormStages:
    """Runs stage after stage; every method gives the best vertices after each, and ends early when one was stopped.

    Args:
        problem: Of one level.
        callback, observe: See :func:`~torchfair.projection.guided_projection`.
    """

    def __init__(self, problem: FormProblem, callback: Callback | None, observe: Observe) -> None:
        self.problem, self.callback, self.observe = problem, callback, observe
        self._known: dict[str, GuidedProjection] = {}

    def from_afar(self, start: Tensor) -> Iterator[Stage]:
        """From any start.

        With decreasing smoothing the vertices first move along their normals, which are anew those of the surface
        in each stage: a third of the unknowns, and little to go wrong. Then they move in space with the last
        smoothings, which spreads them.

        Coarse smoothing leads a long way, but it blurs what distinguishes a slender tube from a waisted one. So where
        that has not converged or has collapsed, the last smoothing is tried from the start too, and the better
        surface taken.
        """
        settings = self.problem.settings
        smoothings = settings.smoothings()
        if settings.formulation == "lifted":
            yield from self._in_space(start, smoothings)
            return
        found = yield from _all(self._along_normals(start, smoothings[:-1], settings.coarse_fairness_weight))
        if stopped(found[-1][1]):
            return
        if self._is_doubtful(found, start):
            coarse = found[-1][0]
            fine, run = self._one_along_normals(start, smoothings[-1], settings.fairness_weight, correct=False)
            is_better = self._is_better(fine, coarse, start)
            yield (fine if is_better else coarse), run
            if stopped(run):
                return
            if is_better:
                yield from self._in_space(fine, smoothings[-1:])
                return
        yield from self._in_space(found[-1][0], smoothings[-2:])

    def from_nearby(self, start: Tensor) -> Iterator[Stage]:
        """From a refined solution: with the last smoothing only."""
        last = self.problem.settings.smoothings()[-1:]
        if self.problem.settings.formulation == "reduced":
            found = yield from _all(self._along_normals(start, last, self.problem.settings.fairness_weight))
            start = found[-1][0]
            if stopped(found[-1][1]):
                return
        # Next to prescribed tangent planes, vertices that are already spread stay so: ridges would draw them in.
        yield from self._in_space(start, [] if self.problem.keeps_rows else last)

    def _is_doubtful(self, found: Sequence[Stage], start: Tensor) -> bool:
        rests = all(run.status.at_rest for _, run in found)
        return not rests or self.problem.has_collapsed(found[-1][0], start)

    def _is_better(self, surface: Tensor, other: Tensor, start: Tensor) -> bool:
        problem = self.problem
        collapsed = [problem.has_collapsed(x, start) for x in (surface, other)]
        if collapsed[0] != collapsed[1]:
            return collapsed[1]
        smoothing = problem.smoothing(other, problem.settings.smoothing)
        return problem.merit(surface, smoothing) < problem.merit(other, smoothing)

    def _in_space(self, vertices: Tensor, smoothings: Sequence[float]) -> Iterator[Stage]:
        problem = self.problem
        for number, fraction in enumerate(smoothings):
            blocks = problem.blocks(vertices)
            own = problem.settings.projection
            settings = own if number == len(smoothings) - 1 else replace(own, when_settled="stop")
            terms = problem.terms(vertices, problem.smoothing(vertices, fraction))
            run = self._compiled(blocks, terms, {"vertices": problem.fixed_in_space}).solve(
                blocks,
                settings=settings,
                callback=self.callback,
                observe=lambda state: self.observe(state["vertices"]),
                guard=FaceGuard(problem.topology, lambda state: state["vertices"], problem.least_angle(vertices)),
            )
            vertices = run.blocks["vertices"]
            yield vertices, run
            if stopped(run):
                return
        if problem.has_tangent_planes:
            # Patches at the boundary are frozen in the plane, so they are made anew.
            last = [problem.settings.smoothing] * _TANGENT_ROUNDS
            yield from self._along_normals(vertices, last, problem.settings.fairness_weight, correct=True)

    def _along_normals(
        self, vertices: Tensor, smoothings: Sequence[float], fairness: float, *, correct: bool = False
    ) -> Iterator[Stage]:
        for fraction in smoothings:
            if correct:
                self._known.clear()  # patches may fit at other vertices than before
            vertices, run = self._one_along_normals(vertices, fraction, fairness, correct=correct)
            yield vertices, run
            if stopped(run):
                return

    def _compiled(self, blocks: State, terms: Sequence[ElementTerm], fixed: State) -> GuidedProjection:
        """The problem of one stage: the index maps of the stage before it on the same unknowns are kept."""
        kind = next(iter(fixed))
        before, solver = self._known.get(kind), self.problem.settings.projection.solver
        made = (
            GuidedProjection(blocks, terms, fixed=fixed, solver=solver) if before is None else before.with_terms(terms)
        )
        self._known[kind] = made
        return made

    def _along_normals_settings(self, fraction: float) -> ProjectionSettings:
        """Rough where a finer smoothing follows, thorough with the last one, where steps are cheap and safe."""
        settings = self.problem.settings
        own = settings.projection
        if fraction > settings.smoothing:
            return replace(own, merit_tolerance=_ROUGHLY * own.merit_tolerance, patience=1, when_settled="stop")
        return replace(own, merit_tolerance=_THOROUGHLY * own.merit_tolerance, when_settled="stop")

    def _one_along_normals(self, base: Tensor, fraction: float, fairness: float, *, correct: bool) -> Stage:
        problem = self.problem
        directions = problem.directions(base)

        def place(state: State) -> Tensor:
            return base + state["heights"] * directions

        blocks = {"heights": torch.zeros(base.shape[0], 1, dtype=base.dtype)}
        terms = problem.height_terms(base, directions, problem.smoothing(base, fraction), fairness, correct=correct)
        run = self._compiled(blocks, terms, {"heights": problem.topology.is_boundary_vertex | problem.fixed}).solve(
            blocks,
            settings=self._along_normals_settings(fraction),
            callback=self.callback,
            observe=lambda state: self.observe(place(state)),
            guard=FaceGuard(problem.topology, place),
        )
        return place(run.blocks), run


def _all(stages: Iterator[Stage]) -> Generator[Stage, None, list[Stage]]:
    """Hands stages on; the value of ``yield from`` is the list of them."""
    seen = []
    for stage in stages:
        seen.append(stage)
        yield stage
    return seen
