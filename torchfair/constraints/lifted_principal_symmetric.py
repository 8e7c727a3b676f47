r"""Principal-symmetric meshes with the variables of paper section 5.2: sphere centres c(v), plane normals n(e), slacks.

Faithful, for comparison: all constraints are quadratic. Sphere centres go to infinity where stars are flat; spheres
start with a radius of at most :data:`LARGEST_RADIUS`, and near-flat meshes converge slowly or not at all.
"""

from __future__ import annotations

import torch
from torch import Tensor

from ..geometry._ops import cross, dot, norm
from ..principal.principal_edges import PrincipalStars
from ..principal.spheres import star_spheres
from ..projection import ElementTerm
from ..projection.layout import State
from .principal_symmetric import COPLANAR, COSPHERICAL, star_numbers

CENTRES, PLANES, SLACKS = "sphere centres", "edge planes", "slacks"
LARGEST_RADIUS = 1e3  # mean edge lengths


def lifted_principal_symmetric_blocks(vertices: Tensor, edges: Tensor, stars: PrincipalStars) -> State:
    """Centres (R, 3), unit normals of the planes (n, 3) of edges, and slacks (R, 2).

    They fit ``vertices`` (V, 3) at all stars and ``edges`` (n, 2).
    """
    spheres = star_spheres(vertices, stars)
    bent = torch.where(spheres.curvatures < 0, -1.0, 1.0) * spheres.curvatures.abs().clamp_min(1.0 / LARGEST_RADIUS)
    outward = spheres.normals / bent[:, None]
    numbers = star_numbers(edges, stars)
    along = vertices[edges[:, 1]] - vertices[edges[:, 0]]
    plane = cross(along, spheres.normals[numbers].sum(1))
    spokes = vertices[stars.principal] - vertices[stars.vertices, None]
    return {
        CENTRES: vertices[stars.vertices] + outward,
        PLANES: plane / norm(plane).clamp_min(1e-12)[:, None],
        SLACKS: (-dot(outward[:, None], spokes)).clamp_min(0.0).sqrt(),
    }


def equal_distances(x: Tensor, centre: Tensor) -> Tensor:
    """``|v - c|^2 - |w - c|^2`` for v, w in ``x`` (2, 3)."""
    return (x[0] - centre[0]).square().sum() - (x[1] - centre[0]).square().sum()


def plane_of_edge(x: Tensor, centres: Tensor, plane: Tensor) -> Tensor:
    """``n.(v - w)``, ``n.(c(v) - v)``, ``n.(c(w) - w)`` and ``n.n - 1``."""
    normal = plane[0]
    inside = torch.stack([x[0] - x[1], centres[0] - x[0], centres[1] - x[1]])
    return torch.cat([inside @ normal, (normal.dot(normal) - 1.0)[None]])


def saddle_side(x: Tensor, centre: Tensor, slacks: Tensor) -> Tensor:
    """``(v - c).(v - w) + delta^2`` for the principal neighbours w in ``x`` (3, 3), v first."""
    return (x[:1] - x[1:]) @ (x[0] - centre[0]) + slacks[0].square()


def lifted_principal_symmetric_terms(
    edges: Tensor, stars: PrincipalStars, is_saddle: Tensor, *, weight: float, block: str = "vertices"
) -> list[ElementTerm]:
    """The constraints of section 5.2.

    Args:
        edges: (n, 2) principal edges between stars.
        stars: Regular vertices, among them all ends of edges.
        is_saddle: (R,) stars whose principal neighbours are to lie on the other side of the tangent plane.
        weight: Of half the squared constraints; dimensionless.
        block: Name of the vertex block.

    Raises:
        ShapeError: an end of an edge is no star.
    """
    number = torch.arange(stars.vertices.shape[0], device=stars.vertices.device)
    centres = stars.vertices.repeat_interleave(4)
    pairs = torch.stack([centres, stars.cospherical.reshape(-1)], dim=1)
    spheres = number.repeat_interleave(4)[:, None]
    sides = torch.cat([stars.vertices[:, None], stars.principal], dim=1)[is_saddle]
    saddles = number[is_saddle][:, None]
    edge_numbers = torch.arange(edges.shape[0], device=edges.device)[:, None]
    return [
        ElementTerm(COSPHERICAL, equal_distances, [(block, pairs), (CENTRES, spheres)], weight=weight),
        ElementTerm(
            COPLANAR,
            plane_of_edge,
            [(block, edges), (CENTRES, star_numbers(edges, stars)), (PLANES, edge_numbers)],
            weight=weight,
        ),
        ElementTerm("saddle side", saddle_side, [(block, sides), (CENTRES, saddles), (SLACKS, saddles)], weight=weight),
    ]
