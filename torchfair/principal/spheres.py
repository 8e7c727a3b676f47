r"""Spheres through vertices and their cospherical neighbours, in a form that stays finite on flat stars.

The sphere through v with unit normal n and curvature k there is ``k |x - v|^2 = 2 n.(x - v)``: its centre is
``v + n / k``, and for k = 0 it is a plane. Four neighbours determine it up to one number, by which they miss it.
"""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from ..geometry import vertex_normals
from ..geometry._ops import cross, dot, gather, norm
from .principal_edges import PrincipalEdges, PrincipalStars

_STIFF = 1e12


class StarSpheres(NamedTuple):
    """The spheres of R regular vertices.

    Attributes:
        normals: (*batch, R, 3) unit normals at the vertices.
        curvatures: (*batch, R) per length unit; positive where the sphere lies on the side of the normal, 0 for planes.
        misses: (*batch, R) by how much the neighbours miss the sphere, signed; length unit squared over length.
            ``k |w - v|^2 - 2 n.(w - v)`` is this at w2 and w5 and minus this at w3 and w6, so half of it is how far
            they are away, but for terms of higher order. 0 where all four lie on it.
    """

    normals: Tensor
    curvatures: Tensor
    misses: Tensor


def star_spheres(vertices: Tensor, stars: PrincipalStars) -> StarSpheres:
    """The sphere of every star that its four cospherical neighbours miss alike, with alternating signs.

    Where a sphere passes through all of them it is this one. Normals point to the side from which the neighbours run
    counterclockwise.

    Args:
        vertices: positions (*batch, V, 3), any length unit.
        stars: see :meth:`PrincipalEdges.stars`.

    Returns:
        See :class:`StarSpheres`. Where no sphere is determined, as for neighbours on a line, everything is zero.
        Differentiable elsewhere.
    """
    centres = gather(vertices, stars.vertices)
    return spheres_through(centres, gather(vertices, stars.cospherical))


def spheres_through(centres: Tensor, neighbours: Tensor) -> StarSpheres:
    """As :func:`star_spheres`, of centres (*batch, R, 3) and their cospherical neighbours (*batch, R, 4, 3).

    ``k |d|^2 - 2 n.d`` alternates between the four spokes d, so that sums over the pairs (2, 3), (3, 5), (5, 6)
    vanish: three linear equations for k and n.
    """
    spokes = neighbours - centres[..., None, :]
    squares = dot(spokes, spokes)
    a, b, c = (spokes[..., i, :] + spokes[..., i + 1, :] for i in range(3))
    p, q, r = (squares[..., i] + squares[..., i + 1] for i in range(3))
    bc = cross(b, c)
    direction = p[..., None] * bc + q[..., None] * cross(c, a) + r[..., None] * cross(a, b)
    length = norm(direction)[..., None]
    around = cross(spokes[..., 0, :] - spokes[..., 2, :], spokes[..., 1, :] - spokes[..., 3, :])
    # Counterclockwise neighbours have their diagonals in this order, seen from the normal.
    sign = torch.where(dot(direction, around)[..., None] < 0, -1.0, 1.0).to(centres.dtype)
    scale = torch.where(length > 0, sign / torch.where(length > 0, length, 1.0), 0.0)
    normals = direction * scale
    curvatures = 2.0 * dot(a, bc) * scale[..., 0]
    misses = curvatures * squares[..., 0] - 2.0 * dot(normals, spokes[..., 0, :])
    return StarSpheres(normals, curvatures, misses)


def principal_normals(vertices: Tensor, principal: PrincipalEdges, stars: PrincipalStars | None = None) -> Tensor:
    """Unit normals n(v) with which strips along principal edges are developable, where the conditions hold.

    Args:
        vertices: positions (V, 3), any length unit.
        principal: the principal edges.
        stars: where conditions hold; by default all of ``principal.stars()``.

    Returns:
        (V, 3). At stars the normals of their spheres. At other vertices the vertex normal, turned into the planes that
        principal edges to stars span with the normals there: of one such edge the nearest normal in its plane, of two
        the line in which both planes meet, of more, as at singular vertices, the best compromise. Zero where neither
        exists.
    """
    stars = principal.stars() if stars is None else stars
    spheres = star_spheres(vertices, stars)
    normals = vertex_normals(vertices, principal.topology).clone()
    is_star = torch.zeros(vertices.shape[0], dtype=torch.bool, device=vertices.device)
    is_star[stars.vertices] = True
    normals[stars.vertices] = torch.where(spheres.normals == 0, normals[stars.vertices], spheres.normals)
    edges = principal.topology.edges[principal.mask]
    edges = torch.cat([edges, edges.flip(1)])
    star, other = edges[is_star[edges[:, 0]] & ~is_star[edges[:, 1]]].unbind(1)
    across = cross(vertices[other] - vertices[star], normals[star])
    across = across / norm(across).clamp_min(1e-300)[:, None]
    identity = torch.eye(3, dtype=vertices.dtype, device=vertices.device)
    stiffness = identity.repeat(vertices.shape[0], 1, 1)
    stiffness.index_add_(0, other, _STIFF * across[:, :, None] * across[:, None, :])
    turned = torch.linalg.solve(stiffness[other], normals[other][..., None])[..., 0]
    lengths = norm(turned)[:, None]
    normals[other] = torch.where(lengths > 0, turned / lengths.clamp_min(1e-300), normals[other])
    return normals
