"""Exact first and second derivatives of the merit at one state, by autograd through the terms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import torch
from torch import Tensor

from .differentiation import as_rows
from .element_function import mapped
from .layout import Layout, State
from .nuclear_norm import SmoothNuclearNorm
from .term import ElementTerm

_STEP = 0.03  # of a central difference: times the cube root of eps and the extent of the blocks


class MeritDerivatives:
    """Gradient of the merit, and products with its second derivatives.

    Those of terms that are refreshed hold the change of their data too: of planes at closest points, say, as these
    travel. It is a central difference of the gradient, taken for symmetric.

    Args:
        layout: Of the blocks.
        terms: Their data and weights may require gradients: then so does :attr:`gradient`.
        state: Where.
        free: (N,) True where an unknown may move.
    """

    def __init__(self, layout: Layout, terms: Sequence[ElementTerm], state: State, free: Tensor) -> None:
        self._layout, self._free = layout, free
        self._terms = [_twice_differentiable(term) for term in terms if term.num_elements]
        self._refreshed = [term for term in self._terms if term.refresh is not None]
        with torch.enable_grad():
            self._flat = layout.flatten({name: block.detach() for name, block in state.items()}).requires_grad_()
            self.gradient = _gradient(layout, self._terms, self._flat, self._flat)

    def relative_length(self, step: Tensor) -> float:
        """Largest change of an unknown in a step (N,), relative to the extent of its block."""
        blocks, changes = self._layout.unflatten(self._flat.detach()), self._layout.unflatten(step.detach())
        lengths = [changes[name].abs().amax() / _extent(block) for name, block in blocks.items() if block.numel()]
        return float(torch.stack(lengths).amax()) if lengths else 0.0

    def product(self, vector: Tensor) -> Tensor:
        """The second derivatives times a vector (N,): rows of fixed unknowns, too."""
        (curved,) = torch.autograd.grad(
            self.gradient, self._flat, vector, retain_graph=True, allow_unused=True, materialize_grads=True
        )
        if self._refreshed:
            curved = curved + self._of_data(vector)
        return curved

    def free_product(self, vector: Tensor) -> Tensor:
        """The same among the free unknowns."""
        return self.product(vector * self._free) * self._free

    def pulled_back(self, vector: Tensor, inputs: Sequence[Tensor]) -> tuple[Tensor | None, ...]:
        """Derivatives of ``gradient . vector`` with respect to tensors that terms were made of."""
        return torch.autograd.grad(self.gradient, inputs, vector, allow_unused=True)

    def _of_data(self, vector: Tensor) -> Tensor:
        """By how much the gradient changes with the data that refreshed terms find a step away, per step."""
        length = self.relative_length(vector)
        if not length > 0.0:
            return torch.zeros_like(vector)
        step: float = torch.finfo(vector.dtype).eps ** (1 / 3) * _STEP / length
        here, sides = self._flat.detach(), []
        for sign in (1.0, -1.0):
            with torch.enable_grad():
                flat = here.clone().requires_grad_()
                sides.append(_gradient(self._layout, self._refreshed, flat, here + sign * step * vector).detach())
        return (sides[0] - sides[1]) / (2 * step)


def _gradient(layout: Layout, terms: Sequence[ElementTerm], flat: Tensor, searched: Tensor) -> Tensor:
    """Of the merit at the unknowns, with data found at others that are ``searched``."""
    state, there = layout.unflatten(flat), layout.unflatten(searched.detach())
    merit = flat.new_zeros(())
    for term in terms:
        local = tuple(state[name][index] for name, index in term.stencil)
        arguments = (*local, *_data(term, there))
        residuals = as_rows(mapped(term, "residual")(*arguments))
        merit = merit + term.contributions(arguments, residuals).sum()
    slope: Tensor
    (slope,) = torch.autograd.grad(merit, flat, create_graph=True, allow_unused=True, materialize_grads=True)
    return slope


def _twice_differentiable(term: ElementTerm) -> ElementTerm:
    loss = term.loss
    return replace(term, loss=loss.twice_differentiable()) if isinstance(loss, SmoothNuclearNorm) else term


def _extent(block: Tensor) -> Tensor:
    """What changes of a block are compared with: its extent, or its size if it is one point, or 1."""
    extent, largest = (block.amax(0) - block.amin(0)).amax(), block.abs().amax()
    return torch.where(extent > 0, extent, torch.where(largest > 0, largest, 1.0))


def _data(term: ElementTerm, state: Mapping[str, Tensor]) -> Sequence[Tensor]:
    return term.data if term.refresh is None else term.refresh(state)
