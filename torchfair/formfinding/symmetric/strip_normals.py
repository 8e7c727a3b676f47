"""Normals with which strips along principal edges are developable up to the boundary."""

from __future__ import annotations

import torch
from torch import Tensor

from ...constraints.principal_symmetric import excess_length, excess_length_derivative
from ...geometry._ops import cross, dot
from ...principal import PrincipalEdges, principal_normals
from ...principal.principal_edges import PrincipalStars
from ...projection import ElementTerm, ProjectionSettings, guided_projection

_SETTINGS = ProjectionSettings(
    max_iterations=30, initial_damping=1e-3, damping_scale="identity", merit_tolerance=1e-16, step_tolerance=1e-12
)


def coplanar_with_edge(normals: Tensor, direction: Tensor) -> Tensor:
    """``det(n(v), n(w), e)`` for ``normals`` (n, 2, 3) and unit edge directions e (n, 3)."""
    return dot(cross(normals[:, 0], normals[:, 1]), direction)


def coplanar_with_edge_derivative(normals: Tensor, direction: Tensor) -> Tensor:
    """Jacobians (n, 6) of :func:`coplanar_with_edge`."""
    first, second = normals.unbind(1)
    return torch.cat([cross(second, direction), cross(direction, first)], dim=1)


def strip_normals(vertices: Tensor, principal: PrincipalEdges, stars: PrincipalStars | None = None) -> Tensor:
    """Unit normals n(v): those of the spheres at stars; at other vertices nearby ones that keep quads of strips planar.

    :func:`~torchfair.principal.principal_normals` leaves principal edges along the boundary as they come. Here the
    normals at their ends are turned, as little as it takes, until ``det(n(v), n(w), w - v)`` is zero there too.
    At singular vertices, where several principal polylines end, that is impossible: the best compromise is taken.

    Args:
        vertices: (V, 3) positions, any length unit.
        principal: the principal edges.
        stars: where the conditions hold; by default all of ``principal.stars()``.

    Returns:
        (V, 3) in the dtype of the vertices; unit vectors, zero where there is no face.

    Example:
        >>> from torchfair.formfinding import strip_normals
        >>> from torchfair.principal import principal_edges_of_lattice
        >>> from torchfair.shapes import Catenoid, principal_triangles
        >>> mesh = principal_triangles(Catenoid(), 6, 12)
        >>> edges = principal_edges_of_lattice(mesh)
        >>> strip_normals(mesh.vertices, edges).shape
        torch.Size([84, 3])
    """
    stars = principal.stars() if stars is None else stars
    start = principal_normals(vertices.detach().to("cpu", torch.float64), principal.to("cpu"), stars)
    edges = principal.topology.edges[principal.mask].cpu()
    fixed = (start == 0.0).all(1)
    fixed[stars.vertices.cpu()] = True
    edges = edges[~fixed[edges].all(1)]
    if not edges.numel():
        return start.to(vertices)
    along = vertices.detach().to("cpu", torch.float64)[edges]
    directions = torch.nn.functional.normalize(along[:, 1] - along[:, 0], dim=1)
    moving = torch.nonzero(~fixed)
    terms = [
        ElementTerm(
            "coplanar normals",
            coplanar_with_edge,
            [("normals", edges)],
            data=(directions,),
            jacobian=coplanar_with_edge_derivative,
            batched=True,
        ),
        ElementTerm(
            "unit normals",
            excess_length,
            [("normals", moving)],
            jacobian=excess_length_derivative,
            batched=True,
        ),
    ]
    found = guided_projection({"normals": start}, terms, fixed={"normals": fixed}, settings=_SETTINGS)
    return found.blocks["normals"].to(vertices)
