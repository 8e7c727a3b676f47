"""A term with its unknowns numbered in the flat vector."""

from __future__ import annotations

import torch

from .layout import Layout
from .term import ElementTerm


class CompiledTerm:
    """A term with its unknowns numbered in the flat vector.

    Attributes:
        unknowns: (K, n) flat number of each unknown of each element.
        nodes: (k, n) node number of each row of the stencil, all blocks together.
        widths: number of unknowns of each of the k rows.
    """

    def __init__(self, term: ElementTerm, layout: Layout) -> None:
        self.term = term
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
