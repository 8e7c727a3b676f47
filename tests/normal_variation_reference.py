"""The plain formula of E, for autograd to differentiate, and its gradient."""

from __future__ import annotations

import pytest
import torch
from geometry_meshes import GENERIC
from torch import Tensor

from torchfair import Topology
from torchfair.energies import normal_variation_per_edge

every_mesh = pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC)


def plain(vertices: Tensor, topology: Topology, weights: Tensor | None = None) -> Tensor:
    """E by autograd of the geometry functions."""
    return normal_variation_per_edge(vertices, topology, weights).sum(-1)


def gradient_of(function, vertices: Tensor, *others) -> Tensor:
    variable = vertices.clone().requires_grad_()
    return torch.autograd.grad(function(variable, *others).sum(), variable)[0]
