"""Creases of a mesh that was made, and how far they are from those of the surface."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

_PAIRS = 1 << 20  # held at once


@dataclass(frozen=True, eq=False)
class MeshCreases:
    """The edges of a mesh that stand for the sharp edges of a surface.

    Attributes:
        edges: (C, 2) vertices of the mesh, the smaller first.
        given: (n, 2, 3) ends of the sharp edges of the surface.
    """

    edges: Tensor
    given: Tensor

    @property
    def length(self) -> float:
        """Of the sharp edges of the surface together, whose triangles may have been cut finer."""
        return float(torch.linalg.vector_norm(self.given[:, 1] - self.given[:, 0], dim=1).sum())

    def to(self, like: Tensor) -> MeshCreases:
        """The same on the device and in the dtype of positions."""
        return MeshCreases(self.edges.to(like.device), self.given.to(like))

    def distance(self, vertices: Tensor) -> float:
        """Largest distance of ends and middles of their edges from the other set, both ways; 0 where there are none.

        Args:
            vertices: (V, 3) of the mesh.
        """
        if not len(self.edges) or not len(self.given):
            return 0.0
        made = vertices[self.edges]
        return max(_one_sided(made, self.given), _one_sided(self.given, made))


def _one_sided(of: Tensor, to: Tensor) -> float:
    points = torch.unique(torch.cat([of[:, 0], of[:, 1], of.mean(1)]), dim=0)
    return max(float(_nearest(part, to).max()) for part in points.split(max(_PAIRS // len(to), 1)))


def _nearest(points: Tensor, segments: Tensor) -> Tensor:
    start, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    offset = points[:, None] - start
    place = ((offset * along).sum(-1) / along.square().sum(-1)).clamp(0, 1)
    distances: Tensor = torch.linalg.vector_norm(offset - place[..., None] * along, dim=-1)
    return distances.amin(1)
