r"""Principal-symmetric meshes (paper sections 2.3 and 5.2), with spheres that may be planes.

Every star has a unit normal n and a curvature k among the unknowns. The sphere through the vertex v is
``k |x - v|^2 = 2 n.(x - v)``, with centre ``c = v + n / k``: where the paper's variable c goes to infinity, at flat
stars, k goes through zero.
"""

from __future__ import annotations

import torch
from torch import Tensor

from ..errors import ShapeError
from ..geometry._ops import cross, dot
from ..principal.principal_edges import PrincipalStars
from ..principal.spheres import star_spheres
from ..projection import ElementTerm
from ..projection.layout import State
from .base import Constraint

NORMALS, CURVATURES = "sphere normals", "sphere curvatures"
COSPHERICAL, COPLANAR = "cospherical neighbours", "coplanar normals"


def sphere_blocks(vertices: Tensor, stars: PrincipalStars) -> State:
    """The unknowns beside the vertices: normals (R, 3) and curvatures (R, 1) of the spheres that fit ``vertices``."""
    spheres = star_spheres(vertices, stars)
    return {NORMALS: spheres.normals, CURVATURES: spheres.curvatures[:, None]}


def cospherical(x: Tensor, normal: Tensor, curvature: Tensor) -> Tensor:
    """``k |w - v|^2 - 2 n.(w - v)`` for v, w in ``x`` (n, 2, 3): twice the distance of w from the sphere, nearly."""
    spoke = x[:, 1] - x[:, 0]
    return curvature[:, 0, 0] * dot(spoke, spoke) - 2.0 * dot(normal[:, 0], spoke)


def cospherical_derivative(x: Tensor, normal: Tensor, curvature: Tensor) -> Tensor:
    """Jacobians (n, 10) of :func:`cospherical`."""
    spoke = x[:, 1] - x[:, 0]
    by_spoke = 2.0 * (curvature[:, 0] * spoke - normal[:, 0])
    return torch.cat([-by_spoke, by_spoke, -2.0 * spoke, dot(spoke, spoke)[:, None]], dim=1)


def excess_length(normal: Tensor) -> Tensor:
    """``n.n - 1`` for ``normal`` (n, 1, 3)."""
    return dot(normal[:, 0], normal[:, 0]) - 1.0


def excess_length_derivative(normal: Tensor) -> Tensor:
    """Jacobians (n, 3) of :func:`excess_length`."""
    return 2.0 * normal[:, 0]


def coplanar(x: Tensor, normals: Tensor) -> Tensor:
    """``det(n(v), n(w), w - v)`` for v, w in ``x`` (n, 2, 3): edge length times sines of angles between normals."""
    return dot(cross(normals[:, 0], normals[:, 1]), x[:, 1] - x[:, 0])


def coplanar_derivative(x: Tensor, normals: Tensor) -> Tensor:
    """Jacobians (n, 12) of :func:`coplanar`."""
    edge = x[:, 1] - x[:, 0]
    first, second = normals.unbind(1)
    by_edge = cross(first, second)
    return torch.cat([-by_edge, by_edge, cross(second, edge), cross(edge, first)], dim=1)


def cospherical_terms(stars: PrincipalStars, *, weight: float, block: str = "vertices") -> list[ElementTerm]:
    """The four cospherical neighbours of every vertex lie on its sphere, whose normal is a unit vector.

    Args:
        stars: Regular vertices; see :meth:`~torchfair.principal.PrincipalEdges.stars`.
        weight: Of half the squares; dimensionless.
        block: Name of the vertex block; normals and curvatures are in those of
            :func:`~torchfair.constraints.sphere_blocks`.
    """
    number = torch.arange(stars.vertices.shape[0], device=stars.vertices.device)
    centres, spheres = (column.repeat_interleave(4) for column in (stars.vertices, number))
    pairs = torch.stack([centres, stars.cospherical.reshape(-1)], dim=1)
    return [
        ElementTerm(
            COSPHERICAL,
            cospherical,
            [(block, pairs), (NORMALS, spheres[:, None]), (CURVATURES, spheres[:, None])],
            weight=weight,
            jacobian=cospherical_derivative,
            batched=True,
        ),
        ElementTerm(
            "unit normals",
            excess_length,
            [(NORMALS, number[:, None])],
            weight=weight,
            jacobian=excess_length_derivative,
            batched=True,
        ),
    ]


