"""Rows of the least squares that heights over tangent planes are fitted by: weighted terms at members of patches."""

from __future__ import annotations

import math
from typing import NamedTuple

import torch
from torch import Tensor

from ._ops import gather
from .patches import PatchGroup

NUMBERS_OF_MEMBER = 4
"""Of which :class:`Members` consists: the root of its weight, and three for its place."""


def terms(degree: int) -> list[tuple[int, int]]:
    """Order of each term ``x^(order - k) y^k`` of a polynomial, and k; high orders first.

    So rows of an inverse for the low orders follow from the last rows of an inverse Cholesky factor alone.
    """
    return [(order, k) for order in range(degree, -1, -1) for k in range(order, -1, -1)]


def shares(degree: int) -> list[float]:
    """What each squared coefficient counts in a sum that does not depend on the directions of x and y.

    One over the binomial coefficient (Bombieri's norm of the terms of one order).
    """
    return [1.0 / math.comb(order, k) for order, k in terms(degree)]


class Members(NamedTuple):
    """Members of a group of patches as seen from the centres, in double precision.

    Attributes:
        roots: (*batch, n, m) square roots of the weights.
        places: (*batch, n, 3, m) their x, y and z.
        scale: (*batch, n) root mean square distance of the members, the unit of x, y and z.
    """

    roots: Tensor
    places: Tensor
    scale: Tensor

    @property
    def total(self) -> Tensor:
        """(*batch, n) sum of the weights, 1 where it is zero."""
        return _total(self.roots.square()).squeeze(-1)

    def rows(self, degree: int) -> Tensor:
        """(*batch, n, p + 1, m): terms at the members and heights last, times roots of weights that add up to one."""
        x, y, z = self.places.unbind(-2)
        # Weights are shared out among both factors of every product, which are then sums of products of rows.
        root = self.roots / self.total.sqrt()[..., None]
        return torch.stack([*reversed(_monomials(root, x, y, degree)), root * z], dim=-2)


def members_of(vertices: Tensor, normals: Tensor, frames: Tensor, group: PatchGroup, *, facing: float = 1.0) -> Members:
    """Members of a group over the planes of ``frames`` (*batch, V, 3, 3), two tangents and the normal.

    Near members count more than far ones, by a Gaussian of the distance. Those whose ``normals`` (*batch, V, 3) turn
    away count less, by the power ``2 facing`` of the cosine, not at all beyond 90 degrees.
    """
    centres, members, present = group
    apart = (gather(vertices, members) - gather(vertices, centres)[..., None, :]).double()
    cosines = (gather(normals, members) @ gather(normals, centres)[..., None]).squeeze(-1).double().clamp_min(0.0)
    roots = (cosines if facing == 1.0 else cosines**facing) * present
    places = frames.index_select(-3, centres) @ apart.mT
    x, y, z = places.unbind(-2)
    distance = x * x + y * y + z * z
    roots = roots * torch.exp(-distance / _mean(distance, roots.square()))
    scale = _mean(distance, roots.square()).sqrt()
    return Members(roots, places / scale[..., None], scale.squeeze(-1))


def _total(weights: Tensor) -> Tensor:
    """Sum along the last dimension, kept; 1 where it is zero."""
    total = weights.sum(-1, keepdim=True)
    return torch.where(total > 0.0, total, 1.0)


def _mean(values: Tensor, weights: Tensor) -> Tensor:
    """Weighted mean along the last dimension, kept; 1 where it is zero."""
    mean = (values * weights).sum(-1, keepdim=True) / _total(weights)
    return torch.where(mean > 0.0, mean, 1.0)


def _monomials(one: Tensor, x: Tensor, y: Tensor, degree: int) -> list[Tensor]:
    """All terms times ``one``, low orders first."""
    rows = last = [one]
    for _ in range(degree):
        last = [*(x * term for term in last), y * last[-1]]
        rows = rows + last
    return rows
