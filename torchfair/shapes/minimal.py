"""Two classical minimal surfaces beside the catenoid, in isothermal parameters (``x_u.x_v = 0, |x_u| = |x_v|``)."""

from __future__ import annotations

import math
from dataclasses import dataclass

import torch
from torch import Tensor

from ._checks import require_finite, require_interval, require_positive
from ._quadrature import Domain, Interval
from .surface import Surface

_SQRT_HALF = math.sqrt(0.5)


@dataclass(frozen=True)
class Enneper(Surface):
    """Enneper's surface over the square ``|u|, |v| <= extent``; normal up (+z) at the origin.

    Parameter lines are principal. ``C = 4 du dv``, that is ``16 extent^2``. Self-intersections start where
    ``u^2 + v^2 > 3``, so the square is embedded for ``extent < sqrt(3/2)``; larger ones are allowed.
    """

    extent: float = 0.8

    def __post_init__(self) -> None:
        require_positive(extent=self.extent)

    @property
    def domain(self) -> Domain:
        """The square."""
        return ((-self.extent, self.extent), (-self.extent, self.extent))

    @property
    def parameter_lines_are_principal(self) -> bool:
        """Always true."""
        return True

    def _position(self, u: Tensor, v: Tensor) -> Tensor:
        x = u - u**3 / 3 + u * v**2
        y = v - v**3 / 3 + v * u**2
        return torch.stack([x, y, u**2 - v**2], dim=-1)

    def absolute_line_curvatures(self, domain: Domain | None = None) -> tuple[float, float]:
        """Twice the parameter area for either family."""
        (u0, u1), (v0, v1) = self.checked_domain(domain)
        half = 2 * (u1 - u0) * (v1 - v0)
        return half, half


@dataclass(frozen=True)
class Helicoid(Surface):
    """Helicoid ``(r cos u, r sin u, pitch u)`` with ``r = pitch sinh v``: rulings and helices as boundary.

    Parameter lines are its asymptotic curves, not principal; see :class:`PrincipalHelicoid`. The normal is
    ``(-sin u, cos u, 0)`` on the axis (for positive pitch). ``C = 2 |pitch| du dv``.

    Attributes:
        pitch: height per radian, not zero.
        radii: range of the signed distance r from the axis along the rulings.
        angles: range of u in radians.
    """

    pitch: float = 0.5
    radii: Interval = (-1.0, 1.0)
    angles: Interval = (-math.pi / 2, math.pi / 2)

    def __post_init__(self) -> None:
        _require_pitch(self.pitch)
        require_interval(radii=self.radii)
        require_interval(angles=self.angles)

    @property
    def domain(self) -> Domain:
        """Angles, and ``asinh(r / |pitch|)``."""
        low, high = self.radii
        return (self.angles, (math.asinh(low / abs(self.pitch)), math.asinh(high / abs(self.pitch))))

    def _position(self, u: Tensor, v: Tensor) -> Tensor:
        return _helicoid(self.pitch, u, v)

    def total_absolute_curvature(self, domain: Domain | None = None) -> float:
        """C in closed form, ``2 |pitch| du dv``."""
        (u0, u1), (v0, v1) = self.checked_domain(domain)
        return 2 * abs(self.pitch) * (u1 - u0) * (v1 - v0)


@dataclass(frozen=True)
class PrincipalHelicoid(Surface):
    """The helicoid over a square of its principal parameters, at 45 degrees to rulings and helices.

    With s, t in ``[-extent, extent]`` the angle is ``(s - t) / sqrt 2`` and ``asinh(r / pitch) = (s + t) / sqrt 2``.
    ``C = 2 |pitch| ds dt``. Normals as for :class:`Helicoid`.
    """

    pitch: float = 0.5
    extent: float = 1.2

    def __post_init__(self) -> None:
        _require_pitch(self.pitch)
        require_positive(extent=self.extent)

    @property
    def domain(self) -> Domain:
        """The square."""
        return ((-self.extent, self.extent), (-self.extent, self.extent))

    @property
    def parameter_lines_are_principal(self) -> bool:
        """Always true."""
        return True

    def _position(self, u: Tensor, v: Tensor) -> Tensor:
        return _helicoid(self.pitch, (u - v) * _SQRT_HALF, (u + v) * _SQRT_HALF)

    def absolute_line_curvatures(self, domain: Domain | None = None) -> tuple[float, float]:
        """``|pitch| ds dt`` for either family."""
        (u0, u1), (v0, v1) = self.checked_domain(domain)
        half = abs(self.pitch) * (u1 - u0) * (v1 - v0)
        return half, half


def _helicoid(pitch: float, angle: Tensor, stretch: Tensor) -> Tensor:
    radius = abs(pitch) * stretch.sinh()
    return torch.stack([radius * angle.cos(), radius * angle.sin(), pitch * angle], dim=-1)


def _require_pitch(pitch: float) -> None:
    require_finite(pitch=pitch)
    require_positive(**{"|pitch|": abs(pitch)})
