"""Terms that are made anew on the stencils of others: index maps hold those, and need not hold equal ones beside."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import torch
from torch import Tensor

from .term import ElementTerm


def on_stencils_of(known: Sequence[ElementTerm], terms: list[ElementTerm]) -> list[ElementTerm]:
    """The terms with the very tensors of the stencils ``known``, where those of the same place are equal to theirs."""
    if len(known) != len(terms):
        return terms
    return [_on_stencil_of(before, term) for before, term in zip(known, terms, strict=True)]


def _on_stencil_of(known: ElementTerm, term: ElementTerm) -> ElementTerm:
    if len(known.stencil) != len(term.stencil):
        return term
    pairs = list(zip(known.stencil, term.stencil, strict=True))
    if all(index is other for (_, index), (_, other) in pairs):
        return term
    same = all(name == other and _are_equal(index, whole) for (name, index), (other, whole) in pairs)
    return replace(term, stencil=known.stencil) if same else term


def _are_equal(one: Tensor, other: Tensor) -> bool:
    alike = one.shape == other.shape and one.dtype == other.dtype and one.device == other.device
    return one is other or (alike and torch.equal(one, other))
