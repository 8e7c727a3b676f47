"""Vertices pulled to given places."""

from __future__ import annotations

from torch import Tensor

from ..projection import ElementTerm


def offset(x: Tensor, target: Tensor) -> Tensor:
    """From the target to the vertex ``x`` (1, 3)."""
    return x[0] - target


def handle_terms(
    vertices: Tensor, targets: Tensor, *, weight: float, block: str = "vertices", name: str = "handles"
) -> list[ElementTerm]:
    """Pulls ``vertices`` (n,) to ``targets`` (n, 3); ``name`` is that in the residual table."""
    if not vertices.numel():
        return []
    return [ElementTerm(name, offset, [(block, vertices[:, None])], data=(targets,), weight=weight, linear=True)]
