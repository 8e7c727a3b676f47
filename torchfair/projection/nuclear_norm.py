"""The loss of matrices: a smoothed sum of absolute eigenvalues, treated by iterative reweighting."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from ..errors import ShapeError
from .loss import Rounded

_TWICE = math.sqrt(2.0)  # factor of components beside the diagonal, which stand for two entries


@dataclass(frozen=True)
class SmoothNuclearNorm(Rounded):
    r"""Smoothed nuclear norm ``sum_i sqrt(k_i^2 + epsilon^2) - epsilon`` of a symmetric 3x3 matrix.

    The residual of an element is the matrix ``W`` as its six :func:`symmetric_components`; ``k_i`` are its
    eigenvalues. The quadratic model ``tr(W (W_prev^2 + epsilon^2)^(-1/2) W) / 2`` lies above it and touches it
    at ``W_prev`` (the trace of the square root is concave), so eigenvectors need not be differentiated:
    the paper's weight iteration (section 5.3) for matrices.

    Attributes:
        epsilon: Above 0, in the unit of the matrix.

    Raises:
        SettingsError: epsilon is not a finite number above 0.
    """

    def value(self, residuals: Tensor) -> Tensor:
        """Smoothed nuclear norms (n,), evaluated without cancellation; ShapeError unless residuals are ``(n, 6)``."""
        if residuals.shape[1:] != (6,):
            raise ShapeError("residuals of SmoothNuclearNorm", "(n, 6) symmetric_components", tuple(residuals.shape))
        squared = torch.linalg.eigvalsh(symmetric_matrix(residuals)).square()
        value: Tensor = (squared / (torch.sqrt(squared + self.epsilon**2) + self.epsilon)).sum(1)
        return value

    def root(self, residuals: Tensor) -> Tensor:
        """Roots (n, 6, 6): components in the eigenvectors, weighted by the mean of two inverse eigenvalues."""
        values, vectors = torch.linalg.eigh(symmetric_matrix(residuals))
        inverse = torch.rsqrt(values.square() + self.epsilon**2)
        i, j, _ = _pairs(residuals)
        weights = torch.sqrt(0.5 * (inverse[:, i] + inverse[:, j]))
        return weights[:, :, None] * _turned_basis(vectors)


def symmetric_components(matrix: Tensor) -> Tensor:
    """Six components (..., 6) of the symmetric part of matrices (..., 3, 3): the same norm, an isometry."""
    both = 0.5 * (matrix + matrix.transpose(-1, -2))
    beside = [_TWICE * both[..., i, j] for i, j in ((1, 2), (0, 2), (0, 1))]
    return torch.stack([both[..., 0, 0], both[..., 1, 1], both[..., 2, 2], *beside], dim=-1)


def symmetric_matrix(components: Tensor) -> Tensor:
    """Matrices (..., 3, 3) with the given :func:`symmetric_components`; differentiable."""
    a, b, c = components[..., :3].unbind(-1)
    d, e, f = (components[..., 3:] / _TWICE).unbind(-1)
    return torch.stack([a, f, e, f, b, d, e, d, c], dim=-1).reshape(*components.shape[:-1], 3, 3)


def _pairs(like: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """Rows and columns (6,) of the components, and their factors; made where they are used, without a copy."""
    number = torch.arange(6, device=like.device)
    diagonal = number < 3
    rows = torch.where(diagonal, number, (number == 3).long())
    columns = torch.where(diagonal, number, 2 - (number == 5).long())
    return rows, columns, torch.where(diagonal, like.new_ones(()), _TWICE)


def _turned_basis(vectors: Tensor) -> Tensor:
    """(n, 6, 6) maps from components of W to those of ``U^T W U``, for U (n, 3, 3).

    Component ``ij`` of the latter is ``sum_ab U_ai W_ab U_bj``, over a and b.
    """
    i, j, factors = _pairs(vectors)
    rows = vectors.flatten(1).T.contiguous()  # elements last: operations on long rows are faster

    def entries(a: Tensor, i: Tensor) -> Tensor:
        return rows.index_select(0, (3 * a + i[:, None]).flatten())

    both = entries(i, i) * entries(j, j) + entries(j, i) * entries(i, j)
    # Diagonal entries W_aa appear once in the sum, but twice in ``both``.
    shares = factors[:, None] / torch.where(i == j, 2.0 * factors, factors)
    return (both * shares.flatten()[:, None]).T.reshape(-1, 6, 6)
