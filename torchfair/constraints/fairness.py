"""Fairness: vertices stay evenly spread (umbrella vectors, second differences of mesh polylines)."""

from __future__ import annotations

import torch
from torch import Tensor

from ..geometry import second_differences, umbrella_vectors, vertex_normals
from ..geometry._ops import angle_of, cross, dot, norm, unit
from ..polylines import straight_triples
from ..projection import ElementTerm
from ..projection.term import Residual
from ..topology import Topology
from .base import Constraint
from .star_stencils import closed_star_stencils

_ROUNDS = 3  # of averaging over neighbours


def umbrella(x: Tensor) -> Tensor:
    """Mean of the neighbours ``x[1:]`` minus the vertex ``x[0]`` (Kobbelt et al. 1998)."""
    return x[1:].mean(0) - x[0]


def tangential_umbrella(x: Tensor) -> Tensor:
    """:func:`umbrella` without its part along the normal of the star."""
    vector, normal = umbrella(x), star_normal(x)
    return vector - dot(vector, normal) * normal


def star_normal(x: Tensor) -> Tensor:
    """Unit normal of a star ``x`` (1 + k, 3): that of its sectors, weighted by their angles; zero if it has none.

    The vertex normal of a triangle mesh, and of polygons that are planar around the vertex.
    """
    spokes = x[1:] - x[0]
    after = spokes.roll(-1, 0)
    sides = cross(spokes, after)
    sizes = norm(sides)
    weights = angle_of(sizes, dot(spokes, after)) / torch.where(sizes > 0, sizes, 1.0)
    return unit((weights[:, None] * sides).sum(0))


def second_difference(x: Tensor) -> Tensor:
    """Half the second difference ``(x[0] - 2 x[1] + x[2]) / 2``: an umbrella of two neighbours."""
    return 0.5 * (x[0] + x[2]) - x[1]


def interior_fairness_terms(topology: Topology, *, weight: float, block: str = "vertices") -> list[ElementTerm]:
    """Second differences at interior vertices between four quads, umbrella vectors at the others.

    The weight multiplies an eighth of ``|v_- - 2 v + v_+|^2``, half the square of an umbrella of two neighbours, and
    half the squared umbrella vectors.
    """
    in_grid = _between_quads(topology)
    triples = straight_triples(topology)
    triples = triples[in_grid[triples[:, 1]]]
    terms = []
    if triples.numel():
        terms.append(ElementTerm("fairness", second_difference, [(block, triples)], weight=weight, linear=True))
    for stencil in closed_star_stencils(topology):
        chosen = stencil[~in_grid[stencil[:, 0]]]
        if chosen.numel():
            terms.append(ElementTerm("fairness", umbrella, [(block, chosen)], weight=weight, linear=True))
    return terms


def polyline_fairness_terms(
    topology: Topology, *, weight: float, corners: Tensor | None = None, block: str = "vertices"
) -> list[ElementTerm]:
    """Second differences along all mesh polylines, the paper's fairness of section 5.1; on triangle meshes, too.

    Polylines run straight through vertices of even valence and along the boundary, see
    :func:`~torchfair.straight_triples`; vertices of odd valence have none.

    Args:
        topology: Any polygon mesh.
        weight: Of an eighth of ``|v_- - 2 v + v_+|^2``.
        corners: (V,) bool, boundary vertices at which the boundary turns.
        block: Name of the vertex block.
    """
    triples = straight_triples(topology, corners=corners)
    if not triples.numel():
        return []
    return [ElementTerm("fairness", second_difference, [(block, triples)], weight=weight, linear=True)]


def boundary_fairness_terms(
    topology: Topology, corners: Tensor, *, weight: float, block: str = "vertices"
) -> list[ElementTerm]:
    """Second differences along the boundary, except at ``corners`` (V,) bool: keeps gliding vertices apart.

    The weight multiplies an eighth of ``|v_- - 2 v + v_+|^2``.
    """
    triples = straight_triples(topology, corners=corners)
    triples = triples[topology.is_boundary_vertex[triples[:, 1]]]
    if not triples.numel():
        return []
    return [ElementTerm("boundary fairness", second_difference, [(block, triples)], weight=weight, linear=True)]


