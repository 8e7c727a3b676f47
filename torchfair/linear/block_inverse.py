"""Inverses of many small matrices."""

from __future__ import annotations

import torch
from torch import Tensor


def block_inverse(blocks: Tensor) -> Tensor:
    """Inverses of symmetric positive definite ``(n, d, d)``; closed form for d = 1 and 3, where LAPACK is slow."""
    size = blocks.shape[-1]
    if size == 1:
        return 1.0 / blocks
    if size == 3:
        a, b, c = blocks.unbind(-2)
        adjugate = torch.stack([torch.linalg.cross(b, c), torch.linalg.cross(c, a), torch.linalg.cross(a, b)], dim=-1)
        return adjugate / (a * adjugate[..., 0]).sum(-1)[..., None, None]
    inverse: Tensor = torch.linalg.inv(blocks)
    return inverse
