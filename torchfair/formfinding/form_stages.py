"""How the problem of lowering C is solved on one level: shape first, then the places of vertices."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import torch
from torch import Tensor

from ..projection import ProjectionResult, Status, guided_projection
from ..projection.iteration import Callback
from ..projection.layout import State
from .form_problem import FormProblem

Observe = Callable[[Tensor], dict[str, float]]


def solve_level(
    problem: FormProblem, start: Tensor, smoothings: list[float], callback: Callback | None, observe: Observe
) -> Iterator[tuple[Tensor, ProjectionResult]]:
    """Runs stage after stage and gives the vertices after each; ends early when a stage was stopped.

    With decreasing smoothing the vertices first move along their normals, which are anew those of the surface in
    each stage: a third of the unknowns, and little to go wrong. Then they move in space with the last smoothings,
    which spreads them. The lifted formulation does only the latter.
    """
    vertices = start
    reduced = problem.settings.formulation == "reduced"
    for fraction in smoothings[:-1] if reduced else []:
        vertices, run = _along_normals(problem, vertices, fraction, callback, observe)
        yield vertices, run
        if stopped(run):
            return
    for fraction in smoothings[-2:] if reduced else smoothings:
        run = guided_projection(
            problem.blocks(vertices),
            problem.terms(problem.smoothing(vertices, fraction)),
            fixed={"vertices": problem.fixed},
            settings=problem.settings.projection,
            callback=callback,
            observe=lambda state: observe(state["vertices"]),
            guard=problem.keeps_faces,
        )
        vertices = run.blocks["vertices"]
        yield vertices, run
        if stopped(run):
            return


def stopped(run: ProjectionResult) -> bool:
    """Whether someone stopped the run."""
    return run.status in (Status.INTERRUPTED, Status.CALLBACK)


def _along_normals(
    problem: FormProblem, base: Tensor, fraction: float, callback: Callback | None, observe: Observe
) -> tuple[Tensor, ProjectionResult]:
    directions = problem.directions(base)

    def place(state: State) -> Tensor:
        return base + state["heights"] * directions

    run = guided_projection(
        {"heights": torch.zeros(base.shape[0], 1, dtype=base.dtype)},
        problem.height_terms(base, directions, problem.smoothing(base, fraction)),
        fixed={"heights": problem.topology.is_boundary_vertex | problem.fixed},
        settings=problem.settings.projection,
        callback=callback,
        observe=lambda state: observe(place(state)),
        guard=lambda state, trial: problem.keeps_faces({"vertices": place(state)}, {"vertices": place(trial)}),
    )
    return place(run.blocks), run
