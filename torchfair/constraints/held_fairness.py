"""Fairness held to a shape: umbrella vectors near those of given vertices, so that what is bent there stays so."""

from __future__ import annotations

from torch import Tensor

from ..geometry import second_differences, umbrella_vectors, vertex_normals
from ..geometry._ops import sums_around
from ..polylines import straight_triples
from ..projection import ElementTerm
from ..projection.term import Residual
from ..topology import Topology
from .base import Constraint
from .fairness_residuals import difference_offset, umbrella_offset
from .star_stencils import closed_star_stencils

_ROUNDS = 3  # of averaging over neighbours


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


def _offset_term(
    name: str, residual: Residual, stencil: Tensor, target: Tensor, weight: float, block: str
) -> ElementTerm:
    return ElementTerm(name, residual, [(block, stencil)], data=(target,), weight=weight, linear=True)


def _even_umbrellas(vertices: Tensor, topology: Topology) -> Tensor:
    """(V, 3) normal parts of umbrella vectors, averaged over interior neighbours and the vertex, three times."""
    normals = vertex_normals(vertices, topology)
    umbrellas = umbrella_vectors(vertices, topology)
    even = (umbrellas * normals).sum(1, keepdim=True) * normals
    inner = (~topology.is_boundary_vertex)[:, None].to(even.dtype)
    count = sums_around(inner, topology.edges)
    for _ in range(_ROUNDS):
        even = sums_around(even * inner, topology.edges) / count.clamp_min(1.0)
    return even


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
