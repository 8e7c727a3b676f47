"""Fairness: vertices stay evenly spread (umbrella vectors, second differences of mesh polylines)."""

from __future__ import annotations

import torch
from torch import Tensor

from ..polylines import straight_triples
from ..projection import ElementTerm
from ..topology import Topology
from .base import Constraint
from .fairness_residuals import second_difference, tangential_umbrella, umbrella
from .star_stencils import closed_star_stencils


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
    """Second differences along the boundary, except at ``corners``: keeps gliding vertices apart.

    Corners are (V,) bool or (n,) vertex numbers. The weight multiplies an eighth of ``|v_- - 2 v + v_+|^2``.
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
        corners: (V,) bool or (n,) vertex numbers, where the boundary may turn.

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
    """Module form of :func:`boundary_fairness_terms`: an eighth of the sum of squared differences, in length squared.

    Args:
        topology: Any polygon mesh.
        corners: (V,) bool or (n,) vertex numbers, where the boundary may turn.

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
