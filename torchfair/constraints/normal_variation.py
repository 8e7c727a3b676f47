"""The energy E = sum l l* as a target: one smooth signed residual for each interior edge."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor
from torch.linalg import cross, vector_norm

from ..projection import ElementTerm, SmoothAbsolute
from ..topology import Topology

NAME = "normal variation"


def normal_variation_terms(
    topology: Topology, *, smoothing: float, weight: float = 1.0, block: str = "vertices"
) -> list[ElementTerm]:
    """Terms whose merit is ``weight * sum sqrt((l l*)^2 + smoothing^2) - smoothing``.

    The absolute value of paper section 3 is treated by iterative reweighting of residuals that pass
    smoothly through flat edges.

    Args:
        topology: Any polygon mesh; edges are grouped by the sizes of their two faces.
        smoothing: Length below which ``l l*`` counts as flat, in the unit of the vertices.
        weight: Dimensionless.
        block: Name of the vertex block.
    """
    terms = []
    for (left, _), stencil in edge_stencils(topology).items():
        is_triangles = stencil.shape[1] == 4
        terms.append(
            ElementTerm(
                NAME,
                triangle_pair_bend if is_triangles else _polygon_residual(left),
                [(block, stencil)],
                weight=weight,
                loss=SmoothAbsolute(smoothing),
                jacobian=triangle_pair_bend_gradient if is_triangles else None,
                batched=is_triangles,
            )
        )
    return terms


def edge_stencils(topology: Topology) -> dict[tuple[int, int], Tensor]:
    """Interior edges by the sizes ``(k, m)`` of their left and right face, as vertex stencils ``(n, k+m-2)``.

    Each row is ``v, w``, then the other corners of the left face after ``w``, then the other corners of the
    right face after ``v``, both counterclockwise.
    """
    count = topology.num_interior_edges
    v, w = topology.interior_edges.unbind(1)
    left, right = topology.interior_edge_faces.unbind(1)
    corner = torch.arange(topology.corners.shape[0], device=topology.device)
    interior = topology.corner_edges < count
    is_left = topology.corners == topology.edges[topology.corner_edges, 0]
    left_start, right_start = torch.empty_like(v), torch.empty_like(v)
    left_start[topology.corner_edges[interior & is_left]] = corner[interior & is_left]
    right_start[topology.corner_edges[interior & ~is_left]] = corner[interior & ~is_left]
    sizes = torch.stack([topology.face_sizes[left], topology.face_sizes[right]], dim=1)
    groups: dict[tuple[int, int], Tensor] = {}
    for k, m in torch.unique(sizes, dim=0).tolist():
        edges = torch.nonzero((sizes[:, 0] == k) & (sizes[:, 1] == m)).squeeze(1)
        columns = [v[edges], w[edges]]
        columns += _walk(topology, left_start[edges], k)
        columns += _walk(topology, right_start[edges], m)
        groups[k, m] = torch.stack(columns, dim=1)
    return groups


def _walk(topology: Topology, start: Tensor, size: int) -> list[Tensor]:
    """Vertices two, three, ... corners after ``start``."""
    corner = topology.next_corners[start]
    found = []
    for _ in range(size - 2):
        corner = topology.next_corners[corner]
        found.append(topology.corners[corner])
    return found


def triangle_pair_bend(x: Tensor) -> Tensor:
    """Signed ``l l*`` (*n,) of edges between triangles; corners ``x`` (*n, 4, 3): ends, apex on the left, on the right.

    Positive where convex; ``2 sin(a/2)`` is written as ``sin a sqrt(2 / (1 + cos a))``, smooth at a = 0.
    """
    edge, left_side, right_side = _sides(x)
    left, right = _cross(edge, left_side), _cross(right_side, edge)
    size = torch.sqrt(_dot(left, left)) * torch.sqrt(_dot(right, right))
    # (left x right) . edge = -|edge|^2 (left . right_side), so that sin a = -|edge| (left . right_side) / size.
    bend: Tensor = -_dot(edge, edge) * _dot(left, right_side) * torch.sqrt(2.0 / (size * (size + _dot(left, right))))
    return bend


def triangle_pair_bend_gradient(x: Tensor) -> Tensor:
    """Gradient ``(*n, 12)`` of :func:`triangle_pair_bend` in closed form: ``l* dl + l cos(a/2) da``.

    With N the normal of a triangle, twice its area long, the dihedral angle turns with the apex of that
    triangle as ``da = -l N / |N|^2``, and with the ends of the edge by the shares at which the foot of the
    apex divides it::

              2
             /| .
           /  |   .
          0---+-----1        share of end 1: |0 +| / |0 1|
    """
    edge, left_side, right_side = _sides(x)
    left, right = _cross(edge, left_side), _cross(right_side, edge)
    squared = _dot(edge, edge)
    left_squared, right_squared = _dot(left, left), _dot(right, right)
    size = torch.sqrt(left_squared) * torch.sqrt(right_squared)
    cosine_sum = size + _dot(left, right)
    turn = -squared * torch.sqrt(cosine_sum / (2.0 * size))
    at_left, at_right = turn / left_squared * left, turn / right_squared * right
    stretch = -_dot(left, right_side) * torch.sqrt(2.0 / (size * cosine_sum)) * edge
    left_share, right_share = _dot(left_side, edge) / squared, _dot(right_side, edge) / squared
    at_end = stretch - left_share * at_left - right_share * at_right
    return torch.cat([-(at_end + at_left + at_right), at_end, at_left, at_right]).movedim(0, -1)


def _sides(x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Edge, left and right side (3, *n) from the first corner; components first, which makes long rows of numbers."""
    corners = x.movedim((-2, -1), (0, 1)).contiguous()
    edge, left, right = (corners[1:] - corners[0]).unbind()
    return edge, left, right


def _cross(a: Tensor, b: Tensor) -> Tensor:
    """Of (3, *n) vectors."""
    parts = [a[i - 2] * b[i - 1] - a[i - 1] * b[i - 2] for i in range(3)]
    return torch.stack(parts)


def _dot(a: Tensor, b: Tensor) -> Tensor:
    """(*n,) of (3, *n) vectors."""
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _polygon_residual(size: int) -> Callable[[Tensor], Tensor]:
    def bend(x: Tensor) -> Tensor:
        return polygon_pair_bend(x, size)

    return bend


def polygon_pair_bend(x: Tensor, left_size: int) -> Tensor:
    """Bending and twist of an edge between two polygons: a 2-vector of norm ``l l*``.

    ``n - n'`` is orthogonal to ``n + n'``, so two components describe it: one across the edge, signed,
    positive where convex, and one along it, which vanishes for planar faces. Both are smooth at zero.
    """
    left = area_vector(x[:left_size])
    right = area_vector(torch.cat([x[1:2], x[0:1], x[left_size:]]))
    left, right = left / vector_norm(left), right / vector_norm(right)
    edge = x[1] - x[0]
    length = vector_norm(edge)
    mean = left + right
    mean = mean / vector_norm(mean)
    along = edge - torch.dot(edge, mean) * mean
    along = along / vector_norm(along)
    across = cross(along, mean)
    jump = length * (right - left)
    return torch.stack([torch.dot(jump, across), torch.dot(jump, along)])


def area_vector(polygon: Tensor) -> Tensor:
    """Area vector ``(3,)`` of a polygon ``(k, 3)``, counterclockwise."""
    spokes = polygon[1:] - polygon[0]
    vector: Tensor = 0.5 * cross(spokes[:-1], spokes[1:]).sum(0)
    return vector
