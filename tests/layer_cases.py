"""Solves with parameters, whose derivatives are compared with those of solving again."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair.projection import ElementTerm, ProjectionLayer, ProjectionSettings

Terms = Callable[[Mapping[str, Tensor]], Sequence[ElementTerm]]
SETTINGS = ProjectionSettings(max_iterations=300)
NODES = torch.arange(3)[:, None]


@dataclass(frozen=True)
class Case:
    """A start, what is solved for, and the parameters that it depends on."""

    blocks: dict[str, Tensor]
    terms: Terms
    parameters: dict[str, Tensor]
    fixed: Mapping[str, Tensor] | None = None

    def layer(self, **options: object) -> ProjectionLayer:
        return ProjectionLayer(self.blocks, self.terms, fixed=self.fixed, settings=SETTINGS, **options)


def several_blocks() -> Case:
    points = torch.linspace(0.0, 1.0, 9, dtype=DOUBLE).view(3, 3).sin()
    blocks = {"points": points, "lengths": torch.ones(3, 1, dtype=DOUBLE)}

    def terms(given):
        both = [("points", NODES), ("lengths", NODES)]
        return [
            ElementTerm("length", lambda x, s: x[0].square().sum() - s[0, 0] ** 2, both, weight=2.0),
            ElementTerm("place", lambda x, t: x[0] - t, [("points", NODES)], data=(given["places"],)),
            ElementTerm("size", lambda s, t: s[0] - t, [("lengths", NODES)], data=(given["sizes"],)),
        ]

    return Case(blocks, terms, {"places": points + 0.3, "sizes": torch.ones(3, 1, dtype=DOUBLE)})


def wave(like: Tensor, phase: float) -> Tensor:
    return torch.linspace(0.0, 5.0, like.numel(), dtype=like.dtype).add(phase).cos().view_as(like)


def judged(blocks: Mapping[str, Tensor]) -> Tensor:
    """Some number that depends on all unknowns, bent so that it differs from its linear part."""
    return sum(((wave(block, 0.3) * block).sum() + block.square().sum() for block in blocks.values()), torch.zeros(()))


def varied(case: Case, step: float) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
    """Start and parameters moved: of the start only what is fixed."""
    fixed = case.fixed or {}
    blocks = {
        name: block + step * wave(block, 1.0) * fixed.get(name, torch.zeros(len(block), dtype=torch.bool))[:, None]
        for name, block in case.blocks.items()
    }
    return blocks, {name: value + step * wave(value, 2.0) for name, value in case.parameters.items()}


def slopes(case: Case, **options: object) -> tuple[Tensor, Any]:
    """The derivative along the variation by the backward pass."""
    blocks, parameters = varied(case, 0.0)
    leaves = [value.requires_grad_() for value in (*blocks.values(), *parameters.values())]
    found, info = case.layer(**options)(blocks, parameters)
    gradients = torch.autograd.grad(judged(found), leaves)
    ahead, behind = varied(case, 1.0), varied(case, -1.0)
    moved = [0.5 * (a - b) for part in (0, 1) for a, b in zip(ahead[part].values(), behind[part].values(), strict=True)]
    return sum((g * m).sum() for g, m in zip(gradients, moved, strict=True)), info


def solved_again(case: Case, step: float) -> Tensor:
    """The central difference of whole solves, polished."""
    layer, sides = case.layer(tolerance=1e-11), []
    for sign in (1.0, -1.0):
        blocks, parameters = varied(case, sign * step)
        for value in (*blocks.values(), *parameters.values()):
            value.requires_grad_()  # only then ends are polished
        found, _ = layer(blocks, parameters)
        sides.append(judged(found).detach())
    return (sides[0] - sides[1]) / (2 * step)
