"""Why a start cannot be evaluated: elements whose residual, data or merit is not finite."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from ..errors import TorchfairError
from .layout import Layout, State
from .term import ElementTerm


def rows(bad: Tensor) -> list[int]:
    """Rows of a bool tensor (n, ...) with a true entry."""
    return [int(i) for i in torch.nonzero(bad.flatten(1).any(1)).squeeze(1)]


def first_bad_elements(term: ElementTerm, state: State) -> list[int]:
    """Elements whose residual or Jacobian is not finite."""
    values, jacobians = term.linearised(term.arguments(state))
    return rows(~torch.isfinite(torch.cat([values[:, :, None], jacobians], dim=2)))


def check_finite(term: ElementTerm, arguments: Sequence[Tensor], values: Tensor) -> None:
    """Raises TorchfairError if residuals ``values`` (n, m) are not finite, because of the data or otherwise."""
    bad = rows(~torch.isfinite(values))
    if not bad:
        return
    where = f"the residual of term '{term.name}' is not finite at the start, elements {bad[:5]}"
    for i, data in enumerate(arguments[len(term.stencil) :]):
        if not bool(torch.isfinite(data[bad]).all()):
            raise TorchfairError(f"{where}: nor are its data[{i}] there, repair them or leave these elements out")
    raise TorchfairError(f"{where}: move the start away from the singular place or leave these elements out")


def check_merit(term: ElementTerm, arguments: Sequence[Tensor], values: Tensor) -> None:
    """Raises TorchfairError if the merit of an element is not finite or negative."""
    own = term.contributions(arguments, values)[:, None]
    bad = rows(~torch.isfinite(own))
    if bad:
        raise TorchfairError(
            f"the merit of term '{term.name}' is not finite at the start, elements {bad[:5]}, although the residual "
            "is: lower its weight, or bring the start nearer"
        )
    bad = rows(own < 0.0)
    if bad:
        raise TorchfairError(
            f"the merit of term '{term.name}' is negative at the start, elements {bad[:5]}: add a constant, so that it "
            "is never below zero"
        )


def check_origin(term: ElementTerm, layout: Layout) -> None:
    """Raises TorchfairError if a linear term is not finite where its constant part is measured, at zero."""
    origin = layout.unflatten(torch.zeros(layout.num_unknowns, dtype=layout.dtype, device=layout.device))
    bad = first_bad_elements(term, origin)
    if bad:
        raise TorchfairError(
            f"term '{term.name}' is declared linear, but not finite where its unknowns are zero, elements {bad[:5]}: "
            "leave out linear=True"
        )
