"""The target C in the paper's own variables (section 5.3): normals, shape operators, eigenvectors are unknowns."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import torch
from torch import Tensor
from torch.linalg import cross

from ..geometry import face_normals, shape_operators
from ..geometry.star_normals import star_normals
from ..geometry.tangent_basis import tangent_bases
from ..geometry.tangential_shape_operator import restrict
from ..projection import ElementTerm, Loss, SmoothAbsolute, symmetric_components, symmetric_matrix
from ..topology import Topology
from .absolute_curvature import NAME


def lifted_absolute_curvature_blocks(vertices: Tensor, topology: Topology) -> dict[str, Tensor]:
    """Auxiliary variables that fit their constraints at ``vertices``.

    They fit all but (5) and (8) exactly. A shape operator whose third eigenvector is not the sum of the
    normals has no tangential eigenvectors: directions and curvatures are then those of the operator
    restricted to the tangent plane, and what is left over (of third order in the edge lengths on smooth surfaces)
    asks something of the shape.

    Args:
        vertices: (V, 3).
        topology: Triangle mesh whose faces have area.

    Returns:
        ``normals`` (F, 3), ``jumps`` (I, 3) of interior edges, ``operators`` (V, 6) as
        ``symmetric_components``, ``curvatures`` (2V, 1) and ``directions`` (2V, 3), the two of a vertex one
        after the other, the larger curvature first. With the vertices: 3V + 3F + 3I + 14V unknowns.
        Where every tangential direction is an eigenvector (flat stars, umbilics) some pair is taken.

    Raises:
        MeshError: a face is not a triangle.
    """
    topology.require_triangles()
    normals = face_normals(vertices, topology)
    left, right = normals[topology.interior_edge_faces].unbind(1)
    operators = shape_operators(vertices, topology)
    upright = star_normals(vertices, topology)
    # Without a normal (isolated vertices) any plane is as good as another.
    upright = torch.where((upright == 0).all(1, keepdim=True), upright.new_tensor([0.0, 0.0, 1.0]), upright)
    bases = tangent_bases(upright)
    values, vectors = torch.linalg.eigh(restrict(operators, bases))
    return {
        "normals": normals,
        "jumps": cross(left, right),
        "operators": symmetric_components(operators),
        "curvatures": values.flip(1).reshape(-1, 1),
        "directions": (vectors.mT.flip(1) @ bases).reshape(-1, 3),
    }


def orthogonality_residual(x: Tensor, n: Tensor) -> Tensor:
    """(1): ``n . (w - v)`` for the three edges of a face."""
    return (x.roll(-1, 0) - x) @ n[0]


def unit_residual(u: Tensor) -> Tensor:
    """(2): ``|u|^2 - 1``."""
    return torch.dot(u[0], u[0]) - 1.0


def jump_residual(n: Tensor, s: Tensor) -> Tensor:
    """(3): ``s - n x n'`` with the normals left and right of an edge."""
    difference: Tensor = s[0] - cross(n[0], n[1])
    return difference


def operator_residual(x: Tensor, s: Tensor, w: Tensor, sign: Tensor) -> Tensor:
    """(4): ``W - 1/2 sum_e s (w - v)^T``, six components; ``x[0]`` is the vertex, ``x[1:]`` its neighbours.

    The jump of an edge is that seen from its first end; seen from the other end it has the opposite ``sign``.
    """
    spokes = sign[:, None] * (x[1:] - x[0])
    return w[0] - 0.5 * symmetric_components(s.mT @ spokes)


def eigenvector_residual(w: Tensor, k: Tensor, d: Tensor) -> Tensor:
    """(5): ``W d - k d`` for both directions."""
    return (d @ symmetric_matrix(w[0]) - k * d).reshape(-1)


def tangency_residual(d: Tensor, n: Tensor) -> Tensor:
    """(6): ``d . sum n`` for both directions."""
    return d @ n.sum(0)


def angle_residual(d: Tensor) -> Tensor:
    """(7): ``d1 . d2``."""
    return torch.dot(d[0], d[1])


def trace_residual(w: Tensor, k: Tensor) -> Tensor:
    """(8): ``tr W - k1 - k2``."""
    return w[0, :3].sum() - k.sum()


def curvature_residual(k: Tensor) -> Tensor:
    """The curvature itself."""
    return k[0, 0]


