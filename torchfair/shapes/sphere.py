"""The sphere and its zones, with exact values at the poles too."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from torchfair.errors import TorchfairError

from ._checks import require_interval, require_positive
from ._forms import ShapeOperator, broadcast
from ._quadrature import Interval
from .revolution import Revolution


@dataclass(frozen=True)
class Sphere(Revolution):
    """Sphere of a given radius, or a zone of it; v is the latitude, normals point outwards. C = 8 pi R.

    Closed by default, with the poles as single points. Every direction is principal; ``d1`` is the direction
    of the parallel, also at the poles (where it depends on u).
    """

    radius: float = 1.0
    latitudes: Interval = (-math.pi / 2, math.pi / 2)

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(radius=self.radius)
        require_interval(latitudes=self.latitudes)
        if max(map(abs, self.latitudes)) > math.pi / 2 + 1e-12:
            raise TorchfairError(f"latitudes must lie between -pi/2 and pi/2, got {self.latitudes}")

    @property
    def meridian_range(self) -> Interval:
        """``latitudes``."""
        return self.latitudes

    @property
    def poles(self) -> tuple[bool, bool]:
        """Whether the zone reaches the south and the north pole."""
        south, north = self.latitudes
        return (south + math.pi / 2 < 1e-9, math.pi / 2 - north < 1e-9)

    def profile(self, v: Tensor) -> tuple[Tensor, Tensor]:
        """Distance from the axis and height, each as ``v`` (...)."""
        return self.radius * v.cos(), self.radius * v.sin()

    def normal(self, u: Tensor, v: Tensor) -> Tensor:
        """Outward unit normals ``(..., 3)``, right at the poles too."""
        return self.position(*broadcast(u, v)) / self.radius

    def frame(self, u: Tensor, v: Tensor) -> Tensor:
        """East and north ``(..., 2, 3)``."""
        u, v = broadcast(u, v)
        east = torch.stack([-u.sin(), u.cos(), torch.zeros_like(u)], dim=-1)
        return torch.stack([east, torch.linalg.cross(self.normal(u, v), east)], dim=-2)

    def principal_directions(self, u: Tensor, v: Tensor) -> Tensor:
        """East and north ``(..., 2, 3)``."""
        return self.frame(u, v)

    def principal_curvatures(self, u: Tensor, v: Tensor) -> Tensor:
        """``1/R`` twice, ``(..., 2)``."""
        return torch.full_like(broadcast(u, v)[0], 1 / self.radius)[..., None].repeat_interleave(2, -1)

    def line_curvatures(self, u: Tensor, v: Tensor) -> Tensor:
        """``1/R`` twice, ``(..., 2)``."""
        return self.principal_curvatures(u, v)

    def shape_operator(self, u: Tensor, v: Tensor) -> ShapeOperator:
        """``1/R`` times the identity."""
        curvature = self.principal_curvatures(u, v)[..., 0]
        return ShapeOperator(curvature, torch.zeros_like(curvature), curvature)

    def _line_integrals(self, v0: float, v1: float) -> tuple[float, float]:
        rise = self.radius * (math.sin(v1) - math.sin(v0))
        return rise, rise
