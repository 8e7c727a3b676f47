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
        refresh = _each_member(refresh, layout, count)
    data = [part.repeat(count, *[1] * (part.ndim - 1)) for part in term.data]
    return replace(term, stencil=stencil, data=data, element_weights=weights, refresh=refresh)


def _shifted(index: Tensor, rows: int, count: int) -> Tensor:
    offsets = rows * torch.arange(count, device=index.device)
    return (index + offsets[:, None, None]).flatten(0, 1)


def _each_member(refresh: Refresh, layout: Layout, count: int) -> Refresh:
    def refresh_all(state: State) -> list[Tensor]:
        whole = {name: block.view(count, layout.sizes[name][0], -1) for name, block in state.items()}
        parts = [refresh({name: block[member] for name, block in whole.items()}) for member in range(count)]
        return [torch.cat(pieces) for pieces in zip(*parts, strict=True)]

    return refresh_all
