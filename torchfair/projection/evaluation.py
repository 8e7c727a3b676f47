"""What terms make of a state."""

from __future__ import annotations

from typing import NamedTuple

from torch import Tensor

from .layout import State
from .portions import Arguments
from .term import ElementTerm


class Seen(NamedTuple):
    """What a term makes of a state.

    Attributes:
        arguments: Of its functions, gathered when asked for.
        values: Residuals ``(n, m)``, unscaled.
        contributions: (n,) the elements' shares of the merit.
    """

    arguments: Arguments
    values: Tensor
    contributions: Tensor


class Evaluation(NamedTuple):
    """A state with its residuals.

    Attributes:
        state: The blocks.
        merits: (members,) sums of all terms, one for each member of a batch; infinity where a residual is not finite,
            so that such a state is never accepted.
        arguments, values: Of each term of ``Structure.compiled``, unscaled; arguments are gathered when asked for.
        affine: Scaled residuals of the linear terms.
    """

    state: State
    merits: Tensor
    arguments: list[Arguments]
    values: list[Tensor]
    affine: Tensor | None


def seen(term: ElementTerm, state: State) -> Seen:
    """What a term makes of a state; the data are those of the state."""
    arguments = term.arguments_at(state)
    values = term.values(arguments)
    return Seen(arguments, values, term.contributions(arguments, values))
