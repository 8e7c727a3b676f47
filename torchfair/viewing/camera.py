"""Cameras: where the eye is, and how points in space become pixels."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import torch
from torch import Tensor

from ..errors import ShapeError
from ..rasterisation.camera_fit import fit_eyes, points_to_fit
from ..rasterisation.camera_fit import look_axes as axes_of_views


@dataclass(frozen=True, eq=False)
class Camera:
    """A pinhole or parallel camera with square pixels.

    Attributes:
        eye: ``(3,)`` position of the eye; for a parallel camera any point on the central line of sight.
        axes: ``(3, 3)`` orthonormal rows: right, up, and backward (from the scene towards the eye).
        scale: pixels per unit of length at unit distance (perspective), or anywhere (parallel).
        perspective: whether distant things look smaller.
        width: columns of pixels.
        height: rows of pixels.
    """

    eye: Tensor
    axes: Tensor
    scale: float
    perspective: bool
    width: int
    height: int

    def project(self, vertices: Tensor) -> Tensor:
        """Pixel coordinates ``(*batch, V, 3)``: x to the right, y down from the top, and depth.

        Depth grows away from the eye and is affine over the screen as
        :func:`torchfair.viewing.rasterise` asks: distance along the line of sight for a parallel
        camera, ``-1 / distance`` for perspective. Points at or behind the eye of a perspective camera become NaN,
        so that triangles with such a corner are left out.
        """
        right, up, back = ((vertices - self.eye.to(vertices)) @ self.axes.T.to(vertices)).unbind(-1)
        if self.perspective:
            distance = torch.where(back < 0, -back, torch.nan)
            right, up, depth = right / distance, up / distance, -1 / distance
        else:
            depth = -back
        return torch.stack([self.width / 2 + self.scale * right, self.height / 2 - self.scale * up, depth], dim=-1)

    def towards_eye(self, points: Tensor) -> Tensor:
        """Unit vectors ``(*batch, 3)`` from points to the eye; the zero vector at the eye itself."""
        if not self.perspective:
            return self.axes[2].to(points).expand_as(points)
        return torch.nn.functional.normalize(self.eye.to(points) - points, dim=-1)

    def enlarged(self, factor: int) -> Camera:
        """The same view with ``factor`` times as many pixels each way."""
        return replace(self, scale=self.scale * factor, width=self.width * factor, height=self.height * factor)


def fit_camera(
    *vertices: Tensor,
    towards_eye: Tensor,
    up: Tensor,
    width: int,
    height: int | None = None,
    field_of_view: float = 24.0,
    margin: float = 0.05,
) -> Camera:
    """The closest camera that sees all the given points with some margin.

    Points that are not finite are ignored; without any other the camera looks at the origin. If all points
    coincide the camera stands off by the unit of length.

    Args:
        vertices: tensors ``(..., 3)`` that share one view, such as a mesh before and after.
        towards_eye: ``(3,)`` direction from the scene to the eye, of any length but zero.
        up: ``(3,)`` direction that appears vertical. If it is parallel to ``towards_eye``, some direction is.
        width: columns of pixels.
        height: rows of pixels; by default such that the points fill the picture, between 0.35 and 0.9 times the width.
        field_of_view: angle over the larger side of the picture in degrees, 0 for a parallel camera.
        margin: free part of the picture on every side, below 0.5.

    Raises:
        ShapeError: if ``towards_eye`` is zero or the picture has no pixels.
    """
    axes = look_axes(towards_eye, up)
    points = points_to_fit(vertices)
    local = points @ axes.T
    if height is None:
        height = _natural_height(local, width)
    if width < 1 or height < 1:
        raise ShapeError("width and height", "at least one pixel each", (width, height))
    usable = 1 - 2 * margin
    size = torch.linalg.vector_norm(local.amax(0) - local.amin(0))
    reach = float(size) if size > 0 else 1.0
    if field_of_view <= 0:
        centre = (local.amax(0) + local.amin(0)) / 2
        half = (local.amax(0) - local.amin(0)) / 2
        sides = torch.stack([2 * half[0] / width, 2 * half[1] / height])
        scale = usable / max(float(sides.max()), 1e-6 * reach / max(width, height))
        return Camera(centre @ axes, axes, scale, False, width, height)
    slope = math.tan(math.radians(field_of_view) / 2)
    forward = axes * axes.new_tensor([1.0, 1, -1])[:, None]
    side = axes.new_tensor([slope * width / max(width, height)])
    eyes, _ = fit_eyes(points, forward[None], side, margin, width / height)
    return Camera(eyes[0], axes, max(width, height) / (2 * slope), True, width, height)


def look_axes(towards_eye: Tensor, up: Tensor) -> Tensor:
    """Orthonormal rows ``(3, 3)``: right, up, backward, for a view from the direction ``towards_eye``.

    Raises:
        ShapeError: if ``towards_eye`` is zero.
    """
    back = torch.as_tensor(towards_eye, dtype=torch.float64)
    if not torch.linalg.vector_norm(back) > 0:
        raise ShapeError("towards_eye", "a direction (3,) that is not zero", back.tolist())
    axes = axes_of_views(-back[None], torch.as_tensor(up, dtype=torch.float64)[None])[0]
    return axes * axes.new_tensor([1.0, 1, -1])[:, None]


def _natural_height(local: Tensor, width: int) -> int:
    """Rows that give the points the same margin on all sides (to a few percent, for perspective)."""
    extent = (local.amax(0) - local.amin(0)).tolist()
    ratio = extent[1] / extent[0] if extent[0] > 0 else (1.2 if extent[1] > 0 else 0.75)
    return max(1, round(width * min(max(ratio, 0.35), 0.9)))
