"""Cholesky factors of Gram matrices that rounding has made indefinite."""

from __future__ import annotations

import torch
from helpers import DOUBLE

from torchfair.geometry._cholesky_root import cholesky_root


def test_factors_are_those_of_the_matrices() -> None:
    rows = torch.randn(7, 5, 9, generator=torch.Generator().manual_seed(0), dtype=DOUBLE)
    matrix = rows @ rows.mT
    assert cholesky_root(matrix).equal(torch.linalg.cholesky(matrix))
    assert torch.allclose(torch.vmap(cholesky_root)(matrix), torch.linalg.cholesky(matrix), rtol=1e-13, atol=0)


def test_indefinite_ones_have_finite_factors_and_others_keep_theirs() -> None:
    good = torch.tensor([[4.0, 2.0, 0.0], [2.0, 3.0, 0.0], [0.0, 0.0, 1.0]], dtype=DOUBLE)
    flat = torch.ones(3, 3, dtype=DOUBLE) - 1e-15 * torch.eye(3, dtype=DOUBLE)  # of rank one, but for rounding
    root = cholesky_root(torch.stack([good, flat]))
    assert root[0].equal(torch.linalg.cholesky(good))
    assert torch.allclose(root @ root.mT, torch.stack([good, flat]), atol=1e-9)
    assert torch.linalg.cholesky_ex(flat).info > 0
    matrix = torch.stack([good, flat]).requires_grad_()
    cholesky_root(matrix)[0].sum().backward()
    assert matrix.grad is not None
    assert matrix.grad.isfinite().all()
