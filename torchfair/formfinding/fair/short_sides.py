"""How short sides of panels may become in the job that lowers E."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from ...constraints._components import components_first, derivative_rows, lengths
from ...constraints.barrier import barrier, barrier_slope
from ...geometry import edge_lengths
from ...projection import ElementTerm
from ...topology import Topology

_SAFE = 1.0  # over the bound: from where on the barrier is silent
_TINY = 1e-30


class ShortSides(NamedTuple):
    """Sides of polygons with more than three corners, and the lengths that theirs are measured against.

    Bounds on corner angles and areas keep the sides of a triangle from collapsing, those of other polygons not: a
    pentagon becomes a quad with good angles and nearly all of its area.

    Attributes:
        edges: (n,) numbers.
        own: (n,) their lengths at the start, or the mean edge length where that is less.
    """

    edges: Tensor
    own: Tensor

    @classmethod
    def of(cls, vertices: Tensor, topology: Topology) -> ShortSides:
        """Those of a mesh (V, 3)."""
        polygons = torch.repeat_interleave(topology.face_sizes > 3, topology.face_sizes)
        edges = torch.unique(topology.corner_edges[polygons])
        found = edge_lengths(vertices, topology)
        return cls(edges, found[edges].clamp_max(float(found.mean())) if len(edges) else found[edges])

    def shares(self, vertices: Tensor, topology: Topology) -> Tensor:
        """(n,) lengths at other vertices (V, 3) over those."""
        return edge_lengths(vertices, topology)[self.edges] / self.own

    def terms(self, topology: Topology, smallest: float, *, weight: float) -> list[ElementTerm]:
        """Barrier that no side crosses: at a share of its length; the weight multiplies half its square."""
        if not (smallest and len(self.edges)):
            return []
        stencil = [("vertices", topology.edges[self.edges])]
        return [
            ElementTerm(
                "short sides",
                _barriers,
                stencil,
                data=(smallest * self.own,),
                weight=weight,
                jacobian=_slopes,
                silent=True,
                batched=True,
            )
        ]


def _margins(x: Tensor, least: Tensor) -> tuple[Tensor, Tensor, Tensor]:
    """(3, n) edges of pairs x (n, 2, 3), (n,) their lengths, and by what share these are above the bound."""
    ends = components_first(x)
    along = ends[:, 1] - ends[:, 0]
    size = lengths(along)
    return along, size, size / least - 1.0


def _barriers(x: Tensor, least: Tensor) -> Tensor:
    """(n,) of sides x (n, 2, 3)."""
    margin = _margins(x, least)[2]
    return barrier(margin, torch.full_like(margin, _SAFE))


def _slopes(x: Tensor, least: Tensor) -> Tensor:
    """(n, 6) their derivatives."""
    along, size, margin = _margins(x, least)
    at_end = barrier_slope(margin, torch.full_like(margin, _SAFE)) / (least * size.clamp_min(_TINY)) * along
    return derivative_rows([-at_end, at_end])
