"""Reports on a state, term by term."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from ..errors import TorchfairError
from .layout import State
from .loss import apply_root
from .result import TermResidual
from .system import Evaluation, LinearSystem, Structure
from .term import ElementTerm


def residual_table(structure: Structure, terms: Sequence[ElementTerm], at: Evaluation) -> list[TermResidual]:
    """Mean and largest residual of every term; terms of one name share a row.

    Args:
        structure: The problem.
        terms: All its terms, also those without elements or weight.
        at: A state whose residuals are known.
    """
    known = {id(c.term): (a, v) for c, a, v in zip(structure.compiled, at.arguments, at.values, strict=True)}
    groups: dict[str, list[ElementTerm]] = {}
    for term in terms:
        groups.setdefault(term.name, []).append(term)
    rows = []
    for name, members in groups.items():
        norms, share = [torch.zeros(0, dtype=torch.float64)], 0.0
        for term in members:
            if not term.num_elements:
                continue
            if id(term) in known:
                arguments, values = known[id(term)]
            else:
                arguments = term.arguments(at.state)
                values = term.values(arguments)
            norms.append(torch.linalg.vector_norm(term.missed(values), dim=1).double().cpu())
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


def check_start(structure: Structure, start: Evaluation) -> None:
    """Raises TorchfairError if the start or its merit is not finite, or a term is not what it is declared to be.

    Linear terms have to be linear, closed forms the derivatives of their residuals; the error names block or term.
    """
    state = start.state
    for name, block in state.items():
        bad = _rows(~torch.isfinite(block))
        if bad:
            raise TorchfairError(f"block '{name}' is not finite in rows {bad[:5]}: repair the start")
    if start.merit != float("inf"):
        affine = structure.affine
        misfit = affine.misfit(state, structure.layout.flatten(state)) if affine is not None else None
        if misfit is not None:
            raise TorchfairError(f"term '{misfit}' is declared linear, but its residual is not: leave out linear=True")
        for compiled, arguments, values in zip(structure.compiled, start.arguments, start.values, strict=True):
            compiled.verify(arguments)
            if start.merit < 0.0:
                _check_merit(compiled.term, arguments, values)
        return
    for term in structure.terms:
        arguments = term.arguments(state)
        values = term.values(arguments)
        _check_finite(term, arguments, values)
        _check_merit(term, arguments, values)
        if term.linear:
            _check_origin(structure, term)
    raise TorchfairError("the merit overflows at the start although every residual is finite: lower the weights")


def _rows(bad: Tensor) -> list[int]:
    """Rows of a bool tensor (n, ...) with a true entry."""
    return [int(i) for i in torch.nonzero(bad.flatten(1).any(1)).squeeze(1)]


def _check_finite(term: ElementTerm, arguments: tuple[Tensor, ...], values: Tensor) -> None:
    bad = _rows(~torch.isfinite(values))
    if not bad:
        return
    where = f"the residual of term '{term.name}' is not finite at the start, elements {bad[:5]}"
    for i, data in enumerate(arguments[len(term.stencil) :]):
        if not bool(torch.isfinite(data[bad]).all()):
            raise TorchfairError(f"{where}: nor are its data[{i}] there, repair them or leave these elements out")
    raise TorchfairError(f"{where}: move the start away from the singular place or leave these elements out")


def _check_merit(term: ElementTerm, arguments: tuple[Tensor, ...], values: Tensor) -> None:
    own = term.contributions(arguments, values)[:, None]
    bad = _rows(~torch.isfinite(own))
    if bad:
        raise TorchfairError(
            f"the merit of term '{term.name}' overflows at the start, elements {bad[:5]}, although its residual is "
            "finite: lower its weight, or bring the start nearer"
        )
    bad = _rows(own < 0.0)
    if bad:
        raise TorchfairError(
            f"the merit of term '{term.name}' is negative at the start, elements {bad[:5]}: add a constant, so that it "
            "is never below zero"
        )


def _check_origin(structure: Structure, term: ElementTerm) -> None:
    layout = structure.layout
    origin = layout.unflatten(torch.zeros(layout.num_unknowns, dtype=layout.dtype, device=layout.device))
    bad = first_bad_elements(term, origin)
    if bad:
        raise TorchfairError(
            f"term '{term.name}' is declared linear, but not finite where its unknowns are zero, elements {bad[:5]}: "
            "leave out linear=True"
        )


def check_linearised(structure: Structure, system: LinearSystem) -> None:
    """Raises TorchfairError if a Jacobian is not finite at the start; names the term and its elements.

    Costs nothing where all is well: the gradient, which is known, is finite only if every derivative is.
    """
    if bool(torch.isfinite(system.gradient).all()):
        return
    for compiled, jacobians in zip(structure.compiled, system.jacobians, strict=True):
        bad = torch.nonzero(~torch.isfinite(jacobians).flatten(0, 1).all(0)).squeeze(1).tolist()
        if bad:
            raise TorchfairError(
                f"the derivative of term '{compiled.term.name}' is not finite at the start, elements {bad[:5]}, "
                "although the residual is: move the start away from the kink, or smooth the residual there"
            )


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
