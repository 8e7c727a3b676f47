"""Parallel views."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from ..rasterisation.camera_fit import check_frame, fit_windows, look_axes, points_to_fit
from .camera import Camera, Size, camera_rows, fill_attributes, height_and_width, positive_numbers, unit_directions


@dataclass(frozen=True, eq=False)
class OrthographicCamera(Camera):
    """Parallel views, as from far away.

    All arguments but ``directions`` may be given once for all views. They are kept as float64.

    Attributes:
        directions: (views, 3) or (3,) from the eye into the scene, of any length but zero; kept as unit vectors.
        targets: (views, 3) point in the middle of the picture.
        half_widths: (views,) half the width of the picture in the unit of the vertices, above 0.
        ups: (views, 3) direction that appears vertical. Where it is parallel to the view, some direction is.

    Raises:
        ShapeError: if an argument has another shape.
        TorchfairError: if a direction is zero or not finite, or a half-width not positive.
    """

    directions: Tensor
    targets: Tensor
    half_widths: Tensor
    ups: Tensor

    def __init__(
        self,
        directions: Tensor,
        targets: Tensor | None = None,
        half_widths: Tensor | float = 1.0,
        ups: Tensor | None = None,
    ) -> None:
        directions = unit_directions(camera_rows("directions", directions))
        views = directions.shape[0]
        fill_attributes(
            self,
            directions=directions,
            targets=camera_rows("targets", torch.zeros(3) if targets is None else targets, views),
            half_widths=positive_numbers("half_widths", half_widths, views),
            ups=camera_rows("ups", torch.tensor([0.0, 0, 1]) if ups is None else ups, views),
        )

    @classmethod
    def fit(
        cls,
        *vertices: Tensor,
        directions: Tensor,
        ups: Tensor | None = None,
        margin: float = 0.05,
        aspect: float = 1.0,
    ) -> OrthographicCamera:
        """The closest views along ``directions`` in which all the given points are seen with some margin.

        Points that are not finite are ignored; without any other the views look at the origin. If all points
        coincide the picture is two units wide.

        Args:
            vertices: tensors ``(..., 3)`` that share the views, such as a batch, or a mesh and its reference.
            directions: (views, 3) or (3,) from the eye into the scene.
            ups: (views, 3) or (3,) directions that appear vertical, z by default.
            margin: free part of the picture on every side, 0 to below 0.5.
            aspect: width over height of the picture.

        Raises:
            ShapeError: if a tensor has another shape.
            TorchfairError: if a direction is zero or not finite, or ``margin`` or ``aspect`` out of range.
        """
        check_frame(margin, aspect)
        camera = cls(directions, ups=ups)
        targets, half_widths = fit_windows(points_to_fit(vertices), camera.axes, margin, aspect)
        return cls(camera.directions, targets, half_widths, camera.ups)

    @property
    def axes(self) -> Tensor:
        """Orthonormal rows ``(views, 3, 3)``: right, up, and forward (from the eye into the scene)."""
        return look_axes(self.directions, self.ups)

    @property
    def origins(self) -> Tensor:
        """``(views, 3)`` the targets."""
        return self.targets

    @property
    def near(self) -> None:
        """None: a parallel view has no eye for things to be behind."""

    def to_screen(self, local: Tensor, size: Size, view: Tensor | None = None) -> Tensor:
        """Pixel coordinates x, y and distance along the line of sight, from what :meth:`local` gives."""
        height, width = height_and_width(size)
        right, up, forward = local.unbind(-1)
        scale = (width / (2 * self.half_widths)).to(local)
        scale = scale[:, None] if view is None else scale[view]
        return torch.stack([width / 2 + scale * right, height / 2 - scale * up, forward], dim=-1)

    def directions_at(self, pixels: Tensor, size: Size, view: Tensor | None = None) -> Tensor:
        """The direction of each view, repeated for every place ``(views, *any, 2)``: ``(views, *any, 3)``."""
        directions = self.directions.to(pixels)
        if view is not None:
            return directions[view]
        return directions.view(-1, *[1] * (pixels.ndim - 2), 3).expand(*pixels.shape[:-1], 3)

    def view_directions(self, points: Tensor) -> Tensor:
        """The direction of each view, repeated for points ``(*batch, N, 3)``: (*batch, views, N, 3)."""
        shape = (*points.shape[:-2], self.num_views, points.shape[-2], 3)
        return self.directions.to(points)[:, None].expand(shape)

    def _origins_at(self, pixels: Tensor, size: Size) -> Tensor:
        height, width = height_and_width(size)
        across = (pixels - pixels.new_tensor([width / 2, height / 2])) * pixels.new_tensor([1.0, -1.0])
        spread = (1,) * (pixels.ndim - 2)
        scale = (2 * self.half_widths / width).view(-1, *spread, 1)
        right, up, _ = (axis.view(-1, *spread, 3) for axis in self.axes.unbind(1))
        across = across * scale
        return self.targets.view(-1, *spread, 3) + across[..., :1] * right + across[..., 1:] * up
