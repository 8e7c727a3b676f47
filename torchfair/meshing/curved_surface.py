"""Points on a smooth surface through the vertices of a mesh, in place of its flat triangles."""

from __future__ import annotations

import torch
from torch import Tensor

from ..geometry import ReferenceSurface, face_normals
from ..topology import Topology

_AT_VERTEX = 1 - 1e-9  # barycentric coordinate
_STRAIGHT = 0.8  # cosine between a normal and those of the faces around: less is a crease
_MOST = 0.2  # move over the longest side of a triangle


def on_curved_surface(
    points: Tensor, vertices: Tensor, topology: Topology, normals: Tensor, operators: Tensor
) -> Tensor:
    r"""Points of triangles moved onto a surface that bends as the curvature at the vertices says, (n, 3).

    At a vertex v with the normal n and the shape operator S the surface has the height ``-x S x / 2`` over its
    tangent plane, ``x`` away from v. Every point moves along the normals of the three corners of its triangle, as far
    as their heights are above it, in the mean by its barycentric coordinates. So vertices stay, the surface has no
    gaps, and its error falls with the third power of the edges, where that of flat triangles falls with the second.
    A mesh that is finer than the triangles has no facets of theirs then, each of which turns its edges.

    Points stay at vertices, and beside vertices at which faces turn from the normal by more than 37 degrees.

    Args:
        points: (n, 3) on the triangles.
        vertices: (V, 3) float64.
        topology: triangles.
        normals: (V, 3) of :func:`torchfair.geometry.fitted_curvature`.
        operators: (V, 3, 3) of the same.
    """
    closest = ReferenceSurface(vertices, topology).closest(points)
    corners = topology.triangles[closest.faces]
    away = points[:, None] - vertices[corners]
    along = normals[corners]
    bent = (away[..., None, :] @ operators[corners] @ away[..., None])[..., 0, 0]
    above = -bent / 2 - (along * away).sum(-1)
    weights = closest.weights * _straight(vertices, topology, normals)[corners]
    weights = torch.where(closest.weights.amax(1, keepdim=True) < _AT_VERTEX, weights, 0.0)
    moves = (weights[..., None] * above[..., None] * along).sum(1)
    sides = (vertices[corners] - vertices[corners.roll(1, 1)]).norm(dim=-1).amax(1)
    most = _MOST * sides / moves.norm(dim=1).clamp_min(1e-300)
    moved: Tensor = points + moves * most.clamp_max(1.0)[:, None]
    return moved


def _straight(vertices: Tensor, topology: Topology, normals: Tensor) -> Tensor:
    """(V,) one where the faces around a vertex are nearly orthogonal to its normal, zero elsewhere."""
    triangles = topology.triangles
    cosines = (normals[triangles] * face_normals(vertices, topology)[:, None]).sum(-1)
    least = torch.ones_like(vertices[:, 0])
    least = least.scatter_reduce(0, triangles.flatten(), cosines.flatten(), "amin")
    return (least > _STRAIGHT).to(vertices)
