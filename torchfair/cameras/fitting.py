"""Where cameras stand: axes of a view, and the closest view of given points."""

from __future__ import annotations

import math
from collections.abc import Sequence

import torch
from torch import Tensor

from ..errors import TorchfairError


def look_axes(forward: Tensor, ups: Tensor) -> Tensor:
    """Orthonormal rows ``(views, 3, 3)``: right, up, forward, for views along ``forward`` (views, 3), not zero.

    Where ``ups`` is parallel to the view, the coordinate axis most nearly across it takes its place.
    """
    forward = forward / torch.linalg.vector_norm(forward, dim=-1, keepdim=True)
    longest = torch.linalg.vector_norm(ups, dim=-1, keepdim=True)
    right = torch.linalg.cross(forward, ups / torch.where(longest > 0, longest, 1))
    other = torch.eye(3, dtype=forward.dtype, device=forward.device)[forward.abs().argmin(-1)]
    parallel = torch.linalg.vector_norm(right, dim=-1, keepdim=True) < 1e-9
    right = torch.where(parallel, torch.linalg.cross(forward, other), right)
    right = right / torch.linalg.vector_norm(right, dim=-1, keepdim=True)
    return torch.stack([right, torch.linalg.cross(right, forward), forward], dim=1)


def check_frame(margin: float, aspect: float) -> None:
    """Raises TorchfairError unless ``margin`` is within 0 to below 0.5 and ``aspect`` positive."""
    if not 0 <= margin < 0.5:
        raise TorchfairError(f"margin must be at least 0 and below 0.5, got {margin}")
    if not 0 < aspect < math.inf:
        raise TorchfairError(f"aspect must be positive, got {aspect}")


def points_to_fit(vertices: Sequence[Tensor]) -> Tensor:
    """All finite points ``(N, 3)`` of some tensors ``(..., 3)`` in float64; the origin if there are none."""
    points = torch.cat([torch.zeros(0, 3), *(v.detach().reshape(-1, 3).to("cpu", torch.float64) for v in vertices)])
    points = points[torch.isfinite(points).all(-1)].to(torch.float64)
    return points if points.shape[0] else torch.zeros(1, 3, dtype=torch.float64)


def fit_windows(points: Tensor, axes: Tensor, margin: float, aspect: float) -> tuple[Tensor, Tensor]:
    """Targets (views, 3) and half-widths (views,) of the parallel views that just show the points."""
    local = points @ axes.mT  # (views, N, 3)
    low, high = local.amin(1), local.amax(1)
    centre, half = (low + high) / 2, (high - low) / 2
    half_widths = torch.maximum(half[:, 0], half[:, 1] * aspect) / (1 - 2 * margin)
    reach = 1e-6 * torch.linalg.vector_norm(half, dim=-1)
    half_widths = torch.maximum(half_widths, torch.where(reach > 0, reach, 1.0))
    return (centre[:, None] @ axes).squeeze(1), half_widths


def fit_eyes(points: Tensor, axes: Tensor, slopes: Tensor, margin: float, aspect: float) -> tuple[Tensor, Tensor]:
    """The closest eyes (views, 3) from which all points lie inside the picture but for its margin, and targets.

    A point is between the left and right planes if ``|x - eye_x| <= t (z - eye_z)``, z forward: the extremes of
    ``x - t z`` and ``-x - t z`` give the eye; likewise upwards.
    """
    local = points @ axes.mT
    low, high = local.amin(1), local.amax(1)
    reach = torch.linalg.vector_norm(high - low, dim=-1)
    reach = torch.where(reach > 0, reach, 1.0)
    eye, distances = torch.zeros_like(low), []
    for axis, factor in ((0, 1.0), (1, 1 / aspect)):
        t = (slopes * (1 - 2 * margin) * factor)[:, None]
        most = (local[..., axis] - t * local[..., 2]).amax(1)
        least = (-local[..., axis] - t * local[..., 2]).amax(1)
        eye[:, axis] = (most - least) / 2
        distances.append((most + least) / (2 * t[:, 0]))
    back = torch.stack([*distances, -low[:, 2] + 0.05 * reach]).amax(0)
    eye[:, 2] = -back
    target = torch.stack([eye[:, 0], eye[:, 1], torch.maximum((low + high)[:, 2] / 2, -back + 0.05 * reach)], dim=1)
    return (eye[:, None] @ axes).squeeze(1), (target[:, None] @ axes).squeeze(1)
