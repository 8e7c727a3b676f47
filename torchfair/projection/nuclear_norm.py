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

    def twice_differentiable(self) -> TwiceDifferentiableNorm:
        """The same loss where second derivatives are asked for, which those of eigenvalues are no way to."""
        return TwiceDifferentiableNorm(self)


@dataclass(frozen=True)
class TwiceDifferentiableNorm:
    r"""The values of a :class:`SmoothNuclearNorm`, with exact first and second derivatives, also of equal eigenvalues.

    Torch divides by differences of eigenvalues, which vanish for stars with one bent edge. Here, in the eigenvectors of
    a matrix, changes W of it count for ``sum_i f(k_i) + f'(k_i) W_ii + sum_ij f'[k_i, k_j] W_ij^2 / 2``, with divided
    differences of f' (Daleckii and Krein 1965). Third derivatives are not those of the norm.

    Attributes:
        norm: The loss.
    """

    norm: SmoothNuclearNorm

    def value(self, residuals: Tensor) -> Tensor:
        """Smoothed nuclear norms (n,)."""
        matrices, epsilon = symmetric_matrix(residuals), self.norm.epsilon
        values, vectors = torch.linalg.eigh(matrices.detach())
        roots = torch.sqrt(values.square() + epsilon**2)
        change = vectors.mT @ matrices @ vectors - torch.diag_embed(values)
        diagonal: Tensor = torch.diagonal(change, dim1=-2, dim2=-1)
        first = values.square() / (roots + epsilon) + values / roots * diagonal
        norms: Tensor = first.sum(1) + 0.5 * (_divided(values, roots, epsilon) * change.square()).sum((1, 2))
        return norms

    def root(self, residuals: Tensor) -> Tensor:
        """As that of the norm."""
        return self.norm.root(residuals)


def _divided(values: Tensor, roots: Tensor, epsilon: float) -> Tensor:
    """(n, 3, 3) divided differences of ``k / sqrt(k^2 + epsilon^2)`` between eigenvalues, without cancellation."""
    a, b = values[:, :, None], values[:, None, :]
    root_a, root_b = roots[:, :, None], roots[:, None, :]
    between, apart = a * root_b + b * root_a, a - b
    alike = epsilon**2 * (a + b) / (root_a * root_b * torch.where(between != 0.0, between, 1.0))
    alike = torch.where((a == 0.0) & (b == 0.0), epsilon**2 / (root_a * root_b * torch.maximum(root_a, root_b)), alike)
    unlike = (a / root_a - b / root_b) / torch.where(apart != 0.0, apart, 1.0)
    return torch.where(a * b >= 0.0, alike, unlike)


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
