"""Products of Jacobian entries, summed over all elements into fixed places."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from ..linear.sparse import scatter_matrix


class ProductSum:
    """Sums the products ``J_p J_q`` of all elements into places, for chosen pairs of local unknowns.

    Args:
        firsts: For every term, for each local unknown p, the first q; the pairs are ``q = firsts[p], ..., p``.
        places: For every term, the place of each product, ``(pairs, n)``, pairs in the order above.
        factors: For every term, factors ``(pairs, n)``, or None for ones.
        size: Number of places.
        like: A tensor of the dtype and device of the Jacobians.
    """

    def __init__(
        self,
        firsts: Sequence[Sequence[int]],
        places: Sequence[Tensor],
        factors: Sequence[Tensor | None],
        size: int,
        like: Tensor,
    ) -> None:
        self._firsts = firsts
        self._shapes = [place.shape for place in places]
        index = torch.cat([place.reshape(-1) for place in places]).to(like.device)
        weights = None
        if any(factor is not None for factor in factors):
            parts = [torch.ones(s) if f is None else f for s, f in zip(self._shapes, factors, strict=True)]
            weights = torch.cat([part.reshape(-1).to(like) for part in parts])
        self._matrix = scatter_matrix(index, size, like.dtype, weights)
        # Kept between calls: at this size, fresh memory costs more than the arithmetic.
        self._products = like.new_empty(index.shape[0])

    @property
    def length(self) -> int:
        """Number of products."""
        return self._matrix.shape[1]

    def __call__(self, jacobians: Sequence[Tensor], count: int = 1) -> Tensor:
        """(size,) sums for element Jacobians ``(m, K, n)``.

        For ``count`` members with equal elements, Jacobians ``(m, K, n * count)``, the members of an element one after
        the other: sums (size, count).
        """
        if self._products.shape[0] < self.length * count:
            self._products = self._products.new_empty(self.length * count)
        start = 0
        for firsts, shape, jacobian in zip(self._firsts, self._shapes, jacobians, strict=True):
            stop = start + shape.numel() * count
            products = self._products[start:stop].view(shape[0], shape[1] * count)
            start = stop
            row = 0
            for p, first in enumerate(firsts):
                out = products[row : row + p + 1 - first]
                torch.mul(jacobian[0, p], jacobian[0, first : p + 1], out=out)
                for component in jacobian[1:]:
                    out.addcmul_(component[p], component[first : p + 1])
                row += p + 1 - first
        products = self._products[:start]
        total: Tensor = self._matrix @ (products if count == 1 else products.view(-1, count))
        return total
