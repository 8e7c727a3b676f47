"""Views from eyes at finite distance."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from ..errors import TorchfairError
from ..rasterisation.camera_fit import check_frame, fit_eyes, look_axes, points_to_fit
from .camera import Camera, Size, camera_rows, fill_attributes, height_and_width, positive_numbers, unit_directions
from .orthographic_camera import OrthographicCamera

_NEAR = 1e-4  # part of the distance of the target


@dataclass(frozen=True, eq=False)
class PerspectiveCamera(Camera):
    """Views from eyes at finite distance.

    All arguments but ``eyes`` may be given once for all views. They are kept as float64.

    Attributes:
        eyes: (views, 3) or (3,) positions of the eye.
        targets: (views, 3) point in the middle of the picture, not the eye.
        fields_of_view: (views,) angle over the width of the picture in degrees, between 0 and 180.
        ups: (views, 3) direction that appears vertical. Where it is parallel to the view, some direction is.

    Raises:
        ShapeError: if an argument has another shape.
        TorchfairError: if an eye is at its target, a position is not finite, or an angle not between 0 and 180.
    """

    eyes: Tensor
    targets: Tensor
    fields_of_view: Tensor
    ups: Tensor

    def __init__(
        self,
        eyes: Tensor,
        targets: Tensor | None = None,
        fields_of_view: Tensor | float = 24.0,
        ups: Tensor | None = None,
    ) -> None:
        eyes = camera_rows("eyes", eyes)
        views = eyes.shape[0]
        targets = camera_rows("targets", torch.zeros(3) if targets is None else targets, views)
        angles = positive_numbers("fields_of_view", fields_of_view, views)
        if not bool((angles < 180).all()):
            raise TorchfairError(f"fields_of_view must be below 180 degrees, got {float(angles.max())}")
        unit_directions(targets - eyes)
        ups = camera_rows("ups", torch.tensor([0.0, 0, 1]) if ups is None else ups, views)
        fill_attributes(self, eyes=eyes, targets=targets, fields_of_view=angles, ups=ups)

    @classmethod
    def fit(
        cls,
        *vertices: Tensor,
        directions: Tensor,
        ups: Tensor | None = None,
        fields_of_view: Tensor | float = 24.0,
        margin: float = 0.05,
        aspect: float = 1.0,
    ) -> PerspectiveCamera:
        """The closest eyes that see all the given points along ``directions`` with some margin.

        Arguments and errors as for :meth:`OrthographicCamera.fit`, and ``fields_of_view`` (views,) or one number in
        degrees.
        """
        check_frame(margin, aspect)
        start = OrthographicCamera(directions, ups=ups)
        angles = positive_numbers("fields_of_view", fields_of_view, start.num_views)
        points = points_to_fit(vertices)
        eyes, targets = fit_eyes(points, start.axes, torch.tan(torch.deg2rad(angles) / 2), margin, aspect)
        return cls(eyes, targets, angles, start.ups)

    @property
    def axes(self) -> Tensor:
        """Orthonormal rows ``(views, 3, 3)``: right, up, and forward (from the eye into the scene)."""
        return look_axes(self.targets - self.eyes, self.ups)

    @property
    def origins(self) -> Tensor:
        """``(views, 3)`` the eyes."""
        return self.eyes

    @property
    def near(self) -> Tensor:
        """``(views,)``: what is nearer along the line of sight than 1e-4 of the distance of the target is cut away."""
        near: Tensor = _NEAR * torch.linalg.vector_norm(self.targets - self.eyes, dim=-1)
        return near

    def to_screen(self, local: Tensor, size: Size, view: Tensor | None = None) -> Tensor:
        """Pixel coordinates x, y and ``-1 / distance``, from what :meth:`local` gives; NaN at and behind the eye."""
        height, width = height_and_width(size)
        right, up, forward = local.unbind(-1)
        inverse = 1 / torch.where(forward > 0, forward, torch.nan)
        scale = self._pixels_per_slope(width).to(local)
        scale = (scale[:, None] if view is None else scale[view]) * inverse
        return torch.stack([width / 2 + scale * right, height / 2 - scale * up, -inverse], dim=-1)

    def directions_at(self, pixels: Tensor, size: Size, view: Tensor | None = None) -> Tensor:
        """Unit directions of the rays through places ``(views, *any, 2)`` of the picture: ``(views, *any, 3)``."""
        height, width = height_and_width(size)
        axes, scale = self.axes.to(pixels), self._pixels_per_slope(width).to(pixels)[:, None]
        if view is None:
            spread = (1,) * (pixels.ndim - 2)
            axes, scale = axes.view(-1, *spread, 3, 3), scale.view(-1, *spread, 1)
        else:
            axes, scale = axes[view], scale[view]
        slopes = (pixels - pixels.new_tensor([width / 2, height / 2])) * pixels.new_tensor([1.0, -1.0]) / scale
        right, up, forward = axes.unbind(-2)
        towards: Tensor = slopes[..., :1] * right + slopes[..., 1:] * up + forward
        return torch.nn.functional.normalize(towards, dim=-1)

    def view_directions(self, points: Tensor) -> Tensor:
        """Unit directions from each eye to points ``(*batch, N, 3)``: (*batch, views, N, 3), zero at the eye."""
        return torch.nn.functional.normalize(points.unsqueeze(-3) - self.eyes.to(points)[:, None], dim=-1)

    def _origins_at(self, pixels: Tensor, size: Size) -> Tensor:
        return self.eyes.view(-1, *[1] * (pixels.ndim - 2), 3).expand(*pixels.shape[:-1], 3)

    def _pixels_per_slope(self, width: int) -> Tensor:
        return width / (2 * torch.tan(torch.deg2rad(self.fields_of_view) / 2))
