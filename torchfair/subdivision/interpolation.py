"""Positions of a finer mesh that keep those of the coarse vertices, up to the boundary without kinks."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from .._half_edges import first_few
from ..boundary import boundary_corners
from ..errors import MeshError
from ..geometry import vertex_normals
from ..geometry._ops import dot
from ..topology import Topology
from .refinement import Origin, Refinement

_ROUNDS = 40
BOUNDARY_CORNER = math.radians(40.0)


def interpolate_vertices(
    step: Refinement, vertices: Tensor, normals: Tensor | None = None, *, keep: Tensor | None = None
) -> Tensor:
    """Positions of the fine mesh of one step of Loop subdivision that pass through the coarse vertices.

    Approximating schemes move inner vertices by a share of the curvature there, and boundary vertices by another one or
    not at all; then the rows along the boundary bend otherwise than the surface does. Here the scheme is applied to a
    control mesh that is chosen such that inner vertices keep their places; its boundary is shifted as the vertices
    beside are. New boundary vertices follow the rule of ``step`` where the boundary is smooth. Between two corners, as
    everywhere on a zigzag boundary, they lie in the middle of a cubic arc that is orthogonal to the normals at both
    ends.

    Args:
        step: one step of :func:`loop` that keeps boundary vertices, with ``boundary="interpolate"`` and the corners
            of the boundary: where it turns by more than 40 degrees.
        vertices: (V, 3) positions of the coarse mesh.
        normals: (V, 3) unit normals at boundary vertices; by default vertex normals.
        keep: (V,) from 0 to 1, to what extent inner vertices keep their places; by default all do. Where it is 0 the
            scheme is as it is and smooths what is uneven, see :func:`near`.

    Returns:
        (V', 3) float64 on the CPU.

    Raises:
        MeshError: if the step moves boundary vertices, or is more than one.
        ShapeError: as for :meth:`Refinement.apply`.
    """
    coarse = step.coarse.to("cpu")
    places = vertices.detach().to("cpu", torch.float64)
    step = step.to("cpu")
    fine = step.apply(places)
    count = coarse.num_vertices
    on_boundary = coarse.is_boundary_vertex
    moved = torch.nonzero(on_boundary & (fine[:count] != places).any(1)).squeeze(1).tolist()
    if step.topology.num_vertices != count + coarse.num_edges or moved:
        raise MeshError(
            f"the boundary vertices {first_few(moved, len(moved))} move, or there is more than one step: take one step "
            'of Loop subdivision with boundary="interpolate"'
        )
    kept = torch.ones(count, 1, dtype=places.dtype) if keep is None else keep.detach().to(places)[:, None]
    inner = step.apply(_control_mesh(step, places, kept))
    is_new_boundary = step.topology.is_boundary_vertex.clone()
    is_new_boundary[:count] = False
    fine = torch.where(step.topology.is_boundary_vertex[:, None], fine, inner)
    fine[:count] = torch.where((kept == 1.0) | on_boundary[:, None], places, fine[:count])
    kinds, numbers = step.vertex_origins.unbind(1)
    rows = torch.nonzero(is_new_boundary & (kinds == Origin.EDGE)).squeeze(1)
    edges = coarse.edges[numbers[rows]]
    sharp = boundary_corners(places, coarse, BOUNDARY_CORNER)[edges].all(1)
    normals = vertex_normals(places, coarse) if normals is None else normals.detach().to(places)
    fine[rows[sharp]] = _middles_of_arcs(places[edges[sharp]], normals[edges[sharp]])
    return fine


def near(topology: Topology, vertices: Tensor, rings: int) -> Tensor:
    """(V,) float64: 1 at chosen ``vertices`` (V,) bool and beside them, fading smoothly to 0 over so many rings."""
    v, w = topology.edges.unbind(1)
    distance = torch.where(vertices, 0, rings + 1)
    for ring in range(rings):
        reached = distance == ring
        ends = torch.cat([w[reached[v]], v[reached[w]]])
        distance[ends] = distance[ends].clamp(max=ring + 1)
    faded = (distance - 1).clamp(0, rings).to(torch.float64) / rings
    return 0.5 * (1.0 + torch.cos(math.pi * faded))


def _control_mesh(step: Refinement, places: Tensor, kept: Tensor) -> Tensor:
    """Vertices that the step takes to ``places`` inside, to the extent ``kept`` (V, 1).

    On the boundary they are shifted like the inner vertices beside.
    """
    coarse = step.coarse
    inside = (~coarse.is_boundary_vertex & (coarse.valences > 0))[:, None].to(places.dtype)
    v, w = coarse.edges.unbind(1)
    number = torch.zeros_like(inside).index_add_(0, v, inside[w]).index_add_(0, w, inside[v]).clamp_min(1.0)
    control = places
    for _ in range(_ROUNDS):
        missed = places - step.apply(control)[: coarse.num_vertices]
        shift = (control - places + missed) * inside * kept
        beside = torch.zeros_like(shift).index_add_(0, v, shift[w]).index_add_(0, w, shift[v]) / number
        control = places + torch.where(inside > 0, shift, beside)
    return control


def _middles_of_arcs(ends: Tensor, normals: Tensor) -> Tensor:
    """(n, 3) middles of cubic arcs between ``ends`` (n, 2, 3) whose tangents there are chords without normal part."""
    chord = (ends[:, 1] - ends[:, 0])[:, None]
    parts = dot(chord, normals)[..., None] * normals
    return ends.mean(1) + (parts[:, 1] - parts[:, 0]) / 8.0
