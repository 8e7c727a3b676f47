"""The target C = integral of |k1| + |k2| as element terms: one shape operator for each vertex star."""

from __future__ import annotations

import math

import torch
from torch import Tensor
from torch.linalg import cross, vector_norm

from ..projection import ElementTerm
from ..projection.nuclear_norm import SmoothNuclearNorm
from ..topology import Topology
from .star_stencils import closed_star_stencils, open_star_stencils

NAME = "absolute curvature"
_ROOT = math.sqrt(2.0)


def absolute_curvature_terms(
    topology: Topology, *, smoothing: float, weight: float = 1.0, block: str = "vertices"
) -> list[ElementTerm]:
    r"""Smoothed nuclear norms of the shape operators of all vertex stars of a triangle mesh.

    The operator of a star is the paper's ``W'_v = 1/2 sum_e (n_f x n_f') (w - v)^T`` (section 5.3), a function
    of the vertex and its ring. Its third eigenvalue, which is near zero on smooth surfaces, is counted too:
    so the sum is at least C and punishes sharp corners. Open stars at the boundary have the edges they have.

    Args:
        topology: Triangle mesh.
        smoothing: Curvature times area below which a star is treated as flat, in the unit of the vertices.
        weight: Of C; in the unit of the vertices.
        block: Name of the vertex block.

    Raises:
        MeshError: a face is not a triangle.
    """
    topology.require_triangles()
    loss = SmoothNuclearNorm(smoothing)
    terms = []
    for stencil in closed_star_stencils(topology):
        star = [(block, stencil)]
        terms.append(ElementTerm(NAME, closed_star, star, weight=weight, loss=loss, jacobian=closed_star_derivative))
    bent = torch.nonzero(topology.is_boundary_vertex & (topology.valences > 2)).squeeze(1)  # with an interior edge
    for _, stencil in open_star_stencils(topology, bent):
        star = [(block, stencil)]
        terms.append(ElementTerm(NAME, open_star, star, weight=weight, loss=loss, jacobian=open_star_derivative))
    return terms


def closed_star(x: Tensor) -> Tensor:
    """Six components of the shape operator of an interior star: ``x[0]`` is the vertex, ``x[1:]`` its ring.

    The two faces at a spoke d, between the spokes ``before`` and ``after``, contribute ``g d d^T``, where
    ``g = sin(a) / (2 |d|) = det(after, before, d) / (2 |before x d| |d x after|)``.
    """
    spokes = x[1:] - x[0]
    return _bends(spokes.roll(1, 0), spokes, spokes.roll(-1, 0)) @ _squares(spokes)


def open_star(x: Tensor) -> Tensor:
    """As :func:`closed_star` for a boundary vertex, whose ring runs from one boundary edge to the other."""
    spokes = x[1:] - x[0]
    return _bends(spokes[:-2], spokes[1:-1], spokes[2:]) @ _squares(spokes[1:-1])


def closed_star_derivative(x: Tensor) -> Tensor:
    """Jacobian (6, 3 + 3k) of :func:`closed_star`."""
    spokes = x[1:] - x[0]
    behind, here, ahead = _spoke_derivatives(spokes.roll(1, 0), spokes, spokes.roll(-1, 0))
    return _columns(here + ahead.roll(1, 0) + behind.roll(-1, 0))


def open_star_derivative(x: Tensor) -> Tensor:
    """Jacobian (6, 3 + 3k) of :func:`open_star`."""
    spokes = x[1:] - x[0]
    behind, here, ahead = _spoke_derivatives(spokes[:-2], spokes[1:-1], spokes[2:])
    none = torch.zeros_like(here[:1])
    return _columns(torch.cat([behind, none, none]) + torch.cat([none, here, none]) + torch.cat([none, none, ahead]))


def _bends(before: Tensor, spokes: Tensor, after: Tensor) -> Tensor:
    """(n,) factors ``g`` of the spokes."""
    right, left = cross(before, spokes), cross(spokes, after)
    bends: Tensor = -0.5 * (after * right).sum(-1) / (vector_norm(right, dim=-1) * vector_norm(left, dim=-1))
    return bends


def _squares(spokes: Tensor) -> Tensor:
    """(n, 6) components of ``d d^T``."""
    x, y, z = spokes.unbind(-1)
    return torch.stack([x * x, y * y, z * z, _ROOT * y * z, _ROOT * x * z, _ROOT * x * y], dim=-1)


def _spoke_derivatives(before: Tensor, spokes: Tensor, after: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Derivatives (n, 6, 3) of ``g d d^T`` by the spoke before, the spoke itself and the spoke after."""
    right, left = cross(before, spokes), cross(spokes, after)
    right_squared, left_squared = (right * right).sum(-1, keepdim=True), (left * left).sum(-1, keepdim=True)
    scale = -0.5 * torch.rsqrt(right_squared * left_squared)
    bend = scale * (after * right).sum(-1, keepdim=True)
    # Derivatives of the sizes of the two faces, over these sizes.
    by_before = scale * left - bend * cross(spokes, right) / right_squared
    by_after = scale * right - bend * cross(left, spokes) / left_squared
    sizes = cross(right, before) / right_squared + cross(after, left) / left_squared
    by_spoke = scale * cross(after, before) - bend * sizes
    squares = _squares(spokes)[:, :, None]
    own = squares * by_spoke[:, None, :] + bend[:, :, None] * _square_derivatives(spokes)
    return squares * by_before[:, None, :], own, squares * by_after[:, None, :]


def _square_derivatives(spokes: Tensor) -> Tensor:
    """(n, 6, 3) derivatives of :func:`_squares`."""
    x, y, z = spokes.unbind(-1)
    none = torch.zeros_like(x)
    rows = [
        *(2.0 * x, none, none),
        *(none, 2.0 * y, none),
        *(none, none, 2.0 * z),
        *(none, _ROOT * z, _ROOT * y),
        *(_ROOT * z, none, _ROOT * x),
        *(_ROOT * y, _ROOT * x, none),
    ]
    return torch.stack(rows, dim=-1).reshape(*x.shape, 6, 3)


def _columns(by_spokes: Tensor) -> Tensor:
    """(6, 3 + 3k) from derivatives (k, 6, 3) by the spokes; the vertex moves all of them."""
    return torch.cat([-by_spokes.sum(0, keepdim=True), by_spokes]).movedim(1, 0).reshape(6, -1)