def coplanar_terms(
    edges: Tensor, stars: PrincipalStars, *, weight: float, block: str = "vertices"
) -> list[ElementTerm]:
    """n(v), n(w) and the edge from v to w are coplanar, so that strips along polylines of such edges are developable.

    Args:
        edges: (n, 2) principal edges; see :func:`~torchfair.constraints.between_stars`.
        stars: Regular vertices, among them all ends of edges.
        weight: Of half the squares; dimensionless.
        block: Name of the vertex block; normals are those of :func:`~torchfair.constraints.sphere_blocks`.

    Raises:
        ShapeError: an end of an edge is no star.
    """
    return [
        ElementTerm(
            COPLANAR,
            coplanar,
            [(block, edges), (NORMALS, star_numbers(edges, stars))],
            weight=weight,
            jacobian=coplanar_derivative,
            batched=True,
        )
    ]


def unevenness(x: Tensor) -> Tensor:
    """How far w2 and w3, and w5 and w6, of ``x`` (n, 7, 3) are from being level along the principal polyline, (n, 2).

    The sum of both spokes along w1 - w4, over the length of that: 0 where the star is its own mirror image.
    """
    spokes = x[:, 1:] - x[:, :1]
    along = spokes[:, 0] - spokes[:, 3]
    sums = torch.stack([spokes[:, 1] + spokes[:, 2], spokes[:, 4] + spokes[:, 5]], dim=1)
    return dot(sums, along[:, None]) / dot(along, along)[:, None].clamp_min(1e-24)


def even_star_terms(stars: PrincipalStars, *, weight: float, block: str = "vertices") -> list[ElementTerm]:
    """Fairness that undoes shear: stars tend to be symmetric to their principal polyline's normal plane.

    Principal quads cut by diagonals are sheared by half an edge; spheres and coplanar normals do not see that.
    Vanishes with the edge length on lattices of principal curvature lines.

    Args:
        stars: Regular vertices.
        weight: Of half the squares; dimensionless.
        block: Name of the vertex block.
    """
    return [ElementTerm("even stars", unevenness, [(block, star_stencil(stars))], weight=weight, batched=True)]


class EvenStars(Constraint):
    """Module form of :func:`even_star_terms`: half the sum of squares, dimensionless.

    Unchanged by similarities.

    Args:
        stars: Regular vertices.

    Example:
        >>> import torch
        >>> from torchfair.constraints import EvenStars
        >>> from torchfair.principal import principal_edges_of_lattice
        >>> from torchfair.shapes import Catenoid, principal_triangles
        >>> mesh = principal_triangles(Catenoid(), 8, 16)
        >>> edges = principal_edges_of_lattice(mesh)
        >>> stars = edges.stars()
        >>> constraint = EvenStars(stars)
        >>> constraint(mesh.vertices) < 1e-12
        tensor(True)
    """

    def __init__(self, stars: PrincipalStars) -> None:
        super().__init__(even_star_terms(stars, weight=1.0))


def star_stencil(stars: PrincipalStars) -> Tensor:
    """(R, 7) vertices v, w1, ..., w6 of every star."""
    first, fourth = stars.principal.unbind(1)
    w2, w3, w5, w6 = stars.cospherical.unbind(1)
    return torch.stack([stars.vertices, first, w2, w3, fourth, w5, w6], dim=1)


def between_stars(edges: Tensor, stars: PrincipalStars) -> Tensor:
    """Those of ``edges`` (n, 2) both of whose ends are stars."""
    return edges[torch.isin(edges, stars.vertices).all(1)]


def star_numbers(vertices: Tensor, stars: PrincipalStars) -> Tensor:
    """Which star each of ``vertices`` (...) is.

    Raises:
        ShapeError: a vertex is no star.
    """
    numbers = torch.searchsorted(stars.vertices, vertices.contiguous())
    if vertices.numel() and not bool(torch.isin(vertices, stars.vertices).all()):
        raise ShapeError("edges", "ends that are stars, see between_stars", "other vertices")
    return numbers
