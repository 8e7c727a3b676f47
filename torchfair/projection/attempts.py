"""States of large problems that are tried: a few barriers among very many do not decide on the step of all.

Where a step takes elements out of their domain, or barriers so near their bound that each of them alone costs a visible
part of what all others gain, their unknowns go less far. Other elements may cost what they do: where few of them hold
most of the merit, they are what has to move. Of states that are not taken, no more is computed than shows that.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from .evaluation import Evaluation, Seen, seen
from .layout import State
from .proposal import Proposal

_DEAR = 0.005  # of the promised fall of the merit, that one element rises by beyond what the model knows
_FEW = 0.05  # of the unknowns: where more are of dear elements, the step as a whole is too long


class Spoilt(NamedTuple):
    """Where elements spoil a state, as far as was looked.

    Attributes:
        terms: Numbers in ``Structure.compiled`` of the terms they are of.
        unknowns: (N,) bool, theirs.
    """

    terms: list[int]
    unknowns: Tensor


class Attempts:
    """Looks for elements that spoil a state: their share of the merit is not finite, or a barrier's has risen dearly.

    Args:
        start: Where the step starts, of a problem of one member.
        proposal: The whole step.
    """

    def __init__(self, start: Evaluation, proposal: Proposal) -> None:
        self._start, self._proposal, self._structure = start, proposal, proposal.system.structure
        self._dear = _DEAR * max(float(proposal.predicted), 0.0)
        self._before: dict[int, Tensor] = {}
        self._known: dict[int, Tensor] = {}

    def evaluated(self, state: State) -> Evaluation | Spoilt:
        """The evaluation of a state, unless it is spoilt.

        Terms whose data have to be found anew, such as closest points, come last: they cost most, and barriers of
        angles and areas have been seen by then.
        """
        terms = [compiled.term for compiled in self._structure.compiled]
        found: dict[int, Seen] = {}
        for refreshed in (False, True):
            numbers = [number for number, term in enumerate(terms) if (term.refresh is not None) is refreshed]
            found |= {number: seen(terms[number], state) for number in numbers}
            spoilt = self._spoilt(numbers, [found[number].contributions for number in numbers])
            if spoilt is not None:
                return spoilt
        return self._structure.summed(state, [found[number] for number in range(len(terms))])

    def spoilt(self, state: State, terms: Sequence[int]) -> Spoilt | None:
        """Where elements of some terms spoil a state."""
        return self._spoilt(terms, [seen(self._structure.compiled[n].term, state).contributions for n in terms])

    def _spoilt(self, numbers: Sequence[int], contributions: Sequence[Tensor]) -> Spoilt | None:
        """Barriers, elements of silent terms, that have risen dearly count only if they are few."""
        outside, dear = Spoilt([], self._nothing()), Spoilt([], self._nothing())
        for number, shares in zip(numbers, contributions, strict=True):
            self._note(outside, number, ~torch.isfinite(shares))
            if self._structure.compiled[number].term.silent:
                self._note(dear, number, self._has_risen(number, shares))
        if dear.terms and float(dear.unknowns.double().mean()) <= _FEW:
            terms = sorted({*outside.terms, *dear.terms})
            return Spoilt(terms, outside.unknowns | dear.unknowns)
        return outside if outside.terms else None

    def _note(self, where: Spoilt, number: int, elements: Tensor) -> None:
        chosen = torch.nonzero(elements).squeeze(1)
        if len(chosen):
            where.terms.append(number)
            where.unknowns[self._structure.compiled[number].unknowns_of(chosen)] = True

    def _nothing(self) -> Tensor:
        return torch.zeros_like(self._structure.free)

    def _has_risen(self, number: int, shares: Tensor) -> Tensor:
        """(n,) bool: elements of a term whose shares of the merit have risen dearly, which the model does not know."""
        if number not in self._before:
            term = self._structure.compiled[number].term
            self._before[number] = term.contributions(self._start.arguments[number], self._start.values[number])
        rises = shares - self._before[number]
        dear = rises > self._dear
        if not bool(dear.any()):
            return dear
        if number not in self._known:
            self._known[number] = self._proposal.system.rises(number, self._proposal.change).clamp_min(0.0)
        return rises > self._known[number] + self._dear
