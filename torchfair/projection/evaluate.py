"""Reports on a state, term by term."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from ..errors import TorchfairError
from .layout import State
from .loss import apply_root
from .result import TermResidual
from .system import Evaluation, Structure
from .term import ElementTerm


def residual_table(structure: Structure, terms: Sequence[ElementTerm], at: Evaluation) -> list[TermResidual]:
    """Mean and largest residual of every term; terms of one name share a row.

    Args:
        structure: The problem.
        terms: All its terms, also those without elements or weight.
        at: A state whose residuals are known.
    """
    return residual_tables(structure, terms, at)[0]


def residual_tables(structure: Structure, terms: Sequence[ElementTerm], at: Evaluation) -> list[list[TermResidual]]:
    """The tables of all members of a batch, see :func:`residual_table`."""
    known = {id(c.term): (a, v) for c, a, v in zip(structure.compiled, at.arguments, at.values, strict=True)}
    groups: dict[str, list[ElementTerm]] = {}
    for term in terms:
        groups.setdefault(term.name, []).append(term)
    count = structure.layout.members
    tables: list[list[TermResidual]] = [[] for _ in range(count)]
    for name, members in groups.items():
        norms, share = [torch.zeros(count, 0, dtype=torch.float64)], torch.zeros(count, dtype=torch.float64)
        for term in members:
            if not term.num_elements:
                continue
            if id(term) in known:
                arguments, values = known[id(term)]
            else:
                arguments = term.arguments(at.state)
                values = term.values(arguments)
            norms.append(torch.linalg.vector_norm(term.missed(values), dim=1).double().cpu().view(count, -1))
            share += term.contributions(arguments, values).double().cpu().view(count, -1).sum(1)
        norm = torch.cat(norms, 1)
        empty = torch.zeros(count).tolist()
        mean, largest = (norm.mean(1).tolist(), norm.amax(1).tolist()) if norm.numel() else (empty, empty)
        for table, *row in zip(tables, mean, largest, share.tolist(), strict=True):
            table.append(TermResidual(name, members[0].weight, norm.shape[1], *row))
    return tables


def first_bad_elements(term: ElementTerm, state: State) -> list[int]:
    """Elements whose residual or Jacobian is not finite."""
    values, jacobians = term.derivatives(term.arguments(state))
    bad = ~(torch.isfinite(values).all(1) & torch.isfinite(jacobians).flatten(1).all(1))
    return [int(i) for i in torch.nonzero(bad).squeeze(1)]


def check_start(structure: Structure, start: Evaluation) -> None:
    """Raises TorchfairError if the start or its merit is not finite, or a linear term is not; names block or term."""
    state = start.state
    for name, block in state.items():
        bad = torch.nonzero(~torch.isfinite(block).all(1)).squeeze(1).tolist()
        if bad:
            raise TorchfairError(f"block '{name}' is not finite in rows {bad[:5]}: repair the start")
    if bool(torch.isfinite(start.merits).all()):
        affine = structure.affine
        misfit = affine.misfit(state, structure.layout.flatten(state)) if affine is not None else None
        if misfit is not None:
            raise TorchfairError(f"term '{misfit}' is declared linear, but its residual is not: leave out linear=True")
        return
    for term in structure.terms:
        bad = first_bad_elements(term, state)
        if bad:
            raise TorchfairError(
                f"the residual of term '{term.name}' is not finite at the start, elements {bad[:5]}: "
                "move the start away from the singular place or leave these elements out"
            )
    raise TorchfairError("the merit overflows at the start although every residual is finite: lower the weights")


def culprit(structure: Structure, state: State) -> str:
    """The term that most likely makes the system singular: one that is not finite, or the stiffest."""
    sizes = []
    for term in structure.terms:
        values, jacobians = term.derivatives(term.arguments(state))
        scaled = apply_root(term.roots(values), jacobians)
        sizes.append(float(torch.nan_to_num(scaled, nan=float("inf")).abs().max()))
    worst = max(range(len(sizes)), key=sizes.__getitem__)
    bad = first_bad_elements(structure.terms[worst], state)
    where = f", not finite at elements {bad[:5]}" if bad else f", largest derivative {sizes[worst]:.3g}"
    return f"term '{structure.terms[worst].name}'{where}"
