"""Fixed sparse index maps: built once, applied every iteration."""

from __future__ import annotations

import warnings

import numpy as np
import scipy.sparse as sp
import torch
from torch import Tensor


def csr_matrix(offsets: Tensor, columns: Tensor, values: Tensor, shape: tuple[int, int]) -> Tensor:
    """A torch CSR matrix with 32-bit indices (the width that MKL takes without a copy)."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="Sparse CSR tensor support", category=UserWarning)
        return torch.sparse_csr_tensor(
            offsets.to(torch.int32), columns.to(torch.int32), values, size=shape, check_invariants=False
        )


def group(index: Tensor, size: int) -> tuple[Tensor, Tensor]:
    """Positions of equal ``index`` in 0..size-1 side by side: 32-bit offsets (size+1,) and order, stable."""
    if index.is_cpu and index.shape[0] <= torch.iinfo(torch.int32).max:
        return _counted(index.numpy(), size)
    order = torch.argsort(index.to(torch.int32), stable=True)
    counts = torch.bincount(index, minlength=size)
    offsets = torch.zeros(size + 1, dtype=torch.int64, device=index.device)
    torch.cumsum(counts, 0, out=offsets[1:])
    return offsets.to(torch.int32), order.to(torch.int32)


def _counted(index: np.ndarray, size: int) -> tuple[Tensor, Tensor]:
    """The same by counting, in linear time: the one row of a sparse matrix, turned into columns."""
    count = index.shape[0]
    row = (np.arange(count, dtype=np.int32), index.astype(np.int32, copy=False), np.array([0, count], np.int32))
    columns = sp.csr_matrix(row, (1, size)).tocsc()
    return torch.from_numpy(columns.indptr), torch.from_numpy(columns.data)


def scatter_matrix(index: Tensor, size: int, dtype: torch.dtype, weights: Tensor | None = None) -> Tensor:
    """CSR matrix ``S`` with ``(S @ x)[i] = sum of weights[p] x[p] over all p with index[p] = i``.

    A fixed matrix product sums repeated indices several times faster than ``index_add`` does, and always in
    the same order.
    """
    offsets, order = group(index, size)
    values = torch.ones(index.shape[0], dtype=dtype, device=index.device) if weights is None else weights[order]
    return csr_matrix(offsets, order, values, (size, index.shape[0]))
