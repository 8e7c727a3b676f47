"""A term with its unknowns numbered in the flat vector."""

from __future__ import annotations

import copy

import torch
from torch import Tensor

from ..errors import ShapeError
from .declarations import check_declarations
from .differentiation import Way
from .layout import Layout
from .portions import Arguments
from .term import ElementTerm, Residual


class CompiledTerm:
    """A term with its unknowns numbered in the flat vector.

    Attributes:
        widths: number of unknowns of each of the k rows.
        verified: functions of a term on this stencil that were found to be what it declares, see :meth:`verify`.
    """

    def __init__(self, term: ElementTerm, layout: Layout) -> None:
        self.term = term
        self.verified: tuple[Residual, Residual | None, bool, Way | None] | None = None
        self._layout = layout
        self.widths: list[int] = []
        for name, index in term.stencil:
            self.widths += [layout.sizes[name][1]] * index.shape[1]

    @property
    def unknowns(self) -> Tensor:
        """(K, n) flat number of each unknown of each element; made anew whenever it is asked for."""
        return self.unknowns_of(slice(None))

    def unknowns_of(self, elements: slice | Tensor) -> Tensor:
        """Those of some elements, a range or their numbers."""
        rows = []
        for name, whole in self.term.stencil:
            index = whole[elements]
            width = self._layout.sizes[name][1]
            components = self._layout.offset(name) + torch.arange(width, device=index.device)
            rows.append((index.T[:, None] * width + components[:, None]).flatten(0, 1))
        return torch.cat(rows)

    @property
    def nodes(self) -> Tensor:
        """(k, n) node number of each row of the stencil, all blocks together; likewise."""
        return torch.cat([self._layout.node_offset(name) + index.T for name, index in self.term.stencil])

    def verify(self, arguments: Arguments) -> None:
        """Tries at a few elements what the term declares; once, also for later data, weights and losses."""
        functions = (self.term.residual, self.term.jacobian, self.term.batched, self.term.derivatives)
        if self.verified != functions:
            check_declarations(self.term, arguments)
            self.verified = functions

    def with_term(self, term: ElementTerm) -> CompiledTerm:
        """The same numbers for a term on the same stencil."""
        mine = self.term
        same = len(term.stencil) == len(mine.stencil) and all(
            name == other and (index is known or torch.equal(index, known))
            for (name, index), (other, known) in zip(term.stencil, mine.stencil, strict=True)
        )
        if not same or term.linear != mine.linear:
            raise ShapeError(f"term '{term.name}'", f"the stencil of '{mine.name}', linear like it", "another term")
        result = copy.copy(self)
        result.term = term
        return result
