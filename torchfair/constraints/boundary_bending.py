"""The bending between prescribed tangent planes and the faces at the boundary, as part of C."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.linalg import cross, vector_norm

from .._graph import edge_numbers
from ..projection import ElementTerm, SmoothAbsolute
from ..topology import Topology
from .base import Constraint

NAME = "bending at the boundary"


def boundary_bend(x: Tensor, normal: Tensor) -> Tensor:
    """Length of an edge times the sine of the angle about it between a face and a plane: scalar.

    Args:
        x: (3, 3) corners of the face, the edge first.
        normal: (3,) unit normal of the plane.
    """
    along = x[1] - x[0]
    area = cross(along, x[2] - x[0])
    bend: Tensor = torch.dot(cross(area, normal), along) / vector_norm(area)
    return bend


def boundary_bending_terms(
    topology: Topology, normals: Tensor, *, smoothing: float, weight: float = 1.0, block: str = "vertices"
) -> list[ElementTerm]:
    """Smoothed bending ``l |sin a|`` of boundary edges between their face and the tangent plane prescribed there.

    Open stars do not count the bending between the boundary and the first row. Where nothing is prescribed that is an
    error of C of first order; where tangent planes are, a surface could hide there what bending they ask for.

    Args:
        topology: Triangle mesh.
        normals: (V, 3) prescribed unit normals at boundary vertices, zero where none is; edges between two count.
        smoothing: As in :func:`absolute_curvature_terms`.
        weight: Of the bending, which counts once, as C does.
        block: Name of the vertex block.
    """
    corners = topology.triangles
    sides = torch.cat([corners, corners.roll(-1, 1), corners.roll(-2, 1)])
    on_boundary = edge_numbers(topology, sides[:, :2]) >= topology.num_interior_edges
    total = normals[sides[:, 0]] + normals[sides[:, 1]]
    size = vector_norm(total, dim=1)
    given = (normals != 0.0).any(1)
    chosen = on_boundary & given[sides[:, 0]] & given[sides[:, 1]] & (size > 0.5)
    if not bool(chosen.any()):
        return []
    data = (total[chosen] / size[chosen, None],)
    loss = SmoothAbsolute(smoothing)
    return [ElementTerm(NAME, boundary_bend, [(block, sides[chosen])], data=data, weight=weight, loss=loss)]


class BoundaryBending(Constraint):
    """Module form of :func:`boundary_bending_terms`: ``sum sqrt((l sin a)^2 + smoothing^2) - smoothing``, a length.

    Args:
        topology: Triangle mesh.
        normals: (V, 3) prescribed unit normals at boundary vertices, zero where none is.
        smoothing: Length below which ``l sin a`` counts as flat, above 0.

    Example:
        >>> import torch
        >>> from torchfair.constraints import BoundaryBending
        >>> from torchfair.geometry import vertex_normals
        >>> from torchfair.shapes import Catenoid, principal_triangles
        >>> mesh = principal_triangles(Catenoid(), 8, 16)
        >>> constraint = BoundaryBending(mesh.topology, vertex_normals(mesh.vertices, mesh.topology), smoothing=0.01)
        >>> constraint(mesh.vertices)
        tensor(0.9147, dtype=torch.float64)
    """

    def __init__(self, topology: Topology, normals: Tensor, *, smoothing: float) -> None:
        super().__init__(boundary_bending_terms(topology, normals, smoothing=smoothing))
