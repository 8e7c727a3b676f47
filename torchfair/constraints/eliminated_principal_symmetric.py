"""Principal-symmetric meshes with the spheres eliminated: vertices are the only unknowns."""

from __future__ import annotations

import torch
from torch import Tensor

from ..principal.principal_edges import PrincipalStars
from ..principal.spheres import spheres_through
from ..projection import ElementTerm
from .principal_symmetric import COPLANAR, COSPHERICAL, coplanar, star_numbers


def eliminated_cospherical(x: Tensor) -> Tensor:
    """By how much the neighbours ``x[:, 1:]`` (n, 4, 3) of vertices ``x[:, 0]`` miss a common sphere."""
    return spheres_through(x[:, 0], x[:, 1:]).misses


def eliminated_coplanar(x: Tensor) -> Tensor:
    """:func:`~torchfair.constraints.principal_symmetric.coplanar` at two vertices with four neighbours each."""
    first, second = x[:, :5], x[:, 5:]
    normals = [spheres_through(star[:, 0], star[:, 1:]).normals for star in (first, second)]
    return coplanar(x[:, [0, 5]], torch.stack(normals, dim=1))


def eliminated_principal_symmetric_terms(
    edges: Tensor, stars: PrincipalStars, *, weight: float, block: str = "vertices"
) -> list[ElementTerm]:
    """Both conditions of section 2.3 as functions of the vertices.

    One residual for each star and one for each edge, which depend on 5 and on 8 vertices: fewest unknowns, but a
    normal matrix with many more entries than with :func:`~torchfair.constraints.cospherical_terms`.

    Args:
        edges: (n, 2) principal edges between stars.
        stars: Regular vertices, among them all ends of edges.
        weight: Dimensionless.
        block: Name of the vertex block.

    Raises:
        ShapeError: an end of an edge is no star.
    """
    reach = torch.cat([stars.vertices[:, None], stars.cospherical], dim=1)
    numbers = star_numbers(edges, stars)
    both = torch.cat([reach[numbers[:, 0]], reach[numbers[:, 1]]], dim=1)
    return [
        ElementTerm(COSPHERICAL, eliminated_cospherical, [(block, reach)], weight=weight, batched=True),
        ElementTerm(COPLANAR, eliminated_coplanar, [(block, both)], weight=weight, batched=True),
    ]
