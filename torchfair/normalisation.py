"""Problems are solved centred and with unit mean edge length, so that weights are dimensionless."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from .errors import MeshError
from .geometry import edge_lengths
from .topology import Topology


@dataclass(frozen=True)
class Normalisation:
    """The map ``x -> (x - centre) / length`` and its inverse.

    Attributes:
        centre: (3,) centre of the bounding box, in the unit of the input.
        length: Mean edge length, in the unit of the input.
    """

    centre: Tensor
    length: float

    @classmethod
    def of(cls, vertices: Tensor, topology: Topology) -> Normalisation:
        """The normalisation of a mesh ``(V, 3)``.

        Raises:
            MeshError: vertices are not finite, or all edges have length zero.
        """
        bad = torch.nonzero(~torch.isfinite(vertices).all(1)).squeeze(1).tolist()
        if bad:
            raise MeshError(f"{len(bad)} vertices are not finite, first {bad[:5]}: repair them before solving")
        length = float(edge_lengths(vertices, topology).mean()) if topology.num_edges else 0.0
        if not length > 0.0:
            raise MeshError("the mean edge length is zero: the mesh has no extent")
        used = vertices[topology.corners]
        return cls(0.5 * (used.amin(0) + used.amax(0)), length)

    def apply(self, points: Tensor) -> Tensor:
        """Points (..., 3) in input units to dimensionless ones."""
        return (points - self.centre) / self.length

    def invert(self, points: Tensor) -> Tensor:
        """Dimensionless points (..., 3) to input units."""
        return points * self.length + self.centre
