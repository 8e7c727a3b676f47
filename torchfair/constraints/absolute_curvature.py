"""The target C = integral of |k1| + |k2| as element terms: one shape operator for each vertex star."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from ..projection import ElementTerm
from ..projection.nuclear_norm import SmoothNuclearNorm
from ..projection.term import Residual
from ..topology import Topology
from .base import Constraint
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
        weight: Of C, which counts once; in the unit of the vertices.
        block: Name of the vertex block.

    Raises:
        MeshError: a face is not a triangle.
    """
    topology.require_triangles()
    loss = SmoothNuclearNorm(smoothing)
    terms = []
    for stencil in closed_star_stencils(topology):
        terms.append(_term(closed_star, closed_star_derivative, (block, stencil), weight, loss))
    bent = torch.nonzero(topology.is_boundary_vertex & (topology.valences > 2)).squeeze(1)  # with an interior edge
    for _, stencil in open_star_stencils(topology, bent):
        terms.append(_term(open_star, open_star_derivative, (block, stencil), weight, loss))
    return terms


class SmoothAbsoluteCurvature(Constraint):
    """Module form of :func:`absolute_curvature_terms`: smoothed nuclear norms of shape operators, a length.

    Unchanged by rigid motions. As ``smoothing`` goes to 0 it tends to a sum over stars that is at least C, see there;
    :class:`~torchfair.energies.TotalAbsoluteCurvature` is C itself.

    Args:
        topology: Triangle mesh.
        smoothing: Curvature times area below which a star is treated as flat, above 0.

    Raises:
        MeshError: a face is not a triangle.

    Example:
        >>> import torch
        >>> from torchfair.constraints import SmoothAbsoluteCurvature
        >>> from torchfair.shapes import Catenoid, principal_triangles
        >>> mesh = principal_triangles(Catenoid(), 8, 16)
        >>> constraint = SmoothAbsoluteCurvature(mesh.topology, smoothing=0.01)
        >>> constraint(mesh.vertices)
        tensor(20.2399, dtype=torch.float64)
    """

    def __init__(self, topology: Topology, *, smoothing: float) -> None:
        super().__init__(absolute_curvature_terms(topology, smoothing=smoothing))


def _term(
    star: Residual, derivative: Residual, stencil: tuple[str, Tensor], weight: float, loss: SmoothNuclearNorm
) -> ElementTerm:
    return ElementTerm(NAME, star, [stencil], weight=weight, loss=loss, jacobian=derivative, batched=True)


def closed_star(x: Tensor) -> Tensor:
    """Six components (n, 6) of the shape operators of interior stars (n, 1 + k, 3), each a vertex and its ring.

    The two faces at a spoke d, between the spokes ``before`` and ``after``, contribute ``g d d^T``, where
    ``g = sin(a) / (2 |d|) = det(after, before, d) / (2 |before x d| |d x after|)``. One star (1 + k, 3) gives (6,).
    """
    spokes = _spokes(x)
    after = spokes.roll(-1, 1)
    left = _cross(spokes, after)
    right = left.roll(1, 1)
    return _operator(spokes, after, right, left)


def open_star(x: Tensor) -> Tensor:
    """As :func:`closed_star` for boundary vertices, whose rings run from one boundary edge to the other."""
    spokes = _spokes(x)
    sides = _cross(spokes[:, :-1], spokes[:, 1:])
    return _operator(spokes[:, 1:-1], spokes[:, 2:], sides[:, :-1], sides[:, 1:])


def closed_star_derivative(x: Tensor) -> Tensor:
    """Jacobians (n, 6, 3 + 3k) of :func:`closed_star`."""
    spokes = _spokes(x)
    before, after = spokes.roll(1, 1), spokes.roll(-1, 1)
    left = _cross(spokes, after)
    bend = _Bend.of(before, spokes, after, left.roll(1, 1), left)
    own = _own_derivative(spokes, bend)
    squares = _squares(spokes)[:, :, None]
    own += (squares * bend.by_before).roll(-1, 1)
    own += (squares * bend.by_after).roll(1, 1)
    return _columns(own)


