"""Depth of the planes of projected triangles beside pixel centres, and which of them a picture shows."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor


class PlaneTable(NamedTuple):
    """Planes of projected triangles, to be looked at in many places; constant for autograd.

    Depths stay within those of the corners, slopes within their difference, so that steep planes do not run away.

    Attributes:
        rows: (n, 8) a corner, slopes to the right and down, least and largest depth, slope in its direction.
    """

    rows: Tensor

    @classmethod
    def of(cls, points: Tensor, triangles: Tensor) -> PlaneTable:
        """Of triangles (n, 3) of point numbers, with points (V, 3)."""
        corners = points.detach()[triangles].to(torch.float64)
        origin, a, b = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
        normal = torch.linalg.cross(a, b)
        across = normal[:, :2] / torch.where(normal[:, 2:] == 0, 1, -normal[:, 2:])
        nearest, farthest = corners[..., 2].amin(1), corners[..., 2].amax(1)
        slope = torch.minimum(torch.linalg.vector_norm(across, dim=-1), farthest - nearest)
        return cls(torch.cat([origin, across, torch.stack([nearest, farthest, slope], dim=1)], dim=1))

    def at(self, chosen: Tensor, places: Tensor) -> tuple[Tensor, Tensor]:
        """Depths and slopes (n,) of the planes ``chosen`` (n,) at ``places`` (n, 2)."""
        x, y, z, right, down, nearest, farthest, slope = self.rows.index_select(0, chosen).unbind(1)
        depth = z + ((places[:, 0] - x) * right + (places[:, 1] - y) * down)
        return torch.clamp(depth, nearest, farthest), slope

    def nearest(self) -> Tensor:
        """(n,) least depths of the triangles."""
        return self.rows[:, 5]

    def farthest(self) -> Tensor:
        """(n,) largest depths of the triangles."""
        return self.rows[:, 6]

    def slopes(self) -> Tensor:
        """(n,) as :meth:`at` gives them."""
        return self.rows[:, 7]


class SeenPlanes(NamedTuple):
    """Planes of the triangles that a picture shows, each worked out once.

    Attributes:
        number: (H, W) which of them is at each pixel, -1 where there is none.
        planes: All of them.
    """

    number: Tensor
    planes: PlaneTable

    @classmethod
    def of(cls, points: Tensor, triangles: Tensor, nearest: Tensor) -> SeenPlanes:
        """With projected points (V, 3), and of triangles (T, 3) the nearest one (H, W) at each pixel, -1 for none."""
        nearest = nearest.to(torch.int64)
        shown = triangles.new_zeros(len(triangles) + 1, dtype=torch.bool)
        shown[nearest] = True  # -1 is the last
        shown[-1] = False
        numbers = torch.where(shown, shown.cumsum(0) - 1, -1)
        return cls(numbers[nearest], PlaneTable.of(points, triangles[shown[:-1]]))
