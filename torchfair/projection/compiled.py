"""A term with its unknowns numbered in the flat vector."""

from __future__ import annotations

import copy

import torch
from torch import Tensor

from ..errors import ShapeError
from .declarations import check_declarations
from .differentiation import Way
from .layout import Layout
from .term import ElementTerm, Residual


class CompiledTerm:
    """A term with its unknowns numbered in the flat vector.

    Attributes:
        unknowns: (K, n) flat number of each unknown of each element.
        nodes: (k, n) node number of each row of the stencil, all blocks together.
        widths: number of unknowns of each of the k rows.
        verified: functions of a term on this stencil that were found to be what it declares, see :meth:`verify`.
    """

    def __init__(self, term: ElementTerm, layout: Layout) -> None:
        self.term = term
        self.verified: tuple[Residual, Residual | None, bool, Way | None] | None = None
        unknowns, nodes, self.widths = [], [], []
        for name, index in term.stencil:
            width = layout.sizes[name][1]
            components = torch.arange(width, device=index.device)
            flat = layout.offset(name) + index[:, :, None] * width + components
            unknowns.append(flat.flatten(1))
            nodes.append(layout.node_offset(name) + index)
            self.widths += [width] * index.shape[1]
        self.unknowns = torch.cat(unknowns, dim=1).T.contiguous()
        self.nodes = torch.cat(nodes, dim=1).T.contiguous()

    def verify(self, arguments: tuple[Tensor, ...]) -> None:
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
