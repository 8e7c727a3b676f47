"""The design of a principal-symmetric mesh on the next level of refinement."""

from __future__ import annotations

from typing import TYPE_CHECKING

import torch
from torch import Tensor

from ...boundary import boundary_corners
from ...constraints import BoundaryNormals
from ...subdivision import Refinement, interpolate_vertices, loop, near
from ...subdivision.interpolation import BOUNDARY_CORNER
from ...topology import Topology

if TYPE_CHECKING:
    from .recipe import SymmetricRecipe

_KEPT_RINGS = 6  # from the boundary on, over which Loop subdivision passes from interpolating to smoothing


def refined(recipe: SymmetricRecipe, vertices: Tensor) -> SymmetricRecipe:
    """The job on the mesh (V, 3) refined by Loop subdivision; labels, handles, held and fixed vertices are carried on.

    Vertices keep their places on the boundary and where they do not move, and fewer and fewer away from there: see
    :func:`~torchfair.subdivision.interpolate_vertices`.
    """
    topology, principal, pulls = recipe.topology, recipe.principal, recipe.pulls
    stays, along = recipe.stays(), _on_boundary(topology)
    step = loop(topology, boundary="interpolate", corners=boundary_corners(vertices, topology, BOUNDARY_CORNER))
    normals = BoundaryNormals.of(vertices, topology).at_boundary
    kept = topology.is_boundary_vertex | stays | pulls.held
    keep = None if recipe.problem.keeps_shape else near(topology, kept, _KEPT_RINGS)
    finer = type(recipe)(
        interpolate_vertices(step, vertices, normals, keep=keep),
        principal.refine(step),
        fixed=_carried(step, stays, along),
        reference=recipe.reference,
        on=_finer_stars(step, recipe),
        settings=recipe.settings,
    )
    finer.pull(recipe.handles)
    finer.first = recipe.first or recipe.before()
    finer.problem.steered = recipe.problem.steered
    finer.pulls.hold(torch.nonzero(_carried(step, pulls.held, along)).squeeze(1))
    return finer


def _finer_stars(step: Refinement, recipe: SymmetricRecipe) -> Tensor | None:
    """Stars of the finer mesh on the same polylines; None if conditions are imposed everywhere."""
    if recipe.stars.vertices.shape[0] == recipe.principal.stars().vertices.shape[0]:
        return None
    chosen = torch.zeros(recipe.topology.num_vertices, dtype=torch.bool)
    chosen[recipe.stars.vertices] = True
    return torch.nonzero(_carried(step, chosen, recipe.principal.mask)).squeeze(1)


def _on_boundary(topology: Topology) -> Tensor:
    """(E,) bool: boundary edges."""
    return torch.arange(topology.num_edges) >= topology.num_interior_edges


def _carried(step: Refinement, mask: Tensor, along: Tensor) -> Tensor:
    """The mask of vertices on the finer mesh, with new vertices on edges ``along`` between two of them."""
    return step.carry_vertex_labels(mask, along=along & mask[step.coarse.edges].all(1))
