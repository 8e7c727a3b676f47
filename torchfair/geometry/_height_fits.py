"""Polynomial heights over tangent planes, fitted to patches of a surface."""

from __future__ import annotations

import itertools
from typing import NamedTuple

import torch
from torch import Tensor

from .._side_by_side import side_by_side
from ._cholesky_root import cholesky_root
from ._height_rows import NUMBERS_OF_MEMBER, Members, members_of, shares, terms
from ._ops import gather
from ._rim_fits import rim_fits
from .patches import Patches, PatchGroup
from .tangent_basis import tangent_bases

_FALL = 1.5  # of doubts with the unit, times the order; 2 if no orders were left out
_RIDGE = 1e-13  # keeps what the members leave open at zero, higher orders first
_POOLING = 2  # times over patches
_ROUNDING = 1e-12  # of mean squares
_LEAST_FREEDOM = 0.5
_NEEDED = 6  # terms up to the second order
_KEPT = 1 << 27  # numbers, a gigabyte
_MOST_DOUBT = 1e4  # most that the noise of a coefficient may exceed the coefficient expected


class Heights(NamedTuple):
    """Heights ``z(x, y)`` of the surface over a plane at every vertex, in units of the patch, to the second order.

    Attributes:
        frames: (*batch, V, 3, 3), two tangent vectors and the normal of the plane.
        scale: (*batch, V) root mean square distance of the members, the unit of x, y and z.
        coefficients: (*batch, V, 6) of ``1, x, y, x^2, x y, y^2``.
        uncertainty: (*batch, V) variance of the coefficient of ``x^2`` less that of ``y^2``, plus variance of the
            coefficient of ``x y``, as far as what is left over is noise.
    """

    frames: Tensor
    scale: Tensor
    coefficients: Tensor
    uncertainty: Tensor


def fitted_normals(vertices: Tensor, normals: Tensor, patches: Patches) -> Tensor:
    """Unit normals (*batch, V, 3), in double precision, of quadratics over the planes orthogonal to ``normals``.

    Members count as in :func:`fitted_heights`. Zero where ``normals`` (*batch, V, 3) are.
    """
    frames, least = _frames(normals), _least(2, normals.device)

    def slopes(group: PatchGroup) -> Tensor:
        matrix, right, _ = _normal_equations(members_of(vertices, normals, frames, group).rows(2))
        low = _low_rows(cholesky_root(matrix + torch.diag(least)))
        return (low @ right).squeeze(-1)[..., 1:3]

    return turned_normals(frames, patches.in_order(side_by_side(slopes, patches.groups, vertices)))


def turned_normals(frames: Tensor, slopes: Tensor) -> Tensor:
    """Unit normals (..., 3) of planes with ``slopes`` (..., 2) over the tangents of ``frames`` (..., 3, 3)."""
    first, second, normal = frames.unbind(-2)
    stretch = (1.0 + slopes.square().sum(-1, keepdim=True)).sqrt()
    return (normal - slopes[..., :1] * first - slopes[..., 1:] * second) / stretch


def _frames(normals: Tensor) -> Tensor:
    """(*batch, V, 3, 3) two tangents and the normal."""
    return torch.cat([tangent_bases(normals), normals[..., None, :]], dim=-2).double()


def _least(degree: int, device: torch.device) -> Tensor:
    """(p,) what is added to the diagonal of matrices, so that what the members leave open is zero."""
    ridge = [_RIDGE * 100.0**order * share for (order, _), share in zip(terms(degree), shares(degree), strict=True)]
    return torch.tensor(ridge, dtype=torch.float64, device=device)


