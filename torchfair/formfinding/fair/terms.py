"""The element terms of the job that lowers E: what is lowered, and what it is lowered under."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import torch

from ... import constraints as c
from ...projection import ElementTerm

if TYPE_CHECKING:
    from .problem import FairProblem

_NEAR = 1.0  # weight of closeness while faces become planar
_LOOSER = 0.01  # of the weight of directions meanwhile, so that faces do not leave the surface for them


def fair_terms(problem: FairProblem, share: float, blur: float = 1.0) -> list[ElementTerm]:
    """Terms of a stage.

    Args:
        problem: What they are of.
        share: How far constraints that are violated are imposed; above 1 it raises planarity beyond its weight.
        blur: Factor of the smoothing of the absolute value, and of fairness up to its weight in the settings.
    """
    settings, panels = problem.settings, problem.panels
    return [
        *_energy(problem, blur),
        *problem.near.terms(weight=settings.closeness_weight, barrier_weight=settings.quality_weight),
        *_boundary(problem),
        *_loosely(problem),
        *_fairness(problem, blur),
        *problem.bounds.terms(settings),
        *problem.pulls.terms(weight=settings.handle_weight),
        *panels.planar_terms(share),
        *panels.nearly_planar_terms(share),
        *panels.flat_terms(share),
        *_directions(problem),
    ]


def planar_terms(problem: FairProblem, share: float) -> list[ElementTerm]:
    """Terms of a stage that makes faces planar near where they are, whatever becomes of E."""
    settings, panels = problem.settings, problem.panels
    return [
        *problem.near.terms(weight=_NEAR, barrier_weight=settings.quality_weight),
        *_boundary(problem),
        *_loosely(problem),
        *c.displacement_fairness_terms(problem.vertices, problem.topology, weight=settings.fairness_weight),
        *problem.bounds.terms(settings),
        *problem.pulls.terms(weight=settings.handle_weight),
        *panels.planar_terms(share),
        *panels.flat_terms(share),
        *_directions(problem, _LOOSER),
    ]


def _energy(problem: FairProblem, blur: float) -> list[ElementTerm]:
    settings, topology = problem.settings, problem.topology
    if settings.formulation == "reduced":
        smoothing = problem.scales.smoothed(settings.smoothing, blur)
        return c.normal_variation_terms(topology, smoothing=smoothing, weight=settings.energy_weight)
    planar = topology.face_sizes == 3
    planar[problem.panels.planar] = True
    return c.lifted_normal_variation_terms(
        problem.vertices,
        topology,
        planar,
        weight=settings.energy_weight,
        constraint_weight=settings.constraint_weight,
    )


def _directions(problem: FairProblem, share: float = 1.0) -> list[ElementTerm]:
    if problem.settings.directions == "free":
        return []
    return problem.guide.terms(weight=share * problem.settings.direction_weight)


def _fairness(problem: FairProblem, blur: float) -> list[ElementTerm]:
    settings, topology, corners = problem.settings, problem.topology, problem.corners
    weight = settings.fairness_weight * min(1.0, blur * problem.fairness_scale)
    if settings.second_differences:
        return c.polyline_fairness_terms(topology, weight=weight, corners=corners)
    terms = c.interior_fairness_terms(topology, weight=weight)
    if settings.boundary == "glide":
        terms += c.boundary_fairness_terms(topology, corners, weight=weight)
    return [*terms, *problem.curves.fairness_terms(topology, weight=weight)]


def _boundary(problem: FairProblem) -> list[ElementTerm]:
    settings, gliding = problem.settings, problem.boundary
    free = problem.free.terms(weight=settings.free_boundary_weight) if settings.boundary == "free" else []
    if gliding is None or gliding.feet is None:
        return free
    terms = c.gliding_terms(gliding.feet, weight=settings.boundary_weight)
    weights = gliding.glides.to(problem.vertices)
    return [*free, *(replace(term, element_weights=weights) for term in terms)]


def _loosely(problem: FairProblem) -> list[ElementTerm]:
    """Draws corners that may move to where they were."""
    chosen = torch.nonzero(problem.loose & ~problem.pulls.pulled).squeeze(1)
    places = problem.vertices[chosen]
    return c.handle_terms(chosen, places, weight=problem.settings.boundary_weight, name="corners")
