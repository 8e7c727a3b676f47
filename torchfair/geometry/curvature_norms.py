"""Norms of symmetric 2x2 matrices without their eigenvectors."""

from __future__ import annotations

import torch
from torch import Tensor

from ._ops import norm


def nuclear_norms(matrices: Tensor) -> Tensor:
    """``|k1| + |k2|`` of symmetric matrices ``[[a, b], [b, d]]``: ``max(|a + d|, sqrt((a - d)^2 + 4 b^2))``.

    The eigenvalues are ``(a + d)/2`` plus and minus half the root. Their absolute values add up to the sum if the
    signs are equal and to the difference if not, and the larger one of the two it always is.

    Args:
        matrices: (..., 2, 2), of which the lower left entry is not read.

    Returns:
        (...) >= 0, homogeneous of degree 1. Convex, with kinks where an eigenvalue is zero: the derivative
        there is a subgradient, half of either side's, and zero for the zero matrix. Smooth at umbilics
        (a = d, b = 0) that are not flat.

    Example:
        >>> import torch
        >>> from torchfair.geometry import nuclear_norms
        >>> nuclear_norms(torch.diag(torch.tensor([3.0, -4.0, 0.0])))
        tensor(7.)
    """
    a, b, d = _entries(matrices)
    return torch.maximum((a + d).abs(), norm(torch.stack([a - d, 2 * b], dim=-1)))


def frobenius_norms(matrices: Tensor) -> Tensor:
    """``sqrt(k1^2 + k2^2)`` of symmetric matrices ``[[a, b], [b, d]]``.

    Args:
        matrices: (..., 2, 2), of which the lower left entry is not read.

    Returns:
        (...) >= 0, homogeneous of degree 1. Smooth but for the zero matrix, where all derivatives are 0 (a
        subgradient).

    Example:
        >>> import torch
        >>> from torchfair.geometry import frobenius_norms
        >>> frobenius_norms(torch.diag(torch.tensor([3.0, -4.0, 0.0])))
        tensor(5.)
    """
    a, b, d = _entries(matrices)
    return norm(torch.stack([a, 2**0.5 * b, d], dim=-1))


def eigenvalues(matrices: Tensor) -> Tensor:
    """Eigenvalues (..., 2) of symmetric 2x2 matrices, the larger first.

    Where they agree, the derivative of either is that of their mean.
    """
    a, b, d = _entries(matrices)
    mean, radius = (a + d) / 2, norm(torch.stack([(a - d) / 2, b], dim=-1))
    return torch.stack([mean + radius, mean - radius], dim=-1)


def _entries(matrices: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    return matrices[..., 0, 0], matrices[..., 0, 1], matrices[..., 1, 1]
