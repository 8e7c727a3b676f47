"""The job that lowers E on the next level of refinement."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from ...geometry import corner_angles, face_area_vectors
from ...geometry._ops import dot
from ...settings.fair_settings import FairSettings
from ...subdivision import Origin, Refinement, hybrid, midpoint
from .problem import FairProblem

if TYPE_CHECKING:
    from .recipe import FairRecipe

_KEPT_ANGLE = 0.5  # of the smallest angle of the coarse mesh


def refined(recipe: FairRecipe, vertices: Tensor) -> FairRecipe:
    """The job on the mesh (V, 3) refined by Loop's scheme for triangles and Catmull and Clark's for others.

    Reference surface and the curves along boundary and creases are those of the input. Handles and held vertices keep
    their places, and parts of planar faces and of flat panels are to be planar and flat again.
    """
    topology, pulls = recipe.topology, recipe.pulls
    step = hybrid(topology, boundary="interpolate", corners=recipe.rim.rim.corners)
    rim, start = recipe.rim.refined(step), step.apply(vertices)
    away = pulls.pulled | pulls.held
    chosen = torch.nonzero(away | recipe.rim.on_creases).squeeze(1)
    start[chosen] = vertices[chosen]
    curves = rim.curves(boundary=recipe.settings.boundary != "free")
    start = curves.nearest(start, _between_gliding(step, away))
    start = _unfolded(start, vertices, step)
    finer = type(recipe)(
        start,
        step.topology,
        reference=recipe.reference,
        settings=_carried(step, recipe.problem, recipe.settings),
        rim=rim,
        input_edge=recipe.input_edge,
        near_input=recipe.problem.near_input,
        directions_at=recipe.directions_at,
    )
    finer.pull(recipe.handles)
    finer.pulls.hold(torch.nonzero(pulls.held).squeeze(1))
    return finer


def _unfolded(start: Tensor, vertices: Tensor, step: Refinement) -> Tensor:
    """The start (V', 3), or half or all the way back to the plain cut of the faces where it folds or pinches them."""
    plain, fine = midpoint(step.coarse).apply(vertices), step.topology
    sides = face_area_vectors(plain, fine)
    least = _KEPT_ANGLE * float(corner_angles(vertices, step.coarse).min())
    for share in (1.0, 0.5):
        trial = plain.lerp(start, share)
        upright = bool((dot(face_area_vectors(trial, fine), sides) > 0.0).all())
        if upright and float(corner_angles(trial, fine).min()) > least:
            return trial
    return plain


def _between_gliding(step: Refinement, away: Tensor) -> Tensor:
    """(V',) bool: new vertices on edges neither of whose ends is among those ``away`` (V,)."""
    kinds, numbers = step.vertex_origins.unbind(1)
    new = kinds == Origin.EDGE
    chosen = new.clone()
    chosen[new] = ~away[step.coarse.edges[numbers[new]]].any(1)
    return chosen


def _carried(step: Refinement, problem: FairProblem, settings: FairSettings) -> FairSettings:
    """The settings with the numbers of finer faces and edges that stay planar and flat."""
    coarse, fine = step.coarse, step.topology
    planar = torch.zeros(coarse.num_faces, dtype=torch.bool)
    planar[problem.panels.planar] = True
    flat = torch.zeros(coarse.num_edges, dtype=torch.bool)
    flat[problem.panels.flat] = True
    faces = torch.nonzero(step.carry_face_labels(planar)).squeeze(1)
    edges = torch.nonzero(step.carry_edge_labels(flat, parallel=True)[: fine.num_interior_edges]).squeeze(1)
    return replace(settings, planar=tuple(faces.tolist()), flat=tuple(edges.tolist()))
