"""Three bars that want to have length 1, as the problem in which mistakes are made."""

from __future__ import annotations

import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair.projection import ElementTerm, ProjectionResult, guided_projection

VERTICES = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 2, 0], [3, 1, 1]], dtype=DOUBLE)
EDGES = torch.tensor([[0, 1], [1, 2], [2, 3]])
LENGTHS = torch.ones(3, dtype=DOUBLE)


def stretched(x: Tensor, length: Tensor) -> Tensor:
    return torch.linalg.vector_norm(x[1] - x[0]) - length


def all_stretched(x: Tensor, lengths: Tensor) -> Tensor:
    return torch.linalg.vector_norm(x[:, 1] - x[:, 0], dim=1) - lengths


def derivative(x: Tensor, length: Tensor) -> Tensor:
    unit = (x[1] - x[0]) / torch.linalg.vector_norm(x[1] - x[0])
    return torch.cat([-unit, unit])


def all_derivatives(x: Tensor, lengths: Tensor) -> Tensor:
    return torch.func.vmap(derivative)(x, lengths)


def term(**options: object) -> ElementTerm:
    """Edges want to have length 1; with mistakes in its parts."""
    right = {"name": "bars", "residual": stretched, "stencil": [("vertices", EDGES)], "data": (LENGTHS,)}
    return ElementTerm(**{**right, **options})


def solved(*terms: ElementTerm, **options: object) -> ProjectionResult:
    return guided_projection({"vertices": VERTICES}, terms, **options)
