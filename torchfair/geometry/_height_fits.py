"""Polynomial heights over tangent planes, fitted to patches of a surface."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from ._ops import dot, gather
from .patches import Patches, PatchGroup
from .tangent_basis import tangent_bases

_RIDGE = 1e-13  # keeps what the members leave open at zero, higher orders first
_NEARNESS = 2.0  # how fast weights fall with the square of the distance
_POOLING = 2  # times over patches
_ROUNDING = 1e-12  # of mean squares
_LEAST_FREEDOM = 0.5
_NEEDED = 6  # terms up to the second order
_KEPT = 1 << 25  # numbers, a quarter of a gigabyte
_MOST_DOUBT = 1e4  # most that the noise of a coefficient may exceed the coefficient expected


class Heights(NamedTuple):
    """Heights ``z(x, y)`` of the surface over a plane at every vertex, in units of the patch.

    Attributes:
        frames: (*batch, V, 3, 3), two tangent vectors and the normal of the plane.
        scale: (*batch, V) root mean square distance of the members, the unit of x, y and z.
        coefficients: (*batch, V, p) of ``1, x, y, x^2, x y, y^2, ...``.
        covariance: (*batch, V, 6, 6) of the coefficients up to the second order, as far as what is left over is noise.
    """

    frames: Tensor
    scale: Tensor
    coefficients: Tensor
    covariance: Tensor


def _terms(degree: int) -> list[tuple[int, int]]:
    """Order of each term ``x^(order - k) y^k`` of a polynomial, and k."""
    return [(order, k) for order in range(degree + 1) for k in range(order + 1)]


def _products(count: int) -> list[int]:
    """Number of the product of every two of so many terms among those of twice the degree, row by row."""
    terms = _terms(count)[:count]
    return [(a + b) * (a + b + 1) // 2 + j + k for a, j in terms for b, k in terms]


def _shares(degree: int) -> list[float]:
    """What each squared coefficient counts in a sum that does not depend on the directions of x and y.

    One over the binomial coefficient (Bombieri's norm of the terms of one order).
    """
    return [1.0 / math.comb(order, k) for order, k in _terms(degree)]


def fitted_normals(vertices: Tensor, normals: Tensor, patches: Patches) -> Tensor:
    """Unit normals (*batch, V, 3), in double precision, of quadratics over the planes orthogonal to ``normals``.

    Members count as in :func:`fitted_heights`. Zero where ``normals`` (*batch, V, 3) are.
    """
    frames, least = _frames(normals), _least(2, normals.device)
    slopes = []
    for group in patches.groups:
        weights, _, rows = _members(vertices, normals, frames, group, 2)
        shares = weights / _total(weights)
        terms, right, _ = _parted((rows @ shares[..., None]).squeeze(-1), 2)
        matrix = _of_pairs(terms, right.shape[-1]) + least
        slopes.append(torch.linalg.solve_ex(matrix, right).result[..., 1:3])
    return turned_normals(frames, patches.in_order(slopes))


def turned_normals(frames: Tensor, slopes: Tensor) -> Tensor:
    """Unit normals (..., 3) of planes with ``slopes`` (..., 2) over the tangents of ``frames`` (..., 3, 3)."""
    first, second, normal = frames.unbind(-2)
    stretch = (1.0 + slopes.square().sum(-1, keepdim=True)).sqrt()
    return (normal - slopes[..., :1] * first - slopes[..., 1:] * second) / stretch


def _frames(normals: Tensor) -> Tensor:
    """(*batch, V, 3, 3) two tangents and the normal."""
    return torch.cat([tangent_bases(normals), normals[..., None, :]], dim=-2).double()


def _least(degree: int, device: torch.device) -> Tensor:
    """(p, p) what is added to matrices, so that what the members leave open is zero."""
    shares = zip(_terms(degree), _shares(degree), strict=True)
    ridge = [_RIDGE * 100.0**order * share for (order, _), share in shares]
    return torch.diag(torch.tensor(ridge, dtype=torch.float64, device=device))


def fitted_heights(vertices: Tensor, normals: Tensor, patches: Patches, degree: int) -> Heights:
    """Polynomials of least squares over the planes orthogonal to ``normals`` (*batch, V, 3), in double precision.

    Near members count more than far ones. Those whose normals turn away count less, by the square of the cosine, and
    not at all beyond 90 degrees, where a height says nothing.

    Terms above the second order are believed as far as they stand out of the noise: their coefficients are taken to
    be spread about zero as widely as they are found to be in the patches around, less what noise alone makes of them
    (empirical Bayes). Without noise that is the plain fit; in noise it is a quadratic one, with as much of a slope of
    the curvatures as can be told. ``degree`` is 3 or more.
    """
    frames, least = _frames(normals), _least(degree, normals.device)
    # Matrices of all vertices would take kilobytes for each, so they are made for one group of patches at a time, and
    # made again where they are needed once more: of what they are made of, as far as that was kept.
    kept: dict[int, _Moments] = {}
    fits, room = [], _KEPT
    for number, group in enumerate(patches.groups):
        moments = _moments(vertices, normals, frames, group, degree)
        fits.append(_plain_fit(moments, least))
        room -= sum(part.numel() for part in moments)
        if room >= 0:
            kept[number] = moments
    coefficients, spread, variance = (patches.in_order([fit[i] for fit in fits]) for i in range(3))
    scale = patches.in_order([fit.scale for fit in fits]).squeeze(-1)
    fits.clear()
    variance, doubts = _prior(coefficients, spread, variance.squeeze(-1), degree, patches)
    believed = []
    for number, group in enumerate(patches.groups):
        found = kept.pop(number, None)
        moments = _moments(vertices, normals, frames, group, degree) if found is None else found
        own = gather(doubts, group.centres), gather(variance[..., None], group.centres).squeeze(-1)
        believed.append(_believed_fit(moments, least, *own))
    coefficients = patches.in_order([fit[0] for fit in believed])
    covariance = patches.in_order([fit[1] for fit in believed])
    return Heights(frames, scale, coefficients, covariance.view(*scale.shape, _NEEDED, _NEEDED))


class _Fit(NamedTuple):
    """What the plain fit of a group tells, (*batch, n, ...)."""

    coefficients: Tensor
    spread: Tensor  # variances of the coefficients per variance of the noise
    variance: Tensor  # of the noise
    scale: Tensor


def _plain_fit(moments: _Moments, least: Tensor) -> _Fit:
    matrix = moments.matrix
    inverse = torch.linalg.inv_ex(matrix + least).inverse
    coefficients = (inverse @ moments.right[..., None]).squeeze(-1)
    twice_weighted = moments.twice_weighted
    variance = _variance(moments, coefficients, matrix, (inverse * twice_weighted).sum((-2, -1)))
    noisy = twice_weighted + least  # noise enters the right side with the weights, so their squares are here
    spread = (inverse @ noisy * inverse).sum(-1) / moments.weight[..., None]
    return _Fit(coefficients, spread, variance[..., None], moments.scale[..., None])


def _believed_fit(moments: _Moments, least: Tensor, doubts: Tensor, variance: Tensor) -> tuple[Tensor, Tensor]:
    """Coefficients, and flat covariances of those up to the second order, with terms believed as far as they are."""
    ridge = least + torch.diag_embed(doubts / moments.weight[..., None])
    inverse = torch.linalg.inv_ex(moments.matrix + ridge).inverse
    coefficients = (inverse @ moments.right[..., None]).squeeze(-1)
    few = inverse[..., :_NEEDED, :]
    covariance = few @ (moments.twice_weighted + ridge) @ few.mT * (variance / moments.weight)[..., None, None]
    return coefficients, covariance.flatten(-2)


class _Moments(NamedTuple):
    """Weighted means over the members (*batch, n, ...) of products of terms, of heights with terms, and more."""

    terms: Tensor  # of twice the degree
    twice_weighted_terms: Tensor  # the same with squared weights
    right: Tensor
    square: Tensor  # of the heights (*batch, n)
    weight: Tensor  # sum (*batch, n)
    scale: Tensor

    @property
    def matrix(self) -> Tensor:
        """(*batch, n, p, p) of the products of every two terms."""
        return _of_pairs(self.terms, self.right.shape[-1])

    @property
    def twice_weighted(self) -> Tensor:
        """The same with squared weights."""
        return _of_pairs(self.twice_weighted_terms, self.right.shape[-1])


def _of_pairs(terms: Tensor, size: int) -> Tensor:
    pairs = torch.tensor(_products(size), device=terms.device)
    return terms.index_select(-1, pairs).reshape(*terms.shape[:-1], size, size)


def _moments(vertices: Tensor, normals: Tensor, frames: Tensor, group: PatchGroup, degree: int) -> _Moments:
    weights, scale, rows = _members(vertices, normals, frames, group, degree)
    total = _total(weights)
    shares = weights / total
    sums, squared = (rows @ torch.stack([shares, shares * weights], dim=-1)).unbind(-1)
    terms, right, square = _parted(sums, degree)
    return _Moments(
        terms.clone(), squared[..., : terms.shape[-1]].clone(), right.clone(), square.clone(), total.squeeze(-1), scale
    )


def _members(
    vertices: Tensor, normals: Tensor, frames: Tensor, group: PatchGroup, degree: int
) -> tuple[Tensor, Tensor, Tensor]:
    """Weights (*batch, n, m) of the members, scale (*batch, n), and what is summed over them (*batch, n, rows, m).

    Rows are terms of twice the degree, the height times each term, and the height squared.
    """
    centres, members, present = group
    apart = (gather(vertices, members) - gather(vertices, centres)[..., None, :]).double()
    facing = dot(gather(normals, members), gather(normals, centres)[..., None, :]).double()
    weights = facing.clamp_min(0.0).square() * present
    distance = dot(apart, apart)
    weights = weights * torch.exp(-_NEARNESS * distance / _mean(distance, weights))
    scale = _mean(distance, weights).sqrt()
    local = (apart / scale[..., None]) @ frames.index_select(-3, centres).mT
    x, y, z = local.unbind(-1)
    # Products of two terms are terms again, of which there are a fifth as many as pairs.
    terms, own = _monomials(x, y, 2 * degree), len(_terms(degree))
    rows = torch.stack([*terms, *(term * z for term in terms[:own]), z * z], dim=-2)
    return weights, scale.squeeze(-1), rows


def _parted(sums: Tensor, degree: int) -> tuple[Tensor, Tensor, Tensor]:
    """Sums (*batch, n, rows) of terms, of heights with terms, and of squared heights."""
    count = len(_terms(2 * degree))
    return sums[..., :count], sums[..., count:-1], sums[..., -1]


def _total(weights: Tensor) -> Tensor:
    """Sum along the last dimension, kept; 1 where it is zero."""
    total = weights.sum(-1, keepdim=True)
    return torch.where(total > 0.0, total, 1.0)


def _mean(values: Tensor, weights: Tensor) -> Tensor:
    """Weighted mean along the last dimension, kept; 1 where it is zero."""
    mean = (values * weights).sum(-1, keepdim=True) / _total(weights)
    return torch.where(mean > 0.0, mean, 1.0)


def _monomials(x: Tensor, y: Tensor, degree: int) -> list[Tensor]:
    rows = last = [torch.ones_like(x)]
    for _ in range(degree):
        last = [*(x * term for term in last), y * last[-1]]
        rows = rows + last
    return rows


def _variance(moments: _Moments, coefficients: Tensor, matrix: Tensor, used: Tensor) -> Tensor:
    """Mean square of what the polynomials leave, (*batch, V), for as many degrees of freedom as there are."""
    explained = (coefficients * (2.0 * moments.right - (matrix @ coefficients[..., None]).squeeze(-1))).sum(-1)
    left = moments.square - explained
    left = torch.where(left > _ROUNDING * moments.square, left, 0.0) * moments.weight
    freedom = moments.weight - used
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
