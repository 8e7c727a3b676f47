"""Directions that edges keep while E is lowered: those of the start, or those wanted where the edges are."""

from __future__ import annotations

from collections.abc import Callable

import torch
from torch import Tensor

from ..._names import first_few
from ...constraints import edge_direction_terms
from ...errors import MeshError, ShapeError
from ...normalisation import Normalisation
from ...projection import ElementTerm
from ...topology import Topology

WantedDirections = Callable[[Tensor, Tensor], Tensor]
"""Of edges with middles (n, 3) and vectors (n, 3): the directions (n, 3) they should have, zero to keep their own."""


class EdgeGuide:
    """The directions of all interior edges of one mesh.

    Args:
        vertices: (V, 3) start.
        topology: Its connectivity.
        wanted: Directions that edges should have, which change as the edges move: they are read off anew before every
            stage. By default those of the start.

    Attributes:
        version: How often they were read off.
    """

    def __init__(self, vertices: Tensor, topology: Topology, wanted: WantedDirections | None = None) -> None:
        self._start, self._topology, self._wanted = vertices, topology, wanted
        self._at, self.version = vertices, 0
        self._directions: Tensor | None = None  # those of the start

    def read(self, vertices: Tensor) -> None:
        """Reads off what is wanted where a mesh (V, 3) is.

        Raises:
            ShapeError: what is wanted is not a tensor (n, 3).
            MeshError: it is not finite.
        """
        if self._wanted is None:
            return
        ends = self._topology.interior_edges
        found = self._wanted(vertices[ends].mean(1), _along(vertices, ends))
        found = _checked(found, len(ends)).to(self._start)
        has = (found != 0.0).any(1, keepdim=True)
        self._at, self._directions = vertices, torch.where(has, found, _along(self._start, ends))
        self.version += 1

    def terms(self, *, weight: float) -> list[ElementTerm]:
        """How far edges are sideways of their directions, see :func:`.edge_direction_terms`."""
        every = torch.arange(self._topology.num_interior_edges)
        return edge_direction_terms(self._at, self._topology, every, along=self._directions, weight=weight)


def _along(vertices: Tensor, ends: Tensor) -> Tensor:
    return vertices[ends[:, 1]] - vertices[ends[:, 0]]


def _checked(found: object, count: int) -> Tensor:
    if not isinstance(found, Tensor) or found.shape != (count, 3):
        actual = tuple(found.shape) if isinstance(found, Tensor) else type(found).__name__
        raise ShapeError("what directions_at gives", f"a tensor ({count}, 3)", actual)
    if not found.isfinite().all():
        wrong = torch.nonzero(~found.isfinite().all(1)).squeeze(1).tolist()
        raise MeshError(f"what directions_at gives is not finite for interior edges {first_few(wrong, len(wrong))}")
    return found.detach()


def normalised_directions(wanted: WantedDirections, unit: Normalisation) -> WantedDirections:
    """Directions given in the unit of the input, of edges in that of the job."""
    return lambda middles, along: wanted(unit.invert(middles), along)
