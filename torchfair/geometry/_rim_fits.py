"""Fits over the wide patches along the boundary: polynomials of degree six, their terms believed as far as likely."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from .._side_by_side import side_by_side
from ._cholesky_root import cholesky_root
from ._height_rows import members_of, shares, terms
from ._ops import gather, scatter_sum
from ._principal_frames import principal_frames
from .patches import Patches, PatchGroup

_DEGREE = 6
_LOW = 6  # terms up to the second order, which are taken as they come
_BENDS = [[-1.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 0.0]]  # x^2 less y^2, and x y
_OF_ORDERS, _OF_TERMS = 3, 4  # times that variances are found
_SHARED = 0.1  # of a term for each vertex: as what the variance of the order counts in that of a term
_BEFORE = 1e-3  # the same, the variance before
_LEAST = 1e-13
_FACING = 2.0  # power of the cosine in the root of a weight


class _Equations(NamedTuple):
    """Normal equations of patches, divided by their weights, for terms in the order of ``terms``."""

    matrix: Tensor  # (*batch, n, p, p)
    right: Tensor  # (*batch, n, p)
    noise: Tensor  # (*batch, n) variance of the noise over the weight
    scale: Tensor  # (*batch, n)


class _Solution(NamedTuple):
    """Most probable coefficients, each over the standard deviation that it is thought to have; 1 for low terms."""

    root: Tensor  # (*batch, n, p, p) lower Cholesky factor
    values: Tensor  # (*batch, n, p)


def rim_fits(
    vertices: Tensor, normals: Tensor, frames: Tensor, noise: Tensor, patches: Patches
) -> tuple[Tensor, Tensor, Tensor]:
    """Heights to the second order over planes at the centres of the patches of the rim, one group after the other.

    From one side alone, second derivatives are told from those of higher orders by what is known of these. Each term
    above the second order is taken to be normally distributed about zero, and its variance is that which makes the
    heights most probable over all wide patches of a connected part (empirical Bayes, by the fixed point of MacKay,
    *Bayesian interpolation*, 1992). First the terms of an order have one variance, which does not depend on the
    directions of x and y. Then these are turned to the principal directions that come out, and every term has its own,
    drawn towards that of the order: on surfaces of revolution those vanish that are odd across meridians.

    Members whose normals turn away count less than in narrow patches, as heights over a plane are no polynomials of low
    degree where they are steep.

    Args:
        vertices: (*batch, V, 3).
        normals: (*batch, V, 3) of the planes.
        frames: (*batch, V, 3, 3) two tangents and the normal.
        noise: (*batch, V) variance of the noise of heights, in the unit of the vertices squared.
        patches: of the mesh, with wide patches at the rim.

    Returns:
        Coefficients (*batch, n, 6), uncertainty (*batch, n, 1) and scale (*batch, n, 1), as in ``Heights``.
    """

    def equations(group: PatchGroup) -> _Equations:
        members = members_of(vertices, normals, frames, group, facing=_FACING)
        rows = members.rows(_DEGREE)
        sums = rows @ rows.mT
        own = gather(noise[..., None], group.centres).squeeze(-1) / (members.scale.square() * members.total)
        return _Equations(sums[..., :-1, :-1], sums[..., :-1, -1], own, members.scale)

    groups = patches.wide[len(patches.wide) - patches.num_rim_groups :]
    some = side_by_side(equations, groups, vertices)
    whole = _Equations(*(torch.cat(parts, dim=vertices.ndim - 2) for parts in zip(*some, strict=True)))
    parts = patches.parts.index_select(0, torch.cat([group.centres for group in groups]))
    orders, _ = _orders(whole.right)
    variances = (4.0**-orders / torch.lgamma(orders + 1.0).exp()).expand(*whole.noise.shape, -1)
    for _ in range(_OF_ORDERS):
        variances = _variances(whole, _solved(whole, variances), variances, parts, patches.num_parts, of_terms=False)
    turns = _turns(_solved(whole, variances).values)
    right = (turns @ whole.right[..., None]).squeeze(-1)
    turned = whole._replace(matrix=turns @ whole.matrix @ turns.mT, right=right)
    for _ in range(_OF_TERMS):
        variances = _variances(turned, _solved(turned, variances), variances, parts, patches.num_parts, of_terms=True)
    solution = _solved(turned, variances)
    low = (solution.values[..., None, -_LOW:] @ turns[..., -_LOW:, -_LOW:]).squeeze(-2)
    bends = torch.nn.functional.pad(low.new_tensor(_BENDS), (0, 0, len(orders), 0))
    spread = torch.linalg.solve_triangular(solution.root, bends, upper=False).square().sum((-2, -1))
    return low.flip(-1), (spread * whole.noise)[..., None], whole.scale[..., None]


def _orders(like: Tensor) -> tuple[Tensor, Tensor]:
    """(h,) order of each high term, and variance of its coefficient over that of the order: a binomial coefficient."""
    orders = [float(order) for order, _ in terms(_DEGREE)[:-_LOW]]
    return like.new_tensor(orders), 1.0 / like.new_tensor(shares(_DEGREE)[:-_LOW])


def _solved(equations: _Equations, variances: Tensor) -> _Solution:
    """For variances (*batch, n, h) of high coefficients, over their binomial coefficients."""
    _, binomials = _orders(variances)
    deviations = torch.nn.functional.pad((variances * binomials).sqrt(), (0, _LOW), value=1.0)
    believed = torch.nn.functional.pad(torch.ones_like(binomials), (0, _LOW))
    matrix = equations.matrix * deviations[..., None] * deviations[..., None, :]
    matrix = matrix + torch.diag_embed(equations.noise[..., None] * believed + _LEAST)
    root = cholesky_root(matrix)
    return _Solution(root, torch.cholesky_solve((equations.right * deviations)[..., None], root).squeeze(-1))


def _variances(
    equations: _Equations, solution: _Solution, before: Tensor, parts: Tensor, count: int, *, of_terms: bool
) -> Tensor:
    """(*batch, n, h) mean squares of what was found, over how far heights determine it, in each connected part."""
    inverse = torch.cholesky_inverse(solution.root).diagonal(dim1=-2, dim2=-1)
    determined = (1.0 - equations.noise[..., None] * inverse[..., :-_LOW]).clamp(0.0, 1.0)
    sums = [solution.values[..., :-_LOW].square() * before, determined, before, torch.ones_like(before)]
    squares, determined, before, number = (scatter_sum(x, parts, count) for x in sums)
    orders, _ = _orders(before)
    alike = (orders[:, None] == orders).to(before)
    found = (squares @ alike + _BEFORE * before) / (determined @ alike + _BEFORE * number)
    if of_terms:
        found = (squares + _SHARED * number * found) / (determined + _SHARED * number)
    return found.index_select(-2, parts)


def _turns(values: Tensor) -> Tensor:
    """(*batch, n, p, p) terms along the principal directions of the low ones (*batch, n, p), in terms of x and y."""
    yy, xy, xx = values[..., -_LOW:-3].unbind(-1)
    hessian = torch.stack([torch.stack([2 * xx, xy], dim=-1), torch.stack([xy, 2 * yy], dim=-1)], dim=-2)
    first, second = principal_frames(hessian, torch.eye(2).to(hessian)).unbind(-2)

    def times(line: Tensor, rows: Tensor) -> Tensor:
        by_x, by_y = torch.nn.functional.pad(rows, (0, 1)), torch.nn.functional.pad(rows, (1, 0))
        return line[..., None, :1] * by_x + line[..., None, 1:] * by_y

    block = torch.ones_like(first[..., None, :1])
    rows, size = [], values.shape[-1]
    for order in range(_DEGREE + 1):
        before, after = size - (order + 1) * (order + 2) // 2, order * (order + 1) // 2
        rows.append(torch.nn.functional.pad(block.flip((-2, -1)), (before, after)))
        block = torch.cat([times(first, block), times(second, block[..., -1:, :])], dim=-2)
    return torch.cat(rows[::-1], dim=-2)
