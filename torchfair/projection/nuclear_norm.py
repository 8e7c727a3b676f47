"""The loss of matrices: a smoothed sum of absolute eigenvalues, treated by iterative reweighting."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from .._numbers import check_number
from ..errors import ShapeError


@dataclass(frozen=True)
class SmoothNuclearNorm:
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

    epsilon: float

    def __post_init__(self) -> None:
        check_number("epsilon of SmoothNuclearNorm", self.epsilon, above=True, finite=True)

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
        i, j = _pairs(residuals.device)
        weights = torch.sqrt(0.5 * (inverse[:, i] + inverse[:, j]))
        return weights[:, :, None] * _turned_basis(vectors)


def symmetric_components(matrix: Tensor) -> Tensor:
    """Six components (..., 6) of the symmetric part of matrices (..., 3, 3): the same norm, an isometry."""
    i, j = _pairs(matrix.device)
    both = 0.5 * (matrix + matrix.transpose(-1, -2))
    return both[..., i, j] * _factors(matrix)


def symmetric_matrix(components: Tensor) -> Tensor:
    """Matrices (..., 3, 3) with the given :func:`symmetric_components`; differentiable."""
    scaled = components / _factors(components)
    entries = torch.tensor([0, 5, 4, 5, 1, 3, 4, 3, 2], device=components.device)
    return scaled.index_select(-1, entries).reshape(*components.shape[:-1], 3, 3)


def _pairs(device: torch.device) -> tuple[Tensor, Tensor]:
    return (
        torch.tensor([0, 1, 2, 1, 0, 0], device=device),
        torch.tensor([0, 1, 2, 2, 2, 1], device=device),
    )


def _factors(like: Tensor) -> Tensor:
    half = math.sqrt(2.0)
    return like.new_tensor([1.0, 1.0, 1.0, half, half, half])


def _turned_basis(vectors: Tensor) -> Tensor:
    """(n, 6, 6) maps from components of W to those of ``U^T W U``, for U (n, 3, 3).

    Component ``ij`` of the latter is ``sum_ab U_ai W_ab U_bj``, over a and b.
    """
    i, j = _pairs(vectors.device)
    factors = _factors(vectors)
    rows = vectors.flatten(1).T.contiguous()  # elements last: operations on long rows are faster

    def entries(a: Tensor, i: Tensor) -> Tensor:
        return rows.index_select(0, (3 * a + i[:, None]).flatten())

    both = entries(i, i) * entries(j, j) + entries(j, i) * entries(i, j)
    # Diagonal entries W_aa appear once in the sum, but twice in ``both``.
    shares = factors[:, None] / torch.where(i == j, 2.0 * factors, factors)
    return (both * shares.flatten()[:, None]).T.reshape(-1, 6, 6)