def lifted_absolute_curvature_terms(
    topology: Topology,
    *,
    smoothing: float,
    weight: float = 1.0,
    constraint_weight: float = 1e3,
    absolute: Callable[[float], Loss] = SmoothAbsolute,
) -> list[ElementTerm]:
    """Constraints (1) to (8) of the auxiliary variables, and the sum of ``|k1| + |k2|`` over all stars as the target.

    Args:
        topology: Triangle mesh.
        smoothing: Curvature times area below which a star is treated as flat, in the unit of the vertices.
        weight: Of C, which counts once; in the unit of the vertices.
        constraint_weight: Of half the squared constraints, for vertices scaled to edge lengths of about 1. Small
            weights let curvatures become smaller than those of the shape, large ones make steps short: an uneven
            start comes faster to the shape with 100 first and 1000 afterwards.
        absolute: Makes the absolute value from the smoothing; :class:`~torchfair.projection.LogAbsolute` is reweighted
            as the paper prints it.

    Raises:
        MeshError: a face is not a triangle.
    """
    topology.require_triangles()
    numbers = torch.arange(2 * topology.num_vertices, device=topology.device)
    each, pairs = numbers[:, None], numbers.view(-1, 2)
    faces = torch.arange(topology.num_faces, device=topology.device)[:, None]
    edges = torch.arange(topology.num_interior_edges, device=topology.device)[:, None]
    stars = ("operators", torch.arange(topology.num_vertices, device=topology.device)[:, None])
    curvatures, directions = ("curvatures", pairs), ("directions", pairs)
    sides = ("normals", topology.interior_edge_faces)
    constraints = [
        ElementTerm("face normals", orthogonality_residual, [("vertices", topology.triangles), ("normals", faces)]),
        ElementTerm("unit normals", unit_residual, [("normals", faces)]),
        ElementTerm("unit directions", unit_residual, [("directions", each)]),
        ElementTerm("normal jumps", jump_residual, [sides, ("jumps", edges)]),
        *_operator_terms(topology),
        ElementTerm("eigenvectors", eigenvector_residual, [stars, curvatures, directions]),
        *_tangency_terms(topology),
        ElementTerm("orthogonal directions", angle_residual, [directions]),
        ElementTerm("third eigenvalue", trace_residual, [stars, curvatures]),
    ]
    loss = absolute(smoothing)
    target = ElementTerm(NAME, curvature_residual, [("curvatures", each)], weight=weight, loss=loss)
    return [*(replace(term, weight=constraint_weight) for term in constraints if term.num_elements), target]


def _operator_terms(topology: Topology) -> Iterator[ElementTerm]:
    """(4) for all vertices, by number of interior edges, none included."""
    first, second = topology.interior_edges.unbind(1)
    neighbours = torch.cat([second, first])
    edges = torch.arange(first.shape[0], device=topology.device).repeat(2)
    signs = torch.cat([torch.ones_like(first), -torch.ones_like(second)])
    for centres, places in _by_owner(torch.cat([first, second]), topology.num_vertices):
        star = torch.cat([centres[:, None], neighbours[places]], dim=1)
        stencil = [("vertices", star), ("jumps", edges[places]), ("operators", centres[:, None])]
        yield ElementTerm("shape operators", operator_residual, stencil, data=(signs[places],))


def _tangency_terms(topology: Topology) -> Iterator[ElementTerm]:
    """(6) for all vertices with faces, by their number."""
    for centres, places in _by_owner(topology.corners, topology.num_vertices):
        if places.shape[1]:
            pairs = torch.stack([2 * centres, 2 * centres + 1], dim=1)
            stencil = [("directions", pairs), ("normals", topology.corner_faces[places])]
            yield ElementTerm("tangential directions", tangency_residual, stencil)


def _by_owner(owners: Tensor, count: int) -> Iterator[tuple[Tensor, Tensor]]:
    """Owners 0..count-1 with equally many entries in ``owners``, and the places (n, k) of these entries."""
    order = torch.argsort(owners, stable=True)
    sizes = torch.bincount(owners, minlength=count)
    starts = sizes.cumsum(0) - sizes
    for size in torch.unique(sizes).tolist():
        chosen = torch.nonzero(sizes == size).squeeze(1)
        yield chosen, order[starts[chosen, None] + torch.arange(size, device=owners.device)]
