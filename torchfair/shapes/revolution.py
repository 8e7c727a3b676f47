"""Surfaces of revolution about the z-axis: u is the angle in radians, v runs along the meridian.

Parallels (u-lines) and meridians (v-lines) are principal curvature lines. Meridians run upwards, at least where
the surface is outermost, so normals point away from the axis, or out of the torus tube. For the profile
``(r(v), z(v))`` whose tangent has the angle theta, and a sector of ``du`` radians::

    integral of |k of the parallels| = du * integral of |dz|
    integral of |k of the meridians| = du * integral of r |dtheta|

All classes have closed forms of both and hence of C.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import KW_ONLY, dataclass

import torch
from torch import Tensor

from ._checks import is_full_turn, require_interval, require_positive
from ._quadrature import Domain, Interval
from .surface import FULL_TURN, Surface


@dataclass(frozen=True)
class Revolution(Surface):
    """Base class: a profile curve turned about the z-axis.

    Attributes:
        angles: range of u in radians; the surface closes up if it spans 2 pi (the default).
    """

    _: KW_ONLY
    angles: Interval = FULL_TURN

    def __post_init__(self) -> None:
        require_interval(2 * math.pi, angles=self.angles)

    @property
    @abstractmethod
    def meridian_range(self) -> Interval:
        """Range of v."""

    @abstractmethod
    def profile(self, v: Tensor) -> tuple[Tensor, Tensor]:
        """Distance from the axis and height, each as ``v`` (...)."""

    @abstractmethod
    def _line_integrals(self, v0: float, v1: float) -> tuple[float, float]:
        """Integrals of |dz| and of r |dtheta| between two parameters."""

    @property
    def domain(self) -> Domain:
        """``(angles, meridian_range)``."""
        return (self.angles, self.meridian_range)

    @property
    def periodic(self) -> tuple[bool, bool]:
        """Closed in u if ``angles`` spans a full turn."""
        return (is_full_turn(self.angles), False)

    @property
    def parameter_lines_are_principal(self) -> bool:
        """Always true."""
        return True

    def _position(self, u: Tensor, v: Tensor) -> Tensor:
        radius, height = self.profile(v)
        return torch.stack([radius * u.cos(), radius * u.sin(), height], dim=-1)

    def absolute_line_curvatures(self, domain: Domain | None = None) -> tuple[float, float]:
        """Integrals of ``|k|`` of the parallels and of the meridians, in closed form."""
        (u0, u1), (v0, v1) = self.checked_domain(domain)
        parallels, meridians = self._line_integrals(v0, v1)
        return (u1 - u0) * parallels, (u1 - u0) * meridians


@dataclass(frozen=True)
class Torus(Revolution):
    """Torus; v is the angle around the tube, zero on the outer equator; normals out of the tube.

    C = 4 pi^2 R + 8 pi r. ``tube_angles=(pi / 2, 3 * pi / 2)`` is the inner, negatively curved half.
    """

    major_radius: float = 2.0
    minor_radius: float = 0.8
    tube_angles: Interval = FULL_TURN

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(minor_radius=self.minor_radius)
        require_positive(**{"major_radius less minor_radius": self.major_radius - self.minor_radius})
        require_interval(2 * math.pi, tube_angles=self.tube_angles)

    @property
    def meridian_range(self) -> Interval:
        """``tube_angles``."""
        return self.tube_angles

    @property
    def periodic(self) -> tuple[bool, bool]:
        """Closed where the angles span a full turn."""
        return (is_full_turn(self.angles), is_full_turn(self.tube_angles))

    def profile(self, v: Tensor) -> tuple[Tensor, Tensor]:
        """Distance from the axis and height, each as ``v`` (...)."""
        return self.major_radius + self.minor_radius * v.cos(), self.minor_radius * v.sin()

    def _line_integrals(self, v0: float, v1: float) -> tuple[float, float]:
        parallels = self.minor_radius * (_integral_of_abs_cos(v1) - _integral_of_abs_cos(v0))
        return parallels, self.major_radius * (v1 - v0) + self.minor_radius * (math.sin(v1) - math.sin(v0))


def _integral_of_abs_cos(angle: float) -> float:
    half_turns = math.floor(angle / math.pi + 0.5)
    return 2 * half_turns + math.sin(angle - half_turns * math.pi)


@dataclass(frozen=True)
class Cone(Revolution):
    """Cone frustum between two radii, v the height from 0 to ``height``; normals outwards. C = 2 pi height."""

    bottom_radius: float = 1.0
    top_radius: float = 0.5
    height: float = 1.5

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(bottom_radius=self.bottom_radius, top_radius=self.top_radius, height=self.height)

    @property
    def meridian_range(self) -> Interval:
        """``(0, height)``."""
        return (0.0, self.height)

    def profile(self, v: Tensor) -> tuple[Tensor, Tensor]:
        """Distance from the axis and height, each as ``v`` (...)."""
        return self.bottom_radius + (self.top_radius - self.bottom_radius) / self.height * v, v

    def _line_integrals(self, v0: float, v1: float) -> tuple[float, float]:
        return v1 - v0, 0.0


@dataclass(frozen=True)
class Cylinder(Revolution):
    """Cylinder, v the height from 0 to ``height``; normals outwards. C = 2 pi height."""

    radius: float = 1.0
    height: float = 2.0

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(radius=self.radius, height=self.height)

    @property
    def meridian_range(self) -> Interval:
        """``(0, height)``."""
        return (0.0, self.height)

    def profile(self, v: Tensor) -> tuple[Tensor, Tensor]:
        """Distance from the axis and height, each as ``v`` (...)."""
        return torch.full_like(v, self.radius), v

    def _line_integrals(self, v0: float, v1: float) -> tuple[float, float]:
        return v1 - v0, 0.0


@dataclass(frozen=True)
class Catenoid(Revolution):
    """Catenoid ``r = waist cosh(z / waist)``, v = z; normals away from the axis. C = 4 pi (z1 - z0)."""

    waist: float = 1.0
    heights: Interval = (-1.0, 1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(waist=self.waist)
        require_interval(heights=self.heights)

    @property
    def meridian_range(self) -> Interval:
        """``heights``."""
        return self.heights

    def profile(self, v: Tensor) -> tuple[Tensor, Tensor]:
        """Distance from the axis and height, each as ``v`` (...)."""
        return self.waist * (v / self.waist).cosh(), v

    def _line_integrals(self, v0: float, v1: float) -> tuple[float, float]:
        return v1 - v0, v1 - v0


@dataclass(frozen=True)
class Hyperboloid(Revolution):
    """One-sheeted hyperboloid ``(x^2 + y^2) / waist^2 - z^2 / steepness^2 = 1``; normals away from the axis.

    ``r = waist cosh v``, ``z = steepness sinh v``: far away the slope is ``steepness / waist``. C has a closed
    form in arc tangents.
    """

    waist: float = 1.0
    steepness: float = 1.0
    heights: Interval = (-1.0, 1.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        require_positive(waist=self.waist, steepness=self.steepness)
        require_interval(heights=self.heights)

    @property
    def meridian_range(self) -> Interval:
        """``asinh(heights / steepness)``."""
        low, high = self.heights
        return (math.asinh(low / self.steepness), math.asinh(high / self.steepness))

    def profile(self, v: Tensor) -> tuple[Tensor, Tensor]:
        """Distance from the axis and height, each as ``v`` (...)."""
        return self.waist * v.cosh(), self.steepness * v.sinh()

    def _line_integrals(self, v0: float, v1: float) -> tuple[float, float]:
        s0, s1 = math.sinh(v0), math.sinh(v1)
        q = math.hypot(1.0, self.waist / self.steepness)
        turn = self.waist**2 / (self.steepness * q) * (math.atan(q * s1) - math.atan(q * s0))
        return self.steepness * (s1 - s0), turn
