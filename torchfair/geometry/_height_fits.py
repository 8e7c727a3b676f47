"""Polynomial heights over tangent planes, fitted to patches of a surface."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from ._ops import dot, gather
from .patches import Patches
from .tangent_basis import tangent_bases

_RIDGE = 1e-13  # keeps what the members leave open at zero, higher orders first
_NEARNESS = 2.0  # how fast weights fall with the square of the distance
_POOLING = 2  # times over patches
_ROUNDING = 1e-12  # of mean squares
_LEAST_FREEDOM = 0.5
_MOST_DOUBT = 1e4  # most that the noise of a coefficient may exceed the coefficient expected


class Heights(NamedTuple):
    """Heights ``z(x, y)`` of the surface over a plane at every vertex, in units of the patch.

    Attributes:
        frames: (*batch, V, 3, 3), two tangent vectors and the normal of the plane.
        scale: (*batch, V) root mean square distance of the members, the unit of x, y and z.
        coefficients: (*batch, V, p) of ``1, x, y, x^2, x y, y^2, ...``.
        covariance: (*batch, V, p, p) of the coefficients, as far as what is left over is noise.
    """

    frames: Tensor
    scale: Tensor
    coefficients: Tensor
    covariance: Tensor


def _terms(degree: int) -> list[tuple[int, int]]:
    """Order of each term ``x^(order - k) y^k`` of a polynomial, and k."""
    return [(order, k) for order in range(degree + 1) for k in range(order + 1)]


def _shares(degree: int) -> list[float]:
    """What each squared coefficient counts in a sum that does not depend on the directions of x and y.

    One over the binomial coefficient (Bombieri's norm of the terms of one order).
    """
    return [1.0 / math.comb(order, k) for order, k in _terms(degree)]


def fitted_heights(vertices: Tensor, normals: Tensor, patches: Patches, degree: int) -> Heights:
    """Polynomials of least squares over the planes orthogonal to ``normals`` (*batch, V, 3), in double precision.

    Near members count more than far ones. Those whose normals turn away count less, by the square of the cosine, and
    not at all beyond 90 degrees, where a height says nothing.

    Terms above the second order are believed as far as they stand out of the noise: their coefficients are taken to
    be spread about zero as widely as they are found to be in the patches around, less what noise alone makes of them
    (empirical Bayes). Without noise that is the plain fit; in noise it is a quadratic one, with as much of a slope of
    the curvatures as can be told.
    """
    frames = torch.cat([tangent_bases(normals), normals[..., None, :]], dim=-2).double()
    moments = _moments(vertices, normals, frames, patches, degree)
    ridge = [_RIDGE * 100.0**order * share for (order, _), share in zip(_terms(degree), _shares(degree), strict=True)]
    least = torch.diag(moments.matrix.new_tensor(ridge))
    matrix = moments.matrix + least
    inverse = torch.linalg.inv_ex(matrix).inverse
    coefficients = (inverse @ moments.right[..., None]).squeeze(-1)
    variance = _variance(moments, coefficients, inverse)
    noisy = moments.twice_weighted + least  # noise enters the right side with the weights, so their squares are here
    if degree > 2:
        spread = (inverse @ noisy * inverse).sum(-1) / moments.weight[..., None]
        variance, doubts = _prior(coefficients, spread, variance, degree, patches)
        doubts = torch.diag_embed(doubts / moments.weight[..., None])
        inverse, noisy = torch.linalg.inv_ex(matrix + doubts).inverse, noisy + doubts
        coefficients = (inverse @ moments.right[..., None]).squeeze(-1)
    covariance = inverse @ noisy @ inverse * (variance / moments.weight)[..., None, None]
    return Heights(frames, moments.scale, coefficients, covariance)


class _Moments(NamedTuple):
    """Weighted means of products over the members: matrix (*batch, V, p, p), right side (*batch, V, p), and more."""

    matrix: Tensor
    twice_weighted: Tensor  # the same with squared weights
    right: Tensor
    square: Tensor  # of the heights (*batch, V)
    weight: Tensor  # sum (*batch, V)
    scale: Tensor


def _moments(vertices: Tensor, normals: Tensor, frames: Tensor, patches: Patches, degree: int) -> _Moments:
    size = len(_terms(degree)) + 1
    parts = []
    for centres, members, present in patches.groups:
        apart = (gather(vertices, members) - gather(vertices, centres)[..., None, :]).double()
        facing = dot(gather(normals, members), gather(normals, centres)[..., None, :]).double()
        weights = facing.clamp_min(0.0).square() * present
        distance = dot(apart, apart)
        weights = weights * torch.exp(-_NEARNESS * distance / _mean(distance, weights))
        total = weights.sum(-1, keepdim=True)
        total = torch.where(total > 0.0, total, 1.0)
        scale = _mean(distance, weights).sqrt()
        local = (apart / scale[..., None]) @ frames.index_select(-3, centres).mT
        x, y, z = local.unbind(-1)
        rows = torch.stack([*_monomials(x, y, degree), z], dim=-1)
        weighted = rows * (weights / total)[..., None]
        products, squares = weighted.mT @ rows, weighted.mT @ (rows * weights[..., None])
        parts.append(torch.cat([products.flatten(-2), squares.flatten(-2), total, scale], dim=-1))
    whole = patches.in_order(parts)
    products, squares = whole[..., :-2].reshape((*whole.shape[:-1], 2, size, size)).unbind(-3)
    return _Moments(
        products[..., :-1, :-1], squares[..., :-1, :-1], products[..., :-1, -1], products[..., -1, -1],
        whole[..., -2], whole[..., -1],
    )  # fmt: skip


def _mean(values: Tensor, weights: Tensor) -> Tensor:
    """Weighted mean along the last dimension, kept; 1 where it is zero."""
    total = weights.sum(-1, keepdim=True)
    mean = (values * weights).sum(-1, keepdim=True) / torch.where(total > 0.0, total, 1.0)
    return torch.where(mean > 0.0, mean, 1.0)


def _monomials(x: Tensor, y: Tensor, degree: int) -> list[Tensor]:
    rows = last = [torch.ones_like(x)]
    for _ in range(degree):
        last = [*(x * term for term in last), y * last[-1]]
        rows = rows + last
    return rows


def _variance(moments: _Moments, coefficients: Tensor, inverse: Tensor) -> Tensor:
    """Mean square of what the polynomials leave, (*batch, V), for as many degrees of freedom as there are."""
    explained = (coefficients * (2.0 * moments.right - (moments.matrix @ coefficients[..., None]).squeeze(-1))).sum(-1)
    left = moments.square - explained
    left = torch.where(left > _ROUNDING * moments.square, left, 0.0) * moments.weight
    freedom = moments.weight - (inverse * moments.twice_weighted).sum((-2, -1))
    return left / freedom.clamp_min(_LEAST_FREEDOM)


def _prior(
    coefficients: Tensor, spread: Tensor, variance: Tensor, degree: int, patches: Patches
) -> tuple[Tensor, Tensor]:
    """Variance of the noise (*batch, V), pooled, and its ratio to that of each coefficient (*batch, V, p).

    Args:
        coefficients: (*batch, V, p) of the plain fit.
        spread: (*batch, V, p) their variance per variance of the noise.
        variance: (*batch, V) of the noise, by the remainders of the plain fit.
        degree: of the polynomials, 3 or more.
        patches: over which all is pooled, vertices with certain coefficients first.
    """
    high, terms = range(3, degree + 1), zip(_terms(degree), _shares(degree), strict=True)
    masks = spread.new_tensor([[share * (order == k) for k in high] for (order, _), share in terms])
    noise = spread @ masks  # per unit of variance, (*batch, V, orders)
    found = coefficients.square() @ masks
    pooled = torch.cat([variance[..., None], found / noise, 1.0 / noise], dim=-1)
    for _ in range(_POOLING):
        pooled = patches.means(pooled)
    variance, found, certain = pooled[..., :1], pooled[..., 1 : 1 + len(high)], pooled[..., 1 + len(high) :]
    count = spread.new_tensor([order + 1.0 for order in high])
    signal = torch.maximum(found - variance, variance / _MOST_DOUBT) / certain / count
    ratio = torch.where(signal > 0.0, variance / torch.where(signal > 0.0, signal, 1.0), 0.0)
    return variance.squeeze(-1), ratio @ masks.T
