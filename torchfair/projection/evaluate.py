"""Reports on a state, term by term."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from ..errors import TorchfairError
from .declarations import check_declarations
from .evaluation import Evaluation
from .layout import State
from .linear_system import LinearSystem
from .loss import apply_root
from .result import TermResidual
from .start_checks import check_finite, check_merit, check_origin, first_bad_elements, rows
from .system import Structure
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
                arguments = term.arguments_at(at.state)
                values = term.values(arguments)
            norms.append(torch.linalg.vector_norm(term.missed(values), dim=1).double().cpu().view(count, -1))
            share += term.contributions(arguments, values).double().cpu().view(count, -1).sum(1)
        norm = torch.cat(norms, 1)
        empty = torch.zeros(count).tolist()
        mean, largest = (norm.mean(1).tolist(), norm.amax(1).tolist()) if norm.numel() else (empty, empty)
        for table, *row in zip(tables, mean, largest, share.tolist(), strict=True):
            table.append(TermResidual(name, members[0].weight, norm.shape[1], *row))
    return tables


def check_start(structure: Structure, start: Evaluation) -> None:
    """Raises TorchfairError if the start or its merit is not finite, or a term is not what it is declared to be.

    Linear terms have to be linear, closed forms the derivatives of their residuals; the error names block or term.
    """
    state = start.state
    for name, block in state.items():
        bad = rows(~torch.isfinite(block))
        if bad:
            raise TorchfairError(f"block '{name}' is not finite in rows {bad[:5]}: repair the start")
    if bool(torch.isfinite(start.merits).all()):
        for term in structure.terms:
            if term.linear:
                check_declarations(term, term.arguments_at(state))
        affine = structure.affine
        misfit = affine.misfit(state, structure.layout.flatten(state)) if affine is not None else None
        if misfit is not None:
            raise TorchfairError(f"term '{misfit}' is declared linear, but its residual is not: leave out linear=True")
        for compiled, arguments, values in zip(structure.compiled, start.arguments, start.values, strict=True):
            compiled.verify(arguments)
            if float(start.merits.min()) < 0.0:
                check_merit(compiled.term, arguments, values)
        return
    for term in structure.terms:
        arguments = term.arguments_at(state)
        values = term.values(arguments)
        check_finite(term, arguments, values)
        check_merit(term, arguments, values)
        if term.linear:
            check_origin(term, structure.layout)
    raise TorchfairError("the merit overflows at the start although every residual is finite: lower the weights")


def check_linearised(structure: Structure, system: LinearSystem) -> None:
    """Raises TorchfairError if a Jacobian is not finite at the start; names the term and its elements.

    Costs nothing where all is well: the gradient, which is known, is finite only if every derivative is.
    """
    if bool(torch.isfinite(system.gradient).all()):
        return
    for number, (compiled, jacobians) in enumerate(zip(structure.compiled, system.jacobians, strict=True)):
        bad = rows(~torch.isfinite(jacobians.permute(2, 0, 1)))
        chosen = system.felt[number]
        bad = bad if chosen is None else chosen[bad].tolist()
        if bad:
            raise TorchfairError(
                f"the derivative of term '{compiled.term.name}' is not finite at the start, elements {bad[:5]}, "
                "although the residual is: move the start away from the kink, or smooth the residual there"
            )


def culprit(structure: Structure, state: State) -> str:
    """The term that most likely makes the system singular: one that is not finite, or the stiffest."""
    sizes = []
    for term in structure.terms:
        values, jacobians = term.linearised(term.arguments(state))
        scaled = apply_root(term.roots(values), jacobians)
        sizes.append(float(torch.nan_to_num(scaled, nan=float("inf")).abs().max()))
    worst = max(range(len(sizes)), key=sizes.__getitem__)
    bad = first_bad_elements(structure.terms[worst], state)
    where = f", not finite at elements {bad[:5]}" if bad else f", largest derivative {sizes[worst]:.3g}"
    return f"term '{structure.terms[worst].name}'{where}"
