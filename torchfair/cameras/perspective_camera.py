"""Views from eyes at finite distance."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from .._loading import safe_to_load
from ..errors import TorchfairError
from .attributes import camera_rows, fill_attributes, positive_numbers, unit_directions
from .camera import Camera
from .fitting import check_frame, fit_eyes, look_axes, points_to_fit
from .orthographic_camera import OrthographicCamera


@safe_to_load
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
    def distances(self) -> Tensor:
        """``(views,)`` from the eyes to the targets."""
        distances: Tensor = torch.linalg.vector_norm(self.targets - self.eyes, dim=-1)
        return distances

    def scales(self, width: int) -> Tensor:
        """``(views,)`` pixels per unit of length at distance 1, in a picture ``width`` pixels wide."""
        return width / (2 * torch.tan(torch.deg2rad(self.fields_of_view) / 2))

    @property
    def _local_to_world(self) -> Tensor:
        return self.axes  # which are perpendicular, so nothing is lost in an inverse