def open_star_derivative(x: Tensor) -> Tensor:
    """Jacobians (n, 6, 3 + 3k) of :func:`open_star`."""
    spokes = _spokes(x)
    sides = _cross(spokes[:, :-1], spokes[:, 1:])
    inner = spokes[:, 1:-1]
    bend = _Bend.of(spokes[:, :-2], inner, spokes[:, 2:], sides[:, :-1], sides[:, 1:])
    squares = _squares(inner)[:, :, None]
    by_spokes = x.new_zeros(6, spokes.shape[1], 3, *spokes.shape[2:])
    by_spokes[:, 1:-1] = _own_derivative(inner, bend)
    by_spokes[:, :-2] += squares * bend.by_before
    by_spokes[:, 2:] += squares * bend.by_after
    return _columns(by_spokes)


# Below, components come first and elements last, (3, k, n): operations on long rows are several times faster.


def _spokes(x: Tensor) -> Tensor:
    """(3, k, n) from the vertices to their rings."""
    corners = x.transpose(0, -1).contiguous()
    return corners[:, 1:] - corners[:, :1]


def _dot(a: Tensor, b: Tensor) -> Tensor:
    return (a * b).sum(0)


def _cross(a: Tensor, b: Tensor) -> Tensor:
    """As ``torch.linalg.cross`` along the first dimension, which is slower there."""
    (ax, ay, az), (bx, by, bz) = a.unbind(0), b.unbind(0)
    return torch.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx])


def _squares(spokes: Tensor) -> Tensor:
    """(6, k, n) components of ``d d^T``."""
    x, y, z = spokes.unbind(0)
    scaled_x, scaled_y, _ = (_ROOT * spokes).unbind(0)
    return torch.stack([x * x, y * y, z * z, scaled_y * z, scaled_x * z, scaled_x * y])


def _operator(spokes: Tensor, after: Tensor, right: Tensor, left: Tensor) -> Tensor:
    """(n, 6) sums of ``g d d^T``; ``right`` and ``left`` are the area vectors of the parallelograms at a spoke."""
    bends = -0.5 * _dot(after, right) * torch.rsqrt(_dot(right, right) * _dot(left, left))
    return (bends * _squares(spokes)).sum(1).transpose(0, -1)


class _Bend(NamedTuple):
    """Factors ``g`` (k, n) of spokes and their derivatives (k, 3, n)."""

    value: Tensor
    by_before: Tensor
    by_spoke: Tensor
    by_after: Tensor

    @classmethod
    def of(cls, before: Tensor, spokes: Tensor, after: Tensor, right: Tensor, left: Tensor) -> _Bend:
        """``right = before x spokes`` and ``left = spokes x after``; double cross products are written out."""
        right_squared, left_squared = _dot(right, right), _dot(left, left)
        scale = -0.5 * torch.rsqrt(right_squared * left_squared)
        value = scale * _dot(after, right)
        over_right, over_left = value / right_squared, value / left_squared
        squared = _dot(spokes, spokes)
        ahead, behind = over_left * _dot(spokes, after), over_right * _dot(spokes, before)
        by_before = scale * left - (over_right * squared) * before + behind * spokes
        by_after = scale * right - (over_left * squared) * after + ahead * spokes
        sizes = over_right * _dot(before, before) + over_left * _dot(after, after)
        by_spoke = scale * _cross(after, before) - sizes * spokes + behind * before + ahead * after
        return cls(value, *(derivative.transpose(0, 1) for derivative in (by_before, by_spoke, by_after)))


def _own_derivative(spokes: Tensor, bend: _Bend) -> Tensor:
    """(6, k, 3, n) derivatives of ``g d d^T`` by the spoke itself."""
    result = _squares(spokes)[:, :, None] * bend.by_spoke
    x, y, z = ((_ROOT * bend.value) * spokes).unbind(0)
    for component, own in enumerate((x, y, z)):
        result[component, :, component] += _ROOT * own
    for component, (i, j), (by_i, by_j) in ((3, (1, 2), (z, y)), (4, (0, 2), (z, x)), (5, (0, 1), (y, x))):
        result[component, :, i] += by_i
        result[component, :, j] += by_j
    return result


def _columns(by_spokes: Tensor) -> Tensor:
    """(n, 6, 3 + 3k) from derivatives (6, k, 3, n) by the spokes; the vertex moves all of them."""
    whole = torch.cat([-by_spokes.sum(1, keepdim=True), by_spokes], dim=1).flatten(1, 2)
    return whole.permute(2, 0, 1) if whole.ndim == 3 else whole
