"""The base class of analytic surfaces."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod

import torch
from torch import Tensor

from torchfair.errors import TorchfairError

from . import _forms
from ._quadrature import Domain, Integrand, Interval, integrate, integrate_with_kink

FULL_TURN: Interval = (0.0, 2 * math.pi)


class Surface(ABC):
    r"""An analytic surface ``x(u, v)`` over a rectangle of parameters.

    Methods take parameter tensors ``u, v`` of shapes that broadcast to ``(...)`` (floating; float64 for exact
    values) and work point by point, so they are vectorised, run on any device and can be differentiated.
    Derivatives of the parametrisation are exact: forward-mode automatic differentiation, or closed forms.
    Curvatures are not differentiable at umbilics; there automatic differentiation gives the derivative of their mean.

    Orientation: the unit normal is the direction of ``x_u`` cross ``x_v``; each surface says which side that
    is. Curvatures are **positive where the surface is convex seen from the side its normal points to**: a
    sphere with outward normals has ``k = +1/R``. Then ``dn = k dx`` along principal directions, the signs agree
    with :func:`torchfair.geometry.dihedral_angles`, and ``(k1 + k2) / 2`` integrates to the total mean
    curvature ``1/2 sum l a``.

    Lengths are in the unit of the surface's own arguments, curvatures in one over that unit.

    A new surface defines :attr:`domain` and ``_position(u, v)``, and overrides what it knows in closed form.
    """

    @property
    @abstractmethod
    def domain(self) -> Domain:
        """The parameter rectangle ``((u0, u1), (v0, v1))``."""

    @abstractmethod
    def _position(self, u: Tensor, v: Tensor) -> Tensor:
        """Points ``(..., 3)`` for parameters of one shape, each depending on its own parameters only."""

    @property
    def periodic(self) -> tuple[bool, bool]:
        """Whether the surface closes up in u and in v; the period is the length of the range."""
        return (False, False)

    @property
    def poles(self) -> tuple[bool, bool]:
        """Whether the u-line at the start and at the end of the v range shrinks to one point."""
        return (False, False)

    @property
    def parameter_lines_are_principal(self) -> bool:
        """Whether the u-lines and v-lines are the principal curvature lines."""
        return False

    # ---- first order -----------------------------------------------------------------------------------

    def position(self, u: Tensor, v: Tensor) -> Tensor:
        """Points ``(..., 3)`` at parameters ``u`` and ``v`` (...), which broadcast."""
        return self._position(*_forms.broadcast(u, v))

    def tangents(self, u: Tensor, v: Tensor) -> tuple[Tensor, Tensor]:
        """Partial derivatives ``x_u, x_v`` ``(..., 3)``, not unit, at parameters ``u`` and ``v`` (...)."""
        return _forms.tangents(self._position, *_forms.broadcast(u, v))

    def normal(self, u: Tensor, v: Tensor) -> Tensor:
        """Unit normals ``(..., 3)`` along ``x_u`` cross ``x_v``, at parameters ``u`` and ``v`` (...)."""
        return _forms.unit(torch.linalg.cross(*self.tangents(u, v)))

    def frame(self, u: Tensor, v: Tensor) -> Tensor:
        """Orthonormal tangent vectors ``(..., 2, 3)`` at parameters ``u`` and ``v`` (...).

        The first is along the u-line, the second 90 degrees to its left.
        """
        along = _forms.unit(self.tangents(u, v)[0])
        return torch.stack([along, torch.linalg.cross(self.normal(u, v), along)], dim=-2)

    def area_element(self, u: Tensor, v: Tensor) -> Tensor:
        """Area per unit of ``du dv``, ``(...)``, at parameters ``u`` and ``v`` (...)."""
        area: Tensor = torch.linalg.vector_norm(torch.linalg.cross(*self.tangents(u, v)), dim=-1)
        return area

    # ---- second order ----------------------------------------------------------------------------------

    def _partials(self, u: Tensor, v: Tensor) -> _forms.Partials:
        """Derivatives up to order two for parameters of one shape; surfaces may replace it by closed forms."""
        return _forms.partials(self._position, u, v)

    def fundamental_forms(self, u: Tensor, v: Tensor) -> tuple[Tensor, Tensor]:
        """Both fundamental forms, ``(..., 3)`` each, at parameters ``u`` and ``v`` (...).

        The first is ``x_u.x_u, x_u.x_v, x_v.x_v``, the second ``n_u.x_u, n_u.x_v, n_v.x_v``: positive where
        the surface is convex.
        """
        return _forms.fundamental_forms(self._partials(*_forms.broadcast(u, v)))

    def shape_operator(self, u: Tensor, v: Tensor) -> _forms.ShapeOperator:
        """Entries ``uu, uv, vv`` (each ``(...)``) of the shape operator.

        They are those in the :meth:`frame` at parameters ``u`` and ``v`` (...).
        """
        return _forms.shape_operator(*self.fundamental_forms(u, v))

    def line_curvatures(self, u: Tensor, v: Tensor) -> Tensor:
        """Normal curvatures ``(..., 2)`` of both lines at parameters ``u`` and ``v`` (...).

        The u-line comes first; signed as the principal ones.
        """
        first, second = self.fundamental_forms(u, v)
        return second[..., ::2] / first[..., ::2]

    def principal_curvatures(self, u: Tensor, v: Tensor) -> Tensor:
        """Principal curvatures ``(..., 2)``, signed, ``k1 >= k2``, at parameters ``u`` and ``v`` (...)."""
        return _forms.eigenvalues(self.shape_operator(u, v))

    def principal_directions(self, u: Tensor, v: Tensor) -> Tensor:
        """Unit principal directions ``(..., 2, 3)`` at parameters ``u`` and ``v`` (...).

        In the order of :meth:`principal_curvatures`.

        ``d1, d2, n`` is right-handed; the common sign of ``d1, d2`` has no meaning. At umbilics, where every
        direction is principal, ``d1`` is the direction of the u-line.
        """
        angle = _forms.eigen_angle(self.shape_operator(u, v))[..., None]
        along, left = self.frame(u, v).unbind(-2)
        cos, sin = angle.cos(), angle.sin()
        return torch.stack([cos * along + sin * left, cos * left - sin * along], dim=-2)

    def gaussian_curvature(self, u: Tensor, v: Tensor) -> Tensor:
        """Gaussian curvature ``K = k1 k2``, ``(...)``, at parameters ``u`` and ``v`` (...)."""
        s = self.shape_operator(u, v)
        return s.uu * s.vv - s.uv**2

    # ---- integrals -------------------------------------------------------------------------------------

    def integrate(self, integrand: Integrand, domain: Domain | None = None) -> float:
        """Integral of a smooth ``integrand(u, v)`` over the surface, with its area element.

        Gauss-Legendre panels of ten nodes, halved until the result is steady to 1e-12 (at most 320 x 320 nodes).
        Pass sub-rectangles where the integrand has kinks.

        Raises:
            TorchfairError: if ``domain`` is not a rectangle inside the one of the surface.
        """
        return integrate(lambda u, v: integrand(u, v) * self.area_element(u, v), self.checked_domain(domain))

    def area(self, domain: Domain | None = None) -> float:
        """Area of the surface over ``domain`` (by default all of it). Errors as :meth:`integrate`."""
        return integrate(self.area_element, self.checked_domain(domain))

    def absolute_line_curvatures(self, domain: Domain | None = None) -> tuple[float, float]:
        """Integrals of ``|k|`` of the u-lines and of the v-lines over ``domain``.

        Where parameter lines are principal these are the two parts of the total absolute curvature. Closed
        form where the surface has one, otherwise quadrature cut where the sign changes, with relative error 1e-7.
        """
        checked = self.checked_domain(domain)

        def part(line: int) -> float:
            def density(u: Tensor, v: Tensor) -> Tensor:
                first, second = self.fundamental_forms(u, v)
                curvature = second[..., 2 * line] / first[..., 2 * line]
                return curvature.abs() * _forms.area_element(first)

            return integrate_with_kink(density, lambda u, v: self.line_curvatures(u, v)[..., line], checked)

        return part(0), part(1)

    def total_absolute_curvature(self, domain: Domain | None = None) -> float:
        """C: the integral of ``|k1| + |k2|`` over ``domain`` (by default the whole surface). A length.

        Closed form where the surface has one (its class says so); otherwise quadrature whose panels are cut
        where K changes its sign, because ``|k1| + |k2|`` has a kink there: relative error about 1e-7. Paper
        section 4. Errors as :meth:`integrate`.
        """
        if self.parameter_lines_are_principal:
            return sum(self.absolute_line_curvatures(domain))

        def density(u: Tensor, v: Tensor) -> Tensor:
            first, second = self.fundamental_forms(u, v)
            curvatures = _forms.eigenvalues(_forms.shape_operator(first, second))
            return curvatures.abs().sum(-1) * _forms.area_element(first)

        return integrate_with_kink(density, self.gaussian_curvature, self.checked_domain(domain))

    def checked_domain(self, domain: Domain | None) -> Domain:
        """``domain`` itself, or the whole rectangle for None, after checking that the surface covers it.

        Raises:
            TorchfairError: if a range is empty or sticks out. In periodic directions any range no longer
                than the period is inside.
        """
        if domain is None:
            return self.domain
        for name, wanted, own, periodic in zip("uv", domain, self.domain, self.periodic, strict=True):
            slack = 1e-9 * (own[1] - own[0])
            inside = own[0] - slack <= wanted[0] and wanted[1] <= own[1] + slack
            fits = wanted[1] - wanted[0] <= own[1] - own[0] + slack
            if not wanted[0] < wanted[1] or not (fits if periodic else inside):
                raise TorchfairError(
                    f"domain: the {name} range {wanted} is not inside {own} of {type(self).__name__}. "
                    "Give ((u0, u1), (v0, v1)) with u0 < u1 and v0 < v1 inside surface.domain."
                )
        return domain
