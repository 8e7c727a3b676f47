"""Principal-symmetric meshes with the spheres eliminated: vertices are the only unknowns."""

from __future__ import annotations

import torch
from torch import Tensor

from ..geometry._ops import cross, dot
from ..principal.principal_edges import PrincipalStars
from ..principal.sphere_derivatives import sphere_derivatives
from ..principal.spheres import spheres_through
from ..projection import ElementTerm
from .base import Constraint
from .principal_symmetric import COPLANAR, COSPHERICAL, coplanar, star_numbers
from .star_stencils import by_vertices


def eliminated_cospherical(x: Tensor) -> Tensor:
    """By how much the neighbours ``x[:, 1:]`` (n, 4, 3) of vertices ``x[:, 0]`` miss a common sphere."""
    return spheres_through(x[:, 0], x[:, 1:]).misses


def eliminated_cospherical_derivative(x: Tensor) -> Tensor:
    """Jacobians (n, 15) of :func:`eliminated_cospherical`."""
    spokes = x[:, 1:] - x[:, :1]
    sphere = spheres_through(x[:, 0], x[:, 1:])
    first = spokes[:, :1]
    by_normal, by_curvature = sphere_derivatives(spokes, sphere.normals, -2.0 * first)
    by_spokes = by_normal[:, 0] + by_curvature * dot(first, first)[..., None]
    by_spokes[:, 0] += 2.0 * (sphere.curvatures[:, None] * first[:, 0] - sphere.normals)
    return by_vertices(by_spokes)


def eliminated_coplanar(x: Tensor) -> Tensor:
    """:func:`~torchfair.constraints.principal_symmetric.coplanar` at two vertices with four neighbours each."""
    first, second = x[:, :5], x[:, 5:]
    normals = [spheres_through(star[:, 0], star[:, 1:]).normals for star in (first, second)]
    return coplanar(x[:, ::5], torch.stack(normals, dim=1))


def eliminated_coplanar_derivative(x: Tensor) -> Tensor:
    """Jacobians (n, 30) of :func:`eliminated_coplanar`."""
    edge = x[:, 5] - x[:, 0]
    stars = [x[:, :5], x[:, 5:]]
    first, second = (spheres_through(star[:, 0], star[:, 1:]).normals for star in stars)
    parts = []
    for star, normal, by_normal in zip(stars, (first, second), (cross(second, edge), cross(edge, first)), strict=True):
        by_spokes = sphere_derivatives(star[:, 1:] - star[:, :1], normal, by_normal[:, None])[0]
        parts.append(by_vertices(by_spokes[:, 0]))
    by_edge = cross(first, second)
    parts[0][:, :3] -= by_edge
    parts[1][:, :3] += by_edge
    return torch.cat(parts, dim=1)


def eliminated_principal_symmetric_terms(
    edges: Tensor, stars: PrincipalStars, *, weight: float, block: str = "vertices"
) -> list[ElementTerm]:
    """Both conditions of section 2.3 as functions of the vertices.

    One residual for each star and one for each edge, which depend on 5 and on 8 vertices: fewest unknowns, but a
    normal matrix with many more entries than with :func:`~torchfair.constraints.cospherical_terms`. They are
    differentiated by sums, which is faster here than the closed forms that there are, too.

    Args:
        edges: (n, 2) principal edges between stars.
        stars: Regular vertices, among them all ends of edges.
        weight: Of half the squares; dimensionless. A star counts for four neighbours, so twice.
        block: Name of the vertex block.

    Raises:
        ShapeError: an end of an edge is no star.
    """
    return [_cospherical_term(stars, weight, block), _coplanar_term(edges, stars, weight, block)]


def _cospherical_term(stars: PrincipalStars, weight: float, block: str) -> ElementTerm:
    return ElementTerm(
        COSPHERICAL,
        eliminated_cospherical,
        [(block, _reach(stars))],
        weight=4.0 * weight,  # four neighbours miss the sphere alike
        jacobian=eliminated_cospherical_derivative,
        derivatives="sums",  # a third faster than the closed form from some thousand stars on
        batched=True,
    )


def _coplanar_term(edges: Tensor, stars: PrincipalStars, weight: float, block: str) -> ElementTerm:
    ends = _reach(stars)[star_numbers(edges, stars)]
    return ElementTerm(
        COPLANAR,
        eliminated_coplanar,
        [(block, ends.flatten(1))],
        weight=weight,
        jacobian=eliminated_coplanar_derivative,
        derivatives="sums",
        batched=True,
    )


def _reach(stars: PrincipalStars) -> Tensor:
    """(R, 5) vertices that the sphere of a star depends on, the star itself first."""
    return torch.cat([stars.vertices[:, None], stars.cospherical], dim=1)


class Cospherical(Constraint):
    """The four neighbours of every star lie on a sphere that touches it, with the spheres eliminated.

    Twice the sum of the squares by which :func:`~torchfair.principal.star_spheres` are missed (half of the square for
    each of four neighbours), in length squared; unchanged by rigid motions. As in
    :func:`eliminated_principal_symmetric_terms`; :func:`~torchfair.constraints.cospherical_terms` have spheres among
    the unknowns, so they are no module.

    Args:
        stars: Regular vertices.

    Example:
        >>> import torch
        >>> from torchfair.constraints import Cospherical
        >>> from torchfair.principal import principal_edges_of_lattice
        >>> from torchfair.shapes import Catenoid, principal_triangles
        >>> mesh = principal_triangles(Catenoid(), 8, 16)
        >>> edges = principal_edges_of_lattice(mesh)
        >>> stars = edges.stars()
        >>> constraint = Cospherical(stars)
        >>> constraint(mesh.vertices) < 1e-12
        tensor(True)
    """

    def __init__(self, stars: PrincipalStars) -> None:
        super().__init__([_cospherical_term(stars, 1.0, "vertices")])


class Coplanar(Constraint):
    """Normals of spheres at the ends of edges lie in a plane with the edge, with the spheres eliminated.

    Half the sum of squared determinants ``det(n(v), n(w), w - v)``, in length squared; unchanged by rigid motions.
    Strips along polylines of such edges are developable where it is zero.

    Args:
        edges: (n, 2) principal edges between stars.
        stars: Regular vertices, among them all ends of edges.

    Raises:
        ShapeError: an end of an edge is no star.

    Example:
        >>> import torch
        >>> from torchfair.constraints import Coplanar, between_stars
        >>> from torchfair.principal import principal_edges_of_lattice
        >>> from torchfair.shapes import Catenoid, principal_triangles
        >>> mesh = principal_triangles(Catenoid(), 8, 16)
        >>> edges = principal_edges_of_lattice(mesh)
        >>> stars = edges.stars()
        >>> constraint = Coplanar(between_stars(edges.topology.edges[edges.mask], stars), stars)
        >>> constraint(mesh.vertices) < 1e-12
        tensor(True)
    """

    def __init__(self, edges: Tensor, stars: PrincipalStars) -> None:
        super().__init__([_coplanar_term(edges, stars, 1.0, "vertices")])
