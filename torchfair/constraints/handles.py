"""Vertices pulled to given places."""

from __future__ import annotations

from torch import Tensor

from ..projection import ElementTerm
from .base import Constraint


def offset(x: Tensor, target: Tensor) -> Tensor:
    """From the target to the vertex ``x`` (1, 3)."""
    return x[0] - target


def handle_terms(
    vertices: Tensor, targets: Tensor, *, weight: float, block: str = "vertices", name: str = "handles"
) -> list[ElementTerm]:
    """Pulls ``vertices`` (n,) to ``targets`` (n, 3); ``name`` is that in the residual table.

    The weight multiplies half the squared distance.
    """
    if not vertices.numel():
        return []
    return [ElementTerm(name, offset, [(block, vertices[:, None])], data=(targets,), weight=weight, linear=True)]


class Handles(Constraint):
    """Module form of :func:`handle_terms`: half the sum of the squared distances, in length squared.

    Args:
        vertices: (n,) numbers.
        targets: (n, 3) places. In the state as ``parts.0.target``; gradients flow to them if they require them.

    Example:
        >>> import torch
        >>> from torchfair.constraints import Handles
        >>> from torchfair.shapes import Catenoid, principal_quads
        >>> mesh = principal_quads(Catenoid(), 8, 16)
        >>> constraint = Handles(torch.tensor([5]), mesh.vertices[[5]] + torch.tensor([0.0, 0.0, 0.2]))
        >>> constraint(mesh.vertices)
        tensor(0.0200, dtype=torch.float64)
    """

    def __init__(self, vertices: Tensor, targets: Tensor) -> None:
        super().__init__(handle_terms(vertices, targets, weight=1.0))
