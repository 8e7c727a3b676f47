"""Sums over the elements of each mesh of several that are joined."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from ._loading import safe_to_load

_WIDTH = 256  # elements that are added up before the sums are


@safe_to_load
class MeshSums(NamedTuple):
    """Adds up elements mesh by mesh, in two rounds: one after another alone, rounding would grow with their number.

    Attributes:
        bins: (N,) the bin that each element is put into first, at most 256 to a bin.
        meshes: (number of bins,) the mesh of each bin.
        num_meshes: n.
    """

    bins: Tensor
    meshes: Tensor
    num_meshes: int

    @classmethod
    def of(cls, meshes: Tensor, num_meshes: int) -> MeshSums:
        """For elements that belong to ``meshes`` (N,), in any order."""
        counts = _add_up(torch.ones_like(meshes), meshes, num_meshes)
        order = torch.argsort(meshes, stable=True)
        rank = torch.empty_like(order)
        rank[order] = torch.arange(order.shape[0], device=order.device) - (counts.cumsum(0) - counts)[meshes[order]]
        bins = (counts + _WIDTH - 1) // _WIDTH
        owners = torch.repeat_interleave(torch.arange(num_meshes, device=meshes.device), bins)
        return cls((bins.cumsum(0) - bins)[meshes] + rank // _WIDTH, owners, num_meshes)

    def sum(self, terms: Tensor) -> Tensor:
        """Terms (*batch, N) to (*batch, n)."""
        partial = _add_up(terms, self.bins, self.meshes.shape[0])
        return _add_up(partial, self.meshes, self.num_meshes)


def _add_up(terms: Tensor, index: Tensor, size: int) -> Tensor:
    total: Tensor = terms.new_zeros((*terms.shape[:-1], size)).index_add(-1, index, terms)
    return total
