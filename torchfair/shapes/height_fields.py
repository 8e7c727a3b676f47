"""Height fields ``z(x, y)`` with upward normals: paraboloids and a free-form patch.

With upward normals a bowl is concave and has **negative** curvatures, a hill positive ones.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from torchfair.errors import TorchfairError

from ._checks import is_integer_from, require_finite, require_positive
from ._forms import Partials
from ._quadrature import Domain
from .surface import Surface


@dataclass(frozen=True)
class Paraboloid(Surface):
    """``z = (a x^2 + b y^2) / 2`` over ``|x| <= half_widths[0], |y| <= half_widths[1]``, with u = x and v = y.

    Principal curvatures at the origin are ``-a`` along x and ``-b`` along y (normals point up). The parameter
    lines are principal on the axes and for ``a b = 0`` only; see :class:`PrincipalParaboloid`. C by quadrature.
    """

    a: float = 1.0
    b: float = -0.5
    half_widths: tuple[float, float] = (1.0, 1.0)

    def __post_init__(self) -> None:
        require_finite(a=self.a, b=self.b)
        require_positive(**{"half_widths[0]": self.half_widths[0], "half_widths[1]": self.half_widths[1]})

    @property
    def domain(self) -> Domain:
        """The rectangle in x and y."""
        x, y = self.half_widths
        return ((-x, x), (-y, y))

    @property
    def parameter_lines_are_principal(self) -> bool:
        """True for parabolic cylinders (``a b = 0``) only."""
        return self.a * self.b == 0

    def _position(self, u: Tensor, v: Tensor) -> Tensor:
        return _paraboloid(self.a, self.b, u, v)


@dataclass(frozen=True)
class PrincipalParaboloid(Surface):
    """``z = (a x^2 + b y^2) / 2`` in parameters whose lines are its principal curvature lines.

    Those lines are cut out by confocal paraboloids. With ``p = 1/|a|``, ``q = 1/|b|``::

        a b < 0:             D = p + q,  x = sqrt(p D) sinh s cosh t,  y = sqrt(q D) cosh s sinh t
        a b > 0, |a| > |b|:  D = q - p,  x = sqrt(p D) sin s cosh t,   y = sqrt(q D) cos s sinh t

    (x and y exchanged for ``|a| < |b|``; ``x = u, y = v`` for ``a b = 0``). Parameters are scaled to
    ``u = sqrt(p D) s`` and ``v = sqrt(q D) t``, so that near the origin ``x = u`` and ``y = v``. The patch meets
    the axes at ``x = +-half_widths[0]`` and ``y = +-half_widths[1]``. For ``a b > 0`` it must end before the
    umbilics, which lie on the axis of the larger curvature at distance ``sqrt(p |q - p|)``.

    Raises:
        TorchfairError: for ``a = b`` (all meridians meet in the apex) and for patches that reach an umbilic.
    """

    a: float = 1.0
    b: float = -0.5
    half_widths: tuple[float, float] = (1.0, 1.0)

    def __post_init__(self) -> None:
        Paraboloid(self.a, self.b, self.half_widths)  # the same checks
        if self.a == self.b != 0:
            raise TorchfairError(
                f"a = b = {self.a}: the principal curvature lines of a paraboloid of revolution all meet in its "
                "apex. Choose a != b, or use Paraboloid, whose lattice is not principal."
            )
        if self.a * self.b > 0:
            steep = 0 if abs(self.a) > abs(self.b) else 1
            limit = self._scales[steep]
            if self.half_widths[steep] >= limit:
                raise TorchfairError(
                    f"half_widths[{steep}] = {self.half_widths[steep]} reaches the umbilic at {limit:.6g}. "
                    "Make the patch smaller, or the curvatures a and b more different."
                )

    @property
    def _scales(self) -> tuple[float, float]:
        p, q = 1 / abs(self.a), 1 / abs(self.b)
        spread = p + q if self.a * self.b < 0 else abs(p - q)
        return (math.sqrt(p * spread), math.sqrt(q * spread))

    @property
    def domain(self) -> Domain:
        """The rectangle in u and v."""
        if self.a * self.b == 0:
            return Paraboloid(self.a, self.b, self.half_widths).domain
        ends = []
        for axis, (width, scale) in enumerate(zip(self.half_widths, self._scales, strict=True)):
            steep = abs((self.a, self.b)[axis]) > abs((self.a, self.b)[1 - axis])
            inverse = math.asin if self.a * self.b > 0 and steep else math.asinh
            ends.append(scale * inverse(width / scale))
        return ((-ends[0], ends[0]), (-ends[1], ends[1]))

    @property
    def parameter_lines_are_principal(self) -> bool:
        """Always true."""
        return True

    def _position(self, u: Tensor, v: Tensor) -> Tensor:
        if self.a * self.b == 0:
            return _paraboloid(self.a, self.b, u, v)
        p, q = self._scales
        s, t = u / p, v / q
        if self.a * self.b < 0:
            x, y = s.sinh() * t.cosh(), s.cosh() * t.sinh()
        elif abs(self.a) > abs(self.b):
            x, y = s.sin() * t.cosh(), s.cos() * t.sinh()
        else:
            x, y = s.sinh() * t.cos(), s.cosh() * t.sin()
        return _paraboloid(self.a, self.b, p * x, q * y)


def _paraboloid(a: float, b: float, x: Tensor, y: Tensor) -> Tensor:
    return torch.stack([x, y, 0.5 * (a * x**2 + b * y**2)], dim=-1)


_WAVES = 4
_SHARE = 0.25  # of the patch that must have K > 0, and as much K < 0


@dataclass(frozen=True)
class FreeFormPatch(Surface):
    """Smooth height field of four random waves over a square, on which K changes its sign; u = x, v = y.

    Waves are drawn from ``seed`` until at least a quarter of the square has K > 0 and another K < 0; the same
    seed gives the same patch. Parameter lines are not principal. C by quadrature.

    Attributes:
        seed: of the random generator; an integer from 0 on.
        half_width: half the side of the square.
        amplitude: bound of the height; the waves are scaled to it.
    """

    seed: int = 0
    half_width: float = 1.0
    amplitude: float = 0.5

    def __post_init__(self) -> None:
        require_positive(half_width=self.half_width, amplitude=self.amplitude)
        if not is_integer_from(0, self.seed):
            raise TorchfairError(f"seed must be an integer of at least 0, got {self.seed!r}")

    @property
    def domain(self) -> Domain:
        """The square."""
        return ((-self.half_width, self.half_width), (-self.half_width, self.half_width))

    def _position(self, u: Tensor, v: Tensor) -> Tensor:
        k, m, phase, size = self._waves.to(u).unbind(-1)
        angle = u[..., None] * k + v[..., None] * m + phase
        return torch.stack([u, v, (size * angle.cos()).sum(-1)], dim=-1)

    def _partials(self, u: Tensor, v: Tensor) -> Partials:
        k, m, phase, size = self._waves.to(u).unbind(-1)
        angle = u[..., None] * k + v[..., None] * m + phase
        slope, bend = -size * angle.sin(), -size * angle.cos()
        one, zero = torch.ones_like(u), torch.zeros_like(u)
        heights = [slope @ k, slope @ m, bend @ (k * k), bend @ (k * m), bend @ (m * m)]
        flat = [(one, zero), (zero, one), (zero, zero), (zero, zero), (zero, zero)]
        return Partials(*(torch.stack([x, y, z], dim=-1) for (x, y), z in zip(flat, heights, strict=True)))

    @cached_property
    def _waves(self) -> Tensor:
        """(4, 4): for each wave the wave vector, the phase and the height."""
        random = np.random.default_rng(self.seed)
        while True:
            length, turn = random.uniform(1.5, 4.0, _WAVES), random.uniform(0, 2 * math.pi, _WAVES)
            size = random.uniform(0.5, 1.0, _WAVES)
            phase = random.uniform(0, 2 * math.pi, _WAVES)
            size *= self.amplitude / size.sum()
            vector = length * np.stack([np.cos(turn), np.sin(turn)]) / self.half_width
            waves = np.stack([*vector, phase, size], axis=1)
            if _curvature_changes_sign(waves, self.half_width):
                return torch.from_numpy(waves)


def _curvature_changes_sign(waves: npt.NDArray[np.float64], half_width: float) -> bool:
    """Whether ``z_xx z_yy - z_xy^2`` has each sign on at least a quarter of a grid."""
    grid = half_width * np.linspace(-1, 1, 25)
    x, y = np.meshgrid(grid, grid, indexing="ij")
    k, m, phase, size = waves.T[:, :, None, None]
    bend = -size * np.cos(k * x + m * y + phase)
    determinant = (k**2 * bend).sum(0) * (m**2 * bend).sum(0) - (k * m * bend).sum(0) ** 2
    return bool(min((determinant > 0).mean(), (determinant < 0).mean()) >= _SHARE)
