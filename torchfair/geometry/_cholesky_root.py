"""Cholesky factors of matrices that are positive definite but for rounding."""

from __future__ import annotations

import torch
from torch import Tensor

from .._tracing import is_recorded, is_transformed

_MORE = 1e-10  # of the diagonal, where rounding leaves no factor


def cholesky_root(matrix: Tensor) -> Tensor:
    """Lower factors (..., p, p) of Gram matrices; where there is none, that of the matrix with a little more diagonal.

    Patches whose members have next to no weight but for a few, as in heavy noise, leave matrices that rounding makes
    indefinite on one processor and not on another. Their factors would have numbers that are not finite.
    """
    root, failed = torch.linalg.cholesky_ex(matrix)
    if not (is_recorded() or is_transformed()) and not bool((failed > 0).any()):
        return root  # type: ignore[no-any-return]
    more = _MORE * (failed > 0).to(matrix)[..., None] * matrix.detach().diagonal(dim1=-2, dim2=-1)
    return torch.linalg.cholesky_ex(matrix + torch.diag_embed(more)).L  # type: ignore[no-any-return]