def fitted_heights(vertices: Tensor, normals: Tensor, patches: Patches, degree: int) -> Heights:
    """Polynomials of least squares over the planes orthogonal to ``normals`` (*batch, V, 3), in double precision.

    Near members count more than far ones. Those whose normals turn away count less, by the square of the cosine, and
    not at all beyond 90 degrees, where a height says nothing.

    Terms above the second order are believed as far as they stand out of the noise: their coefficients are taken to
    be spread about zero as widely as they are found to be in the patches around, less what noise alone makes of them
    (empirical Bayes). Without noise that is the plain fit; in noise it is a quadratic one, with as much of a slope of
    the curvatures as can be told. ``degree`` is 3 or more.

    The last fit is over the wide patches near the boundary: of one side alone second derivatives are less certain.
    At the rim that is ``rim_fits``. In the others the noise of a coefficient of order k, over the coefficient, falls
    with the power 2 k of the unit. Orders that are left out count the more; by the power 1.5 k doubts fall less, which
    has been found to be right.
    """
    frames, least = _frames(normals), _least(degree, normals.device)
    # Matrices of all vertices would take kilobytes for each, so they are made for one group of patches at a time, and
    # made again where they are needed once more: of what they are made of, as far as that was kept.
    kept: dict[int, Members] = {}
    last = _last_kept(vertices, patches)

    def plain_fit(number: int) -> _Fit:
        members = members_of(vertices, normals, frames, patches.groups[number])
        if number < last:
            kept[number] = members
        return _plain_fit(members, least, degree)

    fits = side_by_side(plain_fit, range(len(patches.groups)), vertices)
    coefficients, spread, variance = (patches.in_order([fit[i] for fit in fits]) for i in range(3))
    scale = patches.in_order([fit.scale for fit in fits]).squeeze(-1)
    fits.clear()
    noise, variance, doubts = _prior(coefficients, spread, variance.squeeze(-1), scale, degree, patches)
    powers = doubts.new_tensor([_FALL * order for order, _ in terms(degree)[:-_NEEDED]])

    def believed_fit(number: int) -> tuple[Tensor, Tensor, Tensor]:
        group, found = patches.wide[number], kept.pop(number, None)
        members = members_of(vertices, normals, frames, group) if found is None else found
        own, around, before = (gather(x, group.centres) for x in (doubts, variance[..., None], scale[..., None]))
        size = before / members.scale[..., None]  # one, but for wide patches
        own, around = own * size**powers, (around * size.square()).squeeze(-1)
        return *_believed_fit(members, least, own, around, degree), members.scale[..., None]

    believed = side_by_side(believed_fit, range(len(patches.wide) - patches.num_rim_groups), vertices)
    if patches.num_rim_groups:
        believed.append(rim_fits(vertices, normals, frames, noise, patches))
    coefficients, uncertainty = (patches.in_order([fit[i] for fit in believed], wide=True) for i in range(2))
    scale = patches.in_order([fit[2] for fit in believed], wide=True, elsewhere=1.0)
    return Heights(frames, scale.squeeze(-1), coefficients, uncertainty.squeeze(-1))


def _last_kept(vertices: Tensor, patches: Patches) -> int:
    """How many of the first groups have members that may all be kept: of those that are needed once more."""
    shared = (group for group, wide in zip(patches.groups, patches.wide, strict=False) if group is wide)
    sizes = [group.members.numel() * NUMBERS_OF_MEMBER for group in shared]
    room = _KEPT // max(1, vertices.shape[:-2].numel())
    return sum(total <= room for total in itertools.accumulate(sizes))


class _Fit(NamedTuple):
    """What the plain fit of a group tells, (*batch, n, ...)."""

    coefficients: Tensor  # of the terms above the second order
    spread: Tensor  # their variances per variance of the noise
    variance: Tensor  # of the noise
    scale: Tensor


def _plain_fit(members: Members, least: Tensor, degree: int) -> _Fit:
    rows = members.rows(degree)
    at_members, heights = rows[..., :-1, :], rows[..., -1, :]
    matrix, right, square = _normal_equations(rows)
    root = cholesky_root(matrix + torch.diag(least))
    inverse_root = torch.linalg.solve_triangular(root, torch.eye(len(least)).to(root), upper=False)
    inverse = inverse_root.mT @ inverse_root
    coefficients = inverse @ right
    left = (heights - (coefficients.mT @ at_members).squeeze(-2)).square().sum(-1)
    # Each height enters the coefficients by a column of this, and its noise as often as its weight in the mean.
    influence, weights = inverse @ at_members, members.roots.square()
    used = ((influence * at_members).sum(-2) * weights).sum(-1)
    variance = _variance(left, square, members.total, used)
    high = influence[..., :-_NEEDED, :].square() @ weights[..., None]
    high = high.squeeze(-1) + inverse[..., :-_NEEDED, :].square() @ least
    return _Fit(
        coefficients[..., :-_NEEDED, 0], high / members.total[..., None], variance[..., None], members.scale[..., None]
    )


