"""Parallel views."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor

from .._loading import safe_to_load
from .attributes import camera_rows, fill_attributes, positive_numbers, unit_directions
from .camera import Camera
from .fitting import check_frame, fit_windows, look_axes, points_to_fit


@safe_to_load
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
    def distances(self) -> None:
        """None: a parallel view has no eye."""

    def scales(self, width: int) -> Tensor:
        """``(views,)`` pixels per unit of length in a picture ``width`` pixels wide."""
        return width / (2 * self.half_widths)

    @property
    def _local_to_world(self) -> Tensor:
        return self.axes  # which are perpendicular, so nothing is lost in an inverse
