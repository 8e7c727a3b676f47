"""Least squares of a map in its whole numbers alone, free values following them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
import torch

from ..fields.frames import Floats, Ints
from ..linear import Factor, LinearSolver, factorise
from .integers import IntegerSplit

_AT_ONCE = 32  # columns that are solved for in one go: these stay near the processor
_SHIFT = 1e-13  # of the largest eigenvalue, or diagonal entry where that is not known: some numbers may change nothing


@dataclass(frozen=True, eq=False)
class WholeOptimum:
    """The least squares ``(y - target)^T metric (y - target)`` of whole numbers y, and the values that follow them.

    Attributes:
        split: values by free ones and whole numbers.
        factor: of the least squares of free values x.
        start: (n,) best x where all of y is zero.
        mixed: (n, k) of x and y; with y the best x is that of ``start`` less the answer to ``mixed @ y``.
        metric, target: (k, k), of eigenvalues up to 1, and (k,).
    """

    split: IntegerSplit
    factor: Factor
    start: Floats
    mixed: sp.csc_matrix
    metric: Floats
    target: Floats

    def parts(self, vector: Floats | Ints) -> Floats:
        """(2N,) real and imaginary parts of copies in turn, with whole numbers (k,)."""
        follow = self.start - solved(self.factor, self.mixed @ vector)
        return np.asarray(self.split.free @ follow + self.split.moves @ vector + self.split.fixed, np.float64)

    def seen_by(self, rows: sp.csr_matrix) -> tuple[Floats, Floats]:
        """What rows (r, 2N) see of the parts: (r, k) by whole numbers, and (r,) where these are zero."""
        answers = solved_columns(self.factor, (rows @ self.split.free).T.tocsc(), self.mixed.T)
        slopes = (rows @ self.split.moves).toarray() - answers.T
        return slopes, np.asarray(rows @ self.parts(np.zeros(len(self.target))), np.float64)


def whole_optimum(rows: sp.csr_matrix, right: Floats, split: IntegerSplit, solver: LinearSolver) -> WholeOptimum:
    """The optimum of ``|rows @ parts - right|^2``.

    Args:
        rows: (4F, 2N) weighted.
        right: (4F,).
        split: of the parts.
        solver: for free values.
    """
    free, whole = (rows @ split.free).tocsc(), (rows @ split.moves).tocsc()
    right = right - rows @ split.fixed
    factor = factorise((free.T @ free).tocsr(), solver=solver)
    start, mixed = solved(factor, free.T @ right), (free.T @ whole).tocsc()
    count = whole.shape[1]
    if not count:
        return WholeOptimum(split, factor, start, mixed, np.zeros((0, 0)), np.zeros(0))
    metric = (whole.T @ whole).toarray() - solved_columns(factor, mixed, mixed.T)
    metric = (metric + metric.T) / 2
    scale = np.linalg.eigvalsh(metric)[-1]
    shifted = metric + _SHIFT * scale * np.eye(count)
    target = np.linalg.lstsq(shifted, whole.T @ right - mixed.T @ start, rcond=None)[0]
    return WholeOptimum(split, factor, start, mixed, metric / scale, target)


def real_optimum(rows: sp.csr_matrix, right: Floats, split: IntegerSplit, solver: LinearSolver) -> Floats:
    """(2N,) parts of the same where whole numbers may be any numbers."""
    slope = (rows @ split.real).tocsc()
    normal = (slope.T @ slope).tocsr()
    shifted = normal + sp.identity(normal.shape[0]) * _SHIFT * normal.diagonal().max()
    best = solved(factorise(shifted.tocsr(), solver=solver), slope.T @ (right - rows @ split.fixed))
    return np.asarray(split.real @ best + split.fixed, np.float64)


def solved(factor: Factor, right: Floats) -> Floats:
    """Solutions (n,) or (n, m) of right-hand sides of that shape."""
    return np.asarray(factor.solve(torch.from_numpy(np.ascontiguousarray(right))).values.numpy())


def solved_columns(factor: Factor, right: sp.csc_matrix, left: sp.csr_matrix) -> Floats:
    """(m, k) dense ``left @ solutions`` for sparse right-hand sides (n, k), without all solutions at once."""
    parts = [
        left @ solved(factor, right[:, first : first + _AT_ONCE].toarray())
        for first in range(0, right.shape[1], _AT_ONCE)
    ]
    return np.hstack(parts) if parts else np.zeros((left.shape[0], 0))
