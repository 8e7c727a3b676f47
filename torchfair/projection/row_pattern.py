"""The whole Jacobian and its transpose as sparse matrices with fixed patterns."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import torch
from torch import Tensor

from ..linear.sparse import csr_matrix, group
from .affine import AffinePart


class RowPattern:
    """Rows of ``J``: component by component, element by element, term by term; then the linear terms.

    Args:
        unknowns: Of the elements of each term that is not linear, (K, n).
        outputs: Number of components of each.
        affine: The linear terms.
        like: A tensor of the dtype and device of the blocks, with one entry for each unknown.
    """

    def __init__(
        self, unknowns: Iterable[Tensor], outputs: Sequence[int], affine: AffinePart | None, like: Tensor
    ) -> None:
        lengths, columns = [like.new_zeros(1, dtype=torch.int64)], [like.new_zeros(0, dtype=torch.int32)]
        for own, m in zip(unknowns, outputs, strict=True):
            k, n = own.shape
            lengths.append(torch.full((m * n,), k, device=like.device))
            columns.append(own.to(torch.int32).T.expand(m, -1, -1).reshape(-1))
        self._constant = like.new_zeros(0)
        if affine is not None:
            lengths.append(torch.from_numpy(affine.jacobian.indptr).diff().to(like.device))
            columns.append(torch.from_numpy(affine.jacobian.indices).to(like.device))
            self._constant = torch.from_numpy(affine.jacobian.data).to(like)
        self._columns = torch.cat(columns).to(torch.int32)
        del columns
        self._offsets = torch.cat(lengths).cumsum(0, dtype=torch.int32)
        del lengths
        self._shape = (self._offsets.shape[0] - 1, like.shape[0])
        self._transposed_offsets, self._order = group(self._columns, like.shape[0])
        rows = torch.repeat_interleave(
            torch.arange(self._shape[0], device=like.device, dtype=torch.int32), self._offsets.diff()
        )
        self._transposed_columns = rows.index_select(0, self._order)

    def matrices(self, jacobians: Sequence[Tensor]) -> tuple[Tensor, Tensor]:
        """``J`` and its transpose in CSR form for element Jacobians ``(m, K, n)``."""
        values = self._constant.new_empty(self._columns.shape[0])
        start = 0
        for jacobian in jacobians:
            m, k, n = jacobian.shape
            values[start : start + jacobian.numel()].view(m, n, k).copy_(jacobian.permute(0, 2, 1))
            start += jacobian.numel()
        values[start:] = self._constant
        turned = values.index_select(0, self._order)
        return (
            csr_matrix(self._offsets, self._columns, values, self._shape),
            csr_matrix(self._transposed_offsets, self._transposed_columns, turned, self._shape[::-1]),
        )
