"""The energy E = sum l l* as a target: one smooth signed residual for each interior edge."""

from __future__ import annotations

from collections.abc import Iterator

import torch
from torch import Tensor

from ..projection import ElementTerm, SmoothAbsolute
from ..topology import Topology
from ._components import components_first, cross, derivative_rows, dot
from ._polygon_bend import PolygonBend, polygon_bend
from ._pooled import pooled
from .base import Constraint

NAME = "normal variation"


def normal_variation_terms(
    topology: Topology, *, smoothing: float, weight: float = 1.0, block: str = "vertices"
) -> list[ElementTerm]:
    """Terms whose merit is ``weight * sum sqrt((l l*)^2 + smoothing^2) - smoothing``.

    The absolute value of paper section 3 is treated by iterative reweighting of residuals that pass
    smoothly through flat edges.

    Args:
        topology: Any polygon mesh; edges are grouped by the sizes of their two faces, if many have them.
        smoothing: Length below which ``l l*`` counts as flat, in the unit of the vertices.
        weight: Of E, which counts once; dimensionless.
        block: Name of the vertex block.
    """
    terms = []
    for group in pooled(_edges_by_sizes(topology)):
        bend = pair_bend(sum(group.runs[:2]), sum(group.runs))
        terms.append(
            ElementTerm(
                NAME,
                group.function(bend.residual),
                [(block, group.stencil)],
                data=group.data,
                weight=weight,
                loss=SmoothAbsolute(smoothing),
                jacobian=group.jacobian(bend.jacobian),
                batched=True,
            )
        )
    return terms


def _edges_by_sizes(topology: Topology) -> Iterator[tuple[Tensor, list[Tensor]]]:
    """Stencils of :func:`edge_stencils`, with their numbers: the edge, and the other corners of each face."""
    for (left, right), stencil in edge_stencils(topology).items():
        runs = torch.split(stencil, [2, left - 2, right - 2], dim=1)
        yield torch.arange(len(stencil), device=stencil.device), list(runs)


class SmoothNormalVariation(Constraint):
    """Module form of :func:`normal_variation_terms`: ``sum sqrt((l l*)^2 + smoothing^2) - smoothing``, a length.

    At most :class:`~torchfair.energies.NormalVariation`, to which it tends as ``smoothing`` goes to 0; has no kink at
    flat edges, so second derivatives are finite there. Unchanged by rigid motions.

    Args:
        topology: Any polygon mesh.
        smoothing: Length below which ``l l*`` counts as flat, above 0.

    Example:
        >>> import torch
        >>> from torchfair.constraints import SmoothNormalVariation
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> constraint = SmoothNormalVariation(mesh.topology, smoothing=0.01)
        >>> constraint(mesh.vertices)
        tensor(21.0395, dtype=torch.float64)
    """

    def __init__(self, topology: Topology, *, smoothing: float) -> None:
        super().__init__(normal_variation_terms(topology, smoothing=smoothing))


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
    largest = int(topology.face_sizes.max()) + 1 if topology.num_faces else 1
    sizes = topology.face_sizes[left] * largest + topology.face_sizes[right]  # one number, which sorts much faster
    groups: dict[tuple[int, int], Tensor] = {}
    for both in torch.unique(sizes).tolist():
        k, m = divmod(both, largest)
        edges = torch.nonzero(sizes == both).squeeze(1)
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
    """Signed ``l l*`` (n,) of edges ``x[:, 0] x[:, 1]`` between triangles with apexes ``x[:, 2]`` (left), ``x[:, 3]``.

    Positive where convex; ``2 sin(a/2)`` is written as ``sin a sqrt(2 / (1 + cos a))``, smooth at a = 0. One edge
    (4, 3) gives a scalar.
    """
    edge, left_side, right_side = _sides(x)
    left, right = cross(edge, left_side), cross(right_side, edge)
    size = (dot(left, left) * dot(right, right)).sqrt()
    # (left x right) . edge = -|edge|^2 (left . right_side), so that sin a = -|edge| (left . right_side) / size.
    return -dot(edge, edge) * dot(left, right_side) * torch.sqrt(2.0 / (size * (size + dot(left, right))))


def triangle_pair_bend_gradient(x: Tensor) -> Tensor:
    """Gradients ``(n, 12)`` of :func:`triangle_pair_bend` in closed form: ``l* dl + l cos(a/2) da``.

    With N the normal of a triangle, twice its area long, the dihedral angle turns with the apex of that
    triangle as ``da = -l N / |N|^2``, and with the ends of the edge by the shares at which the foot of the
    apex divides it::

              2
             /| .
           /  |   .
          0---+-----1        share of end 1: |0 +| / |0 1|
    """
    edge, left_side, right_side = _sides(x)
    left, right = cross(edge, left_side), cross(right_side, edge)
    squared = dot(edge, edge)
    left_squared, right_squared = dot(left, left), dot(right, right)
    size = torch.sqrt(left_squared * right_squared)
    cosine_sum = size + dot(left, right)
    turn = -squared * torch.sqrt(cosine_sum / (2.0 * size))
    at_left, at_right = turn / left_squared * left, turn / right_squared * right
    stretch = -dot(left, right_side) * torch.sqrt(2.0 / (size * cosine_sum)) * edge
    left_share, right_share = dot(left_side, edge) / squared, dot(right_side, edge) / squared
    at_end = stretch - left_share * at_left - right_share * at_right
    return derivative_rows([-(at_end + at_left + at_right), at_end, at_left, at_right])


def _sides(x: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """(3, n) from the start of an edge: to its end, to the apex on its left, to that on its right."""
    corners = components_first(x)
    return corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 0]


TRIANGLE_BEND = PolygonBend(triangle_pair_bend, triangle_pair_bend_gradient)


def pair_bend(left_size: int, corners: int) -> PolygonBend:
    """Residual and Jacobian of edges whose left faces have ``left_size`` of all ``corners``."""
    return TRIANGLE_BEND if corners == 4 else polygon_bend(left_size)


def area_vector(polygon: Tensor) -> Tensor:
    """Area vector ``(3,)`` of a polygon ``(k, 3)``, counterclockwise."""
    spokes = polygon[1:] - polygon[0]
    vector: Tensor = 0.5 * torch.linalg.cross(spokes[:-1], spokes[1:]).sum(0)
    return vector
