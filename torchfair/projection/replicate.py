"""Many copies of a problem as one: terms on the rows of every member of a batch."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor

from .layout import Layout, State
from .term import ElementTerm, Refresh


def replicated(term: ElementTerm, layout: Layout, count: int) -> ElementTerm:
    """A term of one problem as a term of ``count`` members, whose blocks lie one after the other.

    Args:
        term: On blocks of ``layout``.
        layout: Of one member.
        count: How many members.
    """
    stencil = [(name, _shifted(index, layout.sizes[name][0], count)) for name, index in term.stencil]
    weights = None if term.element_weights is None else term.element_weights.repeat(count)
    refresh = term.refresh
    if refresh is not None:
        refresh = _each_member(refresh, layout)
    data = [part.repeat(count, *[1] * (part.ndim - 1)) for part in term.data]
    return replace(term, stencil=stencil, data=data, element_weights=weights, refresh=refresh)


def first_members(term: ElementTerm, elements: int) -> ElementTerm:
    """A replicated term on the first elements alone, those of the first members; it fits every choice of as many."""
    stencil = [(name, index[:elements]) for name, index in term.stencil]
    weights = None if term.element_weights is None else term.element_weights[:elements]
    data = [part[:elements] for part in term.data]
    return replace(term, stencil=stencil, data=data, element_weights=weights)


def _each_member(refresh: Refresh, layout: Layout) -> Refresh:
    def refresh_all(state: State) -> list[Tensor]:
        counts = [block.shape[0] // layout.sizes[name][0] for name, block in state.items() if layout.sizes[name][0]]
        whole = [(name, block.view(counts[0], -1, block.shape[1])) for name, block in state.items() if block.numel()]
        empty = {name: block for name, block in state.items() if not block.numel()}
        parts = [refresh(empty | {name: block[member] for name, block in whole}) for member in range(counts[0])]
        return [torch.cat(pieces) for pieces in zip(*parts, strict=True)]

    return refresh_all


def _shifted(index: Tensor, rows: int, count: int) -> Tensor:
    offsets = rows * torch.arange(count, device=index.device)
    return (index + offsets[:, None, None]).flatten(0, 1)