def tangential_fairness_terms(topology: Topology, *, weight: float, block: str = "vertices") -> list[ElementTerm]:
    """Umbrella vectors of interior vertices projected to the tangent planes: spreads vertices, bends nothing.

    The tangent plane is that of the vertex normal and follows the star, so that it is differentiated too. The weight
    multiplies half the squares.
    """
    return [
        ElementTerm("tangential fairness", tangential_umbrella, [(block, stencil)], weight=weight)
        for stencil in closed_star_stencils(topology)
    ]


def even_fairness_terms(
    vertices: Tensor, topology: Topology, *, weight: float, block: str = "vertices"
) -> list[ElementTerm]:
    """Umbrella vectors of interior vertices held to the even part of those at ``vertices`` (V, 3).

    The even part is the mean umbrella vector over the neighbourhood, three rings wide, without its tangential
    part. So vertices are spread and stars kept from crumpling, but unlike plain umbrella vectors, which a tube
    makes shorter by shrinking, an evenly bent surface is left in peace. The terms are linear: the even part does
    not follow the state. The weight multiplies half the squares.
    """
    even = _even_umbrellas(vertices, topology)
    return [
        _offset_term("fairness", umbrella_offset, stencil, even[stencil[:, 0]], weight, block)
        for stencil in closed_star_stencils(topology)
    ]


def displacement_fairness_terms(
    base: Tensor, topology: Topology, *, weight: float, block: str = "vertices"
) -> list[ElementTerm]:
    """Umbrella vectors of the displacement from ``base`` (V, 3): a pulled vertex takes its surroundings along.

    At boundary vertices second differences along the boundary stand for umbrella vectors. Zero at ``base`` and
    wherever it is translated to. The weight multiplies half the squared vectors, an eighth of squared differences.
    """
    umbrellas = umbrella_vectors(base, topology)
    terms = [
        _offset_term("fairness", umbrella_offset, stencil, umbrellas[stencil[:, 0]], weight, block)
        for stencil in closed_star_stencils(topology)
    ]
    triples = straight_triples(topology)
    triples = triples[topology.is_boundary_vertex[triples[:, 1]]]
    if triples.numel():
        target = 0.5 * second_differences(base, triples)
        terms.append(_offset_term("boundary fairness", difference_offset, triples, target, weight, block))
    return terms


def difference_offset(x: Tensor, target: Tensor) -> Tensor:
    """:func:`second_difference` minus a given vector."""
    return second_difference(x) - target


def _offset_term(
    name: str, residual: Residual, stencil: Tensor, target: Tensor, weight: float, block: str
) -> ElementTerm:
    return ElementTerm(name, residual, [(block, stencil)], data=(target,), weight=weight, linear=True)


def umbrella_offset(x: Tensor, target: Tensor) -> Tensor:
    """:func:`umbrella` minus a given vector."""
    return umbrella(x) - target


def _even_umbrellas(vertices: Tensor, topology: Topology) -> Tensor:
    """(V, 3) normal parts of umbrella vectors, averaged over interior neighbours and the vertex, three times."""
    normals = vertex_normals(vertices, topology)
    umbrellas = umbrella_vectors(vertices, topology)
    even = (umbrellas * normals).sum(1, keepdim=True) * normals
    inner = (~topology.is_boundary_vertex)[:, None].to(even.dtype)
    v, w = topology.edges.unbind(1)
    count = _around(inner, v, w)
    for _ in range(_ROUNDS):
        even = _around(even * inner, v, w) / count.clamp_min(1.0)
    return even


def _around(values: Tensor, v: Tensor, w: Tensor) -> Tensor:
    """Sum of the values (V, d) of every vertex and its neighbours."""
    return values.index_add(0, v, values[w]).index_add(0, w, values[v])


def _between_quads(topology: Topology) -> Tensor:
    """(V,) whether a vertex is interior, of valence 4 and has only quads around it."""
    quads_at = torch.zeros(topology.num_vertices, dtype=torch.int64, device=topology.device)
    is_quad = (topology.face_sizes[topology.corner_faces] == 4).to(torch.int64)
    quads_at.index_add_(0, topology.corners, is_quad)
    return (quads_at == 4) & (topology.valences == 4) & ~topology.is_boundary_vertex


