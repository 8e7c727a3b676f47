"""Vertex normals that are right to second order, at boundaries and on irregular meshes too."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from .._portions import portions_unless
from ..topology import Topology
from ._any_size import of_any_size
from ._ops import dot, gather, norm, scatter_sum
from .lengths import edge_vectors
from .normals import vertex_normals
from .tangent_basis import tangent_bases

_STIFFNESS = 1e-3  # keeps normals where the edges of a star leave a direction open; edges have weight 1


@of_any_size(0)
def balanced_normals(vertices: Tensor, topology: Topology, *, sweeps: int = 4) -> Tensor:
    r"""Unit vertex normals ``u`` that lean as much forward as back along edges: ``(u_v + u_w) . (w - v)`` small.

    On a surface the normal is orthogonal to every curve, so its integral along a curve between the ends of
    an edge is zero. By the trapezoidal rule that is the condition, up to the third power of the edge length::

            u_v         u_w
              \   ___   /
               v--   --w

    Means of face normals are right to second order in the edge length where stars are symmetric. At the
    boundary they see one side only, and on irregular meshes neither side is like the other: there they are
    off by the first order, and curvatures computed from their differences by the order zero. Starting from
    :func:`vertex_normals`, boundary normals are fitted to the condition first, in least squares over the
    edges of the vertex; then every sweep moves all normals half way to their best fit.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        topology: connectivity; any polygons, mixed.
        sweeps: rounds over all vertices. Without any, only boundary normals are fitted. Four bring most of
            the gain on irregular meshes.

    Returns:
        (*batch, V, 3), length 1, defined on smooth surfaces: at sharp edges the condition overshoots. The
        zero vector, with zero derivatives, where :func:`vertex_normals` is zero.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (*batch, V, 3).

    Example:
        >>> from torchfair.geometry import balanced_normals
        >>> from torchfair.shapes import icosphere
        >>> ball = icosphere(2, radius=2.0)
        >>> normals = balanced_normals(ball.vertices, ball.topology)
        >>> (normals - ball.normals).norm(dim=1).max() < 0.02
        tensor(True)
    """
    normals = vertex_normals(vertices, topology)
    star = _Edges.of(vertices, topology)
    is_boundary = topology.is_boundary_vertex[:, None].to(vertices.dtype)
    normals = _sweep(normals, star, is_boundary)
    for _ in range(sweeps):
        normals = _sweep(normals, star, 0.5)
    return normals


@dataclass(frozen=True)
class _Edges:
    """Unit vectors (*batch, E, 3) along the edges, zero where they have no length, and both ends (2E,)."""

    directions: Tensor
    ends: Tensor

    @classmethod
    def of(cls, vertices: Tensor, topology: Topology) -> _Edges:
        edges = edge_vectors(vertices, topology)
        lengths = norm(edges)
        return cls(edges / torch.where(lengths > 0, lengths, 1.0)[..., None], topology.edges.T.flatten())


def _sweep(normals: Tensor, star: _Edges, step: Tensor | float) -> Tensor:
    """Normals moved by ``step`` times the way to the best fit, the neighbours taken as they are."""
    bases = tangent_bases(normals)
    ends = star.ends.view(2, -1)
    recorded = normals.requires_grad or star.directions.requires_grad
    parts = [
        _moments(normals, bases, star.directions[..., part, :], ends[:, part])
        for part in portions_unless(recorded, ends.shape[1], normals)
    ]
    moments = torch.cat([moments for side in zip(*parts, strict=True) for moments in side], dim=-2)
    xx, xy, yy, xs, ys = scatter_sum(moments, star.ends, normals.shape[-2]).unbind(-1)
    xx, yy = xx + _STIFFNESS, yy + _STIFFNESS
    turn = torch.stack([xy * ys - yy * xs, xy * xs - xx * ys], dim=-1) / (xx * yy - xy * xy)[..., None]
    moved = normals + step * (turn[..., None] * bases).sum(-2)
    length = norm(moved)  # at least 1: the turn is orthogonal to the normal
    return moved / torch.where(length > 0, length, 1.0)[..., None]


def _moments(normals: Tensor, bases: Tensor, directions: Tensor, ends: Tensor) -> tuple[Tensor, Tensor]:
    """What edges (*batch, n, 3) add to the fits at both their ends (2, n): (*batch, n, 5) each."""
    first, second = (gather(normals, end) for end in ends)
    known = (first != 0).any(-1) & (second != 0).any(-1)
    directions = torch.where(known[..., None], directions, 0.0)
    slope = dot(first + second, directions)

    def at(end: Tensor) -> Tensor:
        # The direction of an edge in the tangent plane of its end.
        x, y = dot(bases.index_select(-3, end), directions[..., None, :]).unbind(-1)
        return torch.stack([x * x, x * y, y * y, x * slope, y * slope], dim=-1)

    return at(ends[0]), at(ends[1])
