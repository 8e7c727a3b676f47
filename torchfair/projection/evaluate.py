"""The merit of a state, term by term."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from .layout import State
from .result import TermResidual
from .term import ElementTerm


def merit(terms: Sequence[ElementTerm], state: State) -> float:
    """Sum of all terms; infinity where a residual is not finite, so that such a state is never accepted."""
    total = 0.0
    for term in terms:
        if not term.num_elements or term.weight == 0.0:
            continue
        arguments = term.arguments(state)
        total += float(term.contributions(arguments, term.values(arguments)).sum())
    return total if total == total and total != float("-inf") else float("inf")


def residual_table(terms: Sequence[ElementTerm], state: State) -> list[TermResidual]:
    """Mean and largest residual of every term; terms of one name share a row."""
    groups: dict[str, list[ElementTerm]] = {}
    for term in terms:
        groups.setdefault(term.name, []).append(term)
    rows = []
    for name, members in groups.items():
        norms, share = [torch.zeros(0, dtype=torch.float64)], 0.0
        for term in members:
            if not term.num_elements:
                continue
            arguments = term.arguments(state)
            values = term.values(arguments)
            norms.append(torch.linalg.vector_norm(values, dim=1).double().cpu())
            share += float(term.contributions(arguments, values).sum())
        norm = torch.cat(norms)
        mean, largest = (float(norm.mean()), float(norm.max())) if norm.numel() else (0.0, 0.0)
        rows.append(TermResidual(name, members[0].weight, norm.numel(), mean, largest, share))
    return rows


def first_bad_elements(term: ElementTerm, state: State) -> list[int]:
    """Elements whose residual or Jacobian is not finite."""
    values, jacobians = term.derivatives(term.arguments(state))
    bad = ~(torch.isfinite(values).all(1) & torch.isfinite(jacobians).flatten(1).all(1))
    return [int(i) for i in torch.nonzero(bad).squeeze(1)]