def _believed_fit(
    members: Members, least: Tensor, doubts: Tensor, variance: Tensor, degree: int
) -> tuple[Tensor, Tensor]:
    """Coefficients up to the second order, and (*batch, n, 1) uncertainty, with terms believed as far as they are."""
    rows, total = members.rows(degree), members.total
    at_members, heights = rows[..., :-1, :], rows[..., -1:, :].mT
    matrix, right, _ = _normal_equations(rows)
    ridge = least + torch.nn.functional.pad(doubts / total[..., None], (0, _NEEDED))
    root = cholesky_root(matrix + torch.diag_embed(ridge))
    low = _low_rows(root)
    # Few members leave much to what was added, and equations lose half of the digits: what is left gives them back.
    coefficients = torch.cholesky_solve(right, root)
    left = at_members @ (heights - at_members.mT @ coefficients) - ridge[..., None] * coefficients
    coefficients = coefficients[..., -_NEEDED:, :].flip(-2) + low @ left
    bends = torch.stack([low[..., 3, :] - low[..., 5, :], low[..., 4, :]], dim=-2)
    noise = ((bends @ at_members).square().sum(-2) * members.roots.square()).sum(-1)
    noise = noise + (bends.square().sum(-2) * ridge).sum(-1)
    return coefficients.squeeze(-1), (noise * variance / total)[..., None]


def _normal_equations(rows: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Matrix (..., p, p) of terms with terms, right side (..., p, 1) with heights, and mean square (...) of heights."""
    sums = rows @ rows.mT
    return sums[..., :-1, :-1], sums[..., :-1, -1:], sums[..., -1, -1]


def _low_rows(root: Tensor) -> Tensor:
    """(..., 6, p) rows of the inverse for ``1, x, y, x^2, x y, y^2`` in turn, by the Cholesky factor of the matrix."""
    last = torch.eye(root.shape[-1])[-_NEEDED:].to(root)
    rows = torch.linalg.solve_triangular(root, last, upper=False, left=False)
    low: Tensor = rows[..., -_NEEDED:].flip(-1).mT @ rows
    return low


def _variance(left: Tensor, square: Tensor, total: Tensor, used: Tensor) -> Tensor:
    """Mean square ``left`` by the polynomials, (*batch, V), for as many degrees of freedom as there are."""
    left = torch.where(left > _ROUNDING * square, left, 0.0) * total
    freedom = total - used
    return left / freedom.clamp_min(_LEAST_FREEDOM)


def _prior(
    coefficients: Tensor, spread: Tensor, variance: Tensor, scale: Tensor, degree: int, patches: Patches
) -> tuple[Tensor, Tensor, Tensor]:
    """Variance of the noise, pooled, and its ratio to that of each high coefficient.

    Args:
        coefficients: (*batch, V, p - 6) of the plain fit, of the terms above the second order.
        spread: (*batch, V, p - 6) their variance per variance of the noise.
        variance: (*batch, V) of the noise, by the remainders of the plain fit.
        scale: (*batch, V) unit of all these.
        degree: of the polynomials, 3 or more.
        patches: over which all is pooled, vertices with certain coefficients first.

    Returns:
        (*batch, V) the variance, square of the unit of the vertices; (*batch, V) the same in units of the patches, of
        those around, too; and (*batch, V, p - 6) the ratios.
    """
    high, weighed = range(3, degree + 1), list(zip(terms(degree), shares(degree), strict=True))[:-_NEEDED]
    masks = spread.new_tensor([[share * (order == k) for k in high] for (order, _), share in weighed])
    noise = spread @ masks  # per unit of variance, (*batch, V, orders)
    noise = torch.where(noise > 0.0, noise, 1.0)  # where there is no patch
    found = coefficients.square() @ masks
    absolute = (variance * scale.square())[..., None]
    pooled = torch.cat([absolute, variance[..., None], found / noise, 1.0 / noise], dim=-1)
    for _ in range(_POOLING):
        pooled = patches.means(pooled)
    absolute, variance, found, certain = (
        pooled[..., :1],
        pooled[..., 1:2],
        pooled[..., 2 : 2 + len(high)],
        pooled[..., 2 + len(high) :],
    )
    count = spread.new_tensor([order + 1.0 for order in high])
    signal = torch.maximum(found - variance, variance / _MOST_DOUBT) / certain / count
    ratio = torch.where(signal > 0.0, variance / torch.where(signal > 0.0, signal, 1.0), 0.0)
    return absolute.squeeze(-1), variance.squeeze(-1), ratio @ masks.T
