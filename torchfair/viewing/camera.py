"""The camera of a picture: one view, as close as the picture allows."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ..cameras import Camera, OrthographicCamera, PerspectiveCamera
from ..cameras.camera import check_camera
from ..cameras.fitting import look_axes, points_to_fit
from ..errors import ShapeError


def fit_camera(
    *vertices: Tensor,
    towards_eye: Tensor,
    up: Tensor,
    width: int,
    height: int | None = None,
    field_of_view: float = 24.0,
    margin: float = 0.05,
) -> tuple[Camera, tuple[int, int]]:
    """The closest camera that sees all the given points with some margin, and the size of its picture.

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

    Returns:
        A camera with one view, and ``(height, width)`` in pixels.

    Raises:
        ShapeError: if ``towards_eye`` is zero or the picture has no pixels.
        TorchfairError: if ``margin`` is out of range.
    """
    axes = eye_axes(towards_eye, up)
    if height is None:
        height = _natural_height(points_to_fit(vertices) @ axes.T, width)
    if width < 1 or height < 1:
        raise ShapeError("width and height", "at least one pixel each", (width, height))
    size, aspect = (height, width), width / height
    if field_of_view <= 0:
        return OrthographicCamera.fit(*vertices, directions=-axes[2], ups=axes[1], margin=margin, aspect=aspect), size
    across = field_of_view
    if height > width:
        across = 2 * math.degrees(math.atan(aspect * math.tan(math.radians(field_of_view) / 2)))
    fit = PerspectiveCamera.fit(
        *vertices, directions=-axes[2], ups=axes[1], fields_of_view=across, margin=margin, aspect=aspect
    )
    return fit, size


def eye_axes(towards_eye: Tensor, up: Tensor) -> Tensor:
    """Orthonormal rows ``(3, 3)``: right, up, and towards the eye, for a view from the direction ``towards_eye``.

    Raises:
        ShapeError: if ``towards_eye`` is zero.
    """
    back = torch.as_tensor(towards_eye, dtype=torch.float64)
    if not torch.linalg.vector_norm(back) > 0:
        raise ShapeError("towards_eye", "a direction (3,) that is not zero", back.tolist())
    right, upward, forward = look_axes(-back[None], torch.as_tensor(up, dtype=torch.float64)[None])[0]
    return torch.stack([right, upward, -forward])


def towards_eye(camera: Camera, points: Tensor) -> Tensor:
    """Unit vectors ``(N, 3)`` from points ``(N, 3)`` to the eye of the only view; the zero vector at the eye itself."""
    check_one_view(camera)
    return -camera.view_directions(points)[0]


def check_one_view(camera: Camera) -> None:
    """Raises unless ``camera`` has one view: TypeError for what is no camera, ShapeError for several views."""
    check_camera(camera)
    if camera.num_views != 1:
        raise ShapeError("camera", "one view, such as camera.select(slice(0, 1))", f"{camera.num_views} views")


def _natural_height(local: Tensor, width: int) -> int:
    """Rows that give the points the same margin on all sides (to a few percent, for perspective)."""
    extent = (local.amax(0) - local.amin(0)).tolist()
    ratio = extent[1] / extent[0] if extent[0] > 0 else (1.2 if extent[1] > 0 else 0.75)
    return max(1, round(width * min(max(ratio, 0.35), 0.9)))
