"""Where to look from and which stripes to look at when nobody says so."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ..cameras import OrthographicCamera
from ..cameras.fitting import look_axes
from ..geometry import face_area_vectors
from ..geometry._ops import norm
from .smooth_reference import SmoothReference
from .view_directions import axis_directions, cone_directions

_OPEN = 0.3
"""``|sum of area vectors| / area`` above which a mesh counts as a patch with one main side, not as a closed body."""
_CONE = 40.0
_VIEWS = 6


def default_camera(reference: SmoothReference, up: Tensor | None = None) -> OrthographicCamera:
    """Six parallel views that fit the reference; ``up`` (3,) appears vertical, by default z.

    Open patches are seen from within 40 degrees of their mean normal, the first view along it. Closed bodies are seen
    along six perpendicular directions, turned against the coordinate axes so that they do not run along the faces of
    buildings.
    """
    normal = mean_normal(reference)
    views = axis_directions(_turn()) if normal is None else cone_directions(-normal, _CONE, _VIEWS)
    return OrthographicCamera.fit(reference.vertices[reference.topology.corners], directions=views, ups=up)


def default_stripe_directions(reference: SmoothReference) -> Tensor:
    """Four directions across stripes, (4, 3).

    At 0, 45, 90 and 135 degrees around the mean normal of an open patch; along the diagonals of a cube for a
    closed body. A single direction misranks: the errors of a mesh may all lie in one plane.
    """
    normal = mean_normal(reference)
    if normal is None:
        signs = torch.tensor([[1.0, 1, 1], [1, 1, -1], [1, -1, 1], [-1, 1, 1]], dtype=torch.float64)
        return signs @ _turn().T
    right, up, _ = look_axes(normal[None], normal.new_tensor([[0.0, 0, 1]]))[0].unbind(0)
    turns = torch.arange(4, dtype=torch.float64)[:, None] * (math.pi / 4)
    return torch.cos(turns) * right + torch.sin(turns) * up


def mean_normal(reference: SmoothReference) -> Tensor | None:
    """Unit mean normal (3,) of an open patch, float64 on the CPU; None for a closed body or a mesh without area."""
    vectors = face_area_vectors(reference.vertices.detach(), reference.topology).to("cpu", torch.float64)
    total, area = vectors.sum(0), norm(vectors).sum()
    length = norm(total)
    if not bool(length > _OPEN * area):
        return None
    # Without rounding noise: it would decide where the first view of a horizontal patch has its right side.
    normal = (total / length).mul(1e6).round()
    return normal / norm(normal)


def _turn() -> Tensor:
    """Fixed perpendicular directions in general position, as rows."""
    forward = torch.tensor([[0.62, 0.35, -0.70]], dtype=torch.float64)
    return look_axes(forward, torch.tensor([[0.1, 0.6, 1.0]], dtype=torch.float64))[0]
