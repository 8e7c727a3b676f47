"""The mesh that a job ends with, brought to the minimum of what its last stage lowers."""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import torch
from torch import Tensor

from ...errors import ShapeError
from ...projection import AdjointSolution, GuidedProjection, ProjectionResult, StationaryPoint, Status
from ...projection.implicit import BackwardRule, Minimum
from ...projection.layout import State
from ...projection.newton import Descent, descended
from ...projection.stationary_point import polished
from ..job import Recipe, Session, Stage
from ..job.compiled_problems import CompiledProblems
from .parameters import SEEN_FROM, VERTICES, JobParameters
from .placing import placed

_SURE = 2  # Newton steps without a region at the end
_ROUNDS, _SEEN = 12, 10.0  # until a mesh sees itself; times the tolerance
_LINKS = 3  # of what it sees itself from, backwards; each counts for a hundredth of the last one, or less


class Finish(NamedTuple):
    """How a mesh is brought to its minimum.

    Attributes:
        tolerance: Length of the next Newton step, relative to the extent.
        steps: Most of them.
        products: Most products with the second derivatives in the last one.
    """

    tolerance: float
    steps: int
    products: int


@dataclass
class JobLayerInfo:
    """What is known of a finished mesh beside its vertices.

    Attributes:
        runs: Of the job, in order; empty where it was started near its end.
        steps: With exact second derivatives, from the end of the job to the minimum.
        products: With these, on that way.
        point: The check of the minimum; its ``fault`` is empty where derivatives mean something.
        adjoint: Of the backward pass, None before it.
    """

    runs: list[ProjectionResult]
    steps: int
    products: int
    point: StationaryPoint
    adjoint: AdjointSolution | None = None


class FinishedMesh:
    """A mesh with which a job ends.

    Args:
        recipe: The job; it is changed, and belongs to this mesh from now on.
        parameters: See :class:`JobParameters`.
        start: (V, 3) near the end; None for the whole job.
        finish: How it goes on from there.
        problems: Index maps and analysis that are known.

    Attributes:
        info: What is told of it.
    """

    def __init__(
        self,
        recipe: Recipe[Any],
        parameters: Mapping[str, Tensor],
        start: Tensor | None,
        finish: Finish,
        problems: CompiledProblems,
    ) -> None:
        self._recipe, self._given = recipe, JobParameters(recipe, parameters)
        session = Session(recipe, live=False)
        session.state = recipe.state_at(self._given.start)
        if start is None:
            session.solve()
            if session.runs and session.runs[-1].status is Status.INTERRUPTED:
                raise KeyboardInterrupt
        else:
            session.state = self._near(start)
        with torch.no_grad():
            self._bring_down(session, finish, problems)

    @property
    def vertices(self) -> Tensor:
        """(V, 3) float64, in the unit of the input."""
        with torch.no_grad():
            return self._mesh(self.info.point.blocks, self._given.start)

    def as_function_of(self, parameters: Mapping[str, Tensor], rule: BackwardRule) -> Tensor:
        """The same as a differentiable function of the parameters."""
        found, stage, given = self.info.point.blocks, self._stage, self._given
        start, blocks = given.start, dict(found)
        others = {name: value for name, value in parameters.items() if name != VERTICES}
        if VERTICES in parameters:
            start = parameters[VERTICES].to("cpu", torch.float64)
            blocks["vertices"] = self._recipe.unit.apply(start)
        minimum = Minimum(rule, lambda values: given.terms(stage, values), self._problem, found, self.info)
        if not self._recipe.sees_itself:
            return self._mesh(minimum.as_function_of(others, blocks), start)
        for _ in range(_LINKS):
            blocks = {**found, "vertices": blocks["vertices"]}
            blocks = minimum.as_function_of({**others, SEEN_FROM: blocks["vertices"]}, blocks)
        return self._mesh(blocks, start)

    def _near(self, start: Tensor) -> State:
        """Blocks at a mesh (V, 3), with what stays where it stays."""
        recipe, there = self._recipe, start.detach().to("cpu", torch.float64)
        if there.shape != recipe.given.shape:
            raise ShapeError("start", f"{tuple(recipe.given.shape)}", tuple(there.shape))
        return recipe.state_at(torch.where(recipe.fixed["vertices"][:, None], self._given.start, there))

    def _bring_down(self, session: Session[Any], finish: Finish, problems: CompiledProblems) -> None:
        """To the minimum; where terms are seen from the mesh itself, until they are seen from the minimum."""
        recipe, state, steps, products = self._recipe, session.state, 0, 0
        for number in range(_ROUNDS):
            self._stage = stage = recipe.final(state)
            self._problem = problem = problems.of(replace(stage, version=object()))
            descent = descended(problem, stage.blocks, guard=stage.guard, tolerance=finish.tolerance, most=finish.steps)
            steps, products = steps + descent.steps, products + descent.products
            point = polished(
                problem, problem.terms, descent.blocks, tolerance=finish.tolerance, most=_SURE, products=finish.products
            )
            fault = _fault(problem, stage, descent, point)
            if fault or not recipe.sees_itself or _moved(stage.blocks, point.blocks) <= _SEEN * finish.tolerance:
                break
            state = point.blocks
            if number == _ROUNDS - 1:
                fault = "smoothing and fairness are seen from the mesh, which does not settle: raise fairness"
        self.info = JobLayerInfo(session.runs, steps, products, replace(point, fault=fault))

    def _mesh(self, blocks: State, start: Tensor) -> Tensor:
        """(V, 3) in the unit of the input; what stays is exactly where the ``start`` (V, 3) has it."""
        recipe, vertices = self._recipe, blocks["vertices"]
        if recipe.glides:
            mesh = placed(lambda points: recipe.vertices({"vertices": points}), vertices)
        else:
            mesh = recipe.unit.invert(vertices)
        return torch.where(self._stage.fixed["vertices"][:, None], start, mesh)


def copied(recipe: Recipe[Any]) -> Recipe[Any]:
    """The same job, which shares nothing with it that solving could change."""
    shared = [recipe.topology, getattr(recipe, "reference", None)]
    return copy.deepcopy(recipe, {id(part): part for part in shared})


def _moved(before: State, after: State) -> float:
    """Largest change of a coordinate, relative to the extent."""
    vertices = before["vertices"]
    return float((after["vertices"] - vertices).abs().max() / (vertices.amax(0) - vertices.amin(0)).max())


def _fault(problem: GuidedProjection, stage: Stage, descent: Descent, point: StationaryPoint) -> str:
    """Why derivatives mean nothing there; empty if they do."""
    if not point.fault:
        kept = stage.guard is None or not point.steps or stage.guard(descent.blocks, point.blocks)
        return "" if kept else "the minimum is where the job does not let a face go: one turns over, or breaks a bound"
    if descent.refused:
        return (
            "the way down leads to where the job does not let a face go: one turns over, or breaks a bound (loosen it, "
            "or raise fairness)"
        )
    if not descent.arrived:
        return (
            f"no minimum was found in {descent.steps} steps with exact second derivatives: kinks are in the way (raise "
            "the smoothing; a reference mesh has some at its edges: give a function, a finer mesh, or weigh closeness "
            f"less), or allow more steps; {point.fault}"
        )
    return point.fault