class InteriorFairness(Constraint):
    """Module form of :func:`interior_fairness_terms`: half the sum of squared vectors, in length squared.

    Args:
        topology: Any polygon mesh.

    Example:
        >>> import torch
        >>> from torchfair.constraints import InteriorFairness
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> constraint = InteriorFairness(mesh.topology)
        >>> constraint(mesh.vertices)
        tensor(0.4895, dtype=torch.float64)
    """

    def __init__(self, topology: Topology) -> None:
        super().__init__(interior_fairness_terms(topology, weight=1.0))


class StraightFairness(Constraint):
    """Module form of :func:`polyline_fairness_terms`: an eighth of the sum of squared second differences.

    In length squared; an eighth of :class:`~torchfair.energies.PolylineFairness` where both have the same corners.

    Args:
        topology: Any polygon mesh.
        corners: (V,) bool, where the boundary may turn.

    Example:
        >>> import torch
        >>> from torchfair.constraints import StraightFairness
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> constraint = StraightFairness(mesh.topology)
        >>> constraint(mesh.vertices)
        tensor(0.7102, dtype=torch.float64)
    """

    def __init__(self, topology: Topology, corners: Tensor | None = None) -> None:
        super().__init__(polyline_fairness_terms(topology, weight=1.0, corners=corners))


class BoundaryFairness(Constraint):
    """Module form of :func:`boundary_fairness_terms`: half the sum of squared vectors, in length squared.

    Args:
        topology: Any polygon mesh.
        corners: (V,) bool, where the boundary may turn.

    Example:
        >>> import torch
        >>> from torchfair.constraints import BoundaryFairness
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> constraint = BoundaryFairness(mesh.topology, torch.tensor([], dtype=torch.int64))
        >>> constraint(mesh.vertices)
        tensor(0.2207, dtype=torch.float64)
    """

    def __init__(self, topology: Topology, corners: Tensor) -> None:
        super().__init__(boundary_fairness_terms(topology, corners, weight=1.0))


class TangentialFairness(Constraint):
    """Module form of :func:`tangential_fairness_terms`: half the sum of squared vectors, in length squared.

    Args:
        topology: Any polygon mesh.

    Example:
        >>> import torch
        >>> from torchfair.constraints import TangentialFairness
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> constraint = TangentialFairness(mesh.topology)
        >>> constraint(mesh.vertices)
        tensor(0.0082, dtype=torch.float64)
    """

    def __init__(self, topology: Topology) -> None:
        super().__init__(tangential_fairness_terms(topology, weight=1.0))


class EvenFairness(Constraint):
    """Module form of :func:`even_fairness_terms`: half the sum of squared vectors, in length squared.

    Args:
        vertices: (V, 3) whose even umbrella vectors are the targets, constant.
        topology: Any polygon mesh.

    Example:
        >>> import torch
        >>> from torchfair.constraints import EvenFairness
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> moved = mesh.vertices + 0.01 * torch.sin(40 * mesh.vertices)
        >>> constraint = EvenFairness(mesh.vertices, mesh.topology)
        >>> constraint(moved)
        tensor(0.0196, dtype=torch.float64)
    """

    def __init__(self, vertices: Tensor, topology: Topology) -> None:
        super().__init__(even_fairness_terms(vertices.detach(), topology, weight=1.0))


class DisplacementFairness(Constraint):
    """Module form of :func:`displacement_fairness_terms`: half the sum of squared vectors, in length squared.

    Args:
        base: (V, 3) what displacements are from, constant.
        topology: Any polygon mesh.

    Example:
        >>> import torch
        >>> from torchfair.constraints import DisplacementFairness
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> moved = mesh.vertices + 0.01 * torch.sin(40 * mesh.vertices)
        >>> constraint = DisplacementFairness(mesh.vertices, mesh.topology)
        >>> constraint(moved)
        tensor(0.0158, dtype=torch.float64)
    """

    def __init__(self, base: Tensor, topology: Topology) -> None:
        super().__init__(displacement_fairness_terms(base.detach(), topology, weight=1.0))
