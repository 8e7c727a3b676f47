r"""Saddle sides of principal-symmetric stars (paper section 5.2): principal neighbours lie beyond the tangent plane.

The paper asks that, where the angle sum is above 2 pi, principal neighbours lie on one side of the tangent plane of
the sphere and cospherical ones on the other. That leaves stars near parabolic curves of the surface, where principal
polylines are curved sideways, in one half-plane: not saddle-shaped, with a self-intersecting pyramid. Saddle-shaped
they are if the principal neighbours lie beyond the planes of both faces without a principal edge too, v w2 w3 and
v w5 w6::

        w3    w2
          \  /
    w4 --- v --- w1
          /  \
        w5    w6

A star near a parabolic curve may as well lose its negative curvature; which of the two is nearer is decided in
:meth:`SaddleSides.decide`, for each star that is wrong.
"""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import torch
from torch import Tensor

from ..geometry._ops import cross, norm
from ..principal.principal_edges import PrincipalStars
from ..projection import ElementTerm, OneSided, Squares
from ..projection.layout import State
from .base import Constraint
from .principal_symmetric import star_stencil
from .side_curvatures import angle_excess, angle_excess_derivative, side_curvatures, side_curvatures_derivative
from .star_stencils import by_vertices

SADDLE_SIDES = "saddle sides"
_NEGATIVE = 1e-9  # radians by which the angle sum is above 2 pi where curvature counts as negative
_RECONSIDERED = 8.0  # factor of a changed preference
_FLATTEST = 1e-2  # curvature times edge length below which a sphere counts as this


def is_negative(x: Tensor) -> Tensor:
    """(n,) bool: stars ``x`` (n, 7, 3) of negative curvature, with an angle sum above 2 pi."""
    return angle_excess(x) > _NEGATIVE


def beyond_tangent_plane(x: Tensor) -> Tensor:
    """(n,) bool: w1 and w4 lie on the other side of the tangent plane of the sphere than w2, w3, w5, w6."""
    sides, spheres = side_curvatures(x)
    return _beyond(sides[:, :2], spheres)


class SaddleSides:
    """For every star what it is to be: saddle-shaped, or not negatively curved.

    Args:
        stars: Regular vertices.
        margin: How far beyond the bounds stars are pushed, in curvatures of their spheres.
        block: Name of the vertex block.
    """

    def __init__(self, stars: PrincipalStars, *, margin: float = 0.05, block: str = "vertices") -> None:
        self.stars, self.margin, self.block = stars, margin, block
        self.stencil = star_stencil(stars)
        self.is_saddle = torch.zeros_like(stars.vertices, dtype=torch.bool)
        self._preference = torch.ones_like(stars.vertices, dtype=torch.float64)
        self._data: tuple[Tensor, ...] = ()

    def decide(self, vertices: Tensor) -> int:
        """Decides at ``vertices`` (V, 3), for the terms from now on.

        Stars whose angle sum is at most 2 pi are to stay so; those above 2 pi are to be saddle-shaped, with the sign
        of the curvature of the sphere that takes the smaller change of curvatures; unless it takes a smaller one to
        bring the angle sum below 2 pi.

        Returns:
            How many stars are to be something else than decided before.
        """
        x = vertices[self.stencil]
        before = self._data
        sides, spheres = side_curvatures(x)
        scale = torch.maximum(spheres.abs(), sides.abs().mean(1)).clamp_min(_FLATTEST)
        as_it_is, as_faces_ask = _sign(spheres), -_sign(sides.mean(1))
        keep, turn = (
            (sign[:, None] * sides).amax(1).clamp_min(0.0) + (-sign * spheres).clamp_min(0.0)
            for sign in (as_it_is, as_faces_ask)
        )
        sign = torch.where(turn < keep, as_faces_ask, as_it_is)
        spokes = x[:, 1:] - x[:, :1]
        area = norm(cross(spokes, spokes.roll(-1, 1))).sum(1) / 6.0
        excess = angle_excess(x)
        self.is_saddle = (excess > 0.0) & (torch.minimum(keep, turn) <= self._preference * excess / (area * scale))
        self._data = (self.is_saddle.to(x.dtype), sign / scale, 1.0 / (scale * scale * area))
        if not before:
            return self.is_saddle.shape[0]
        turned = torch.sign(before[1]) != sign
        return int(((before[0] > 0.0) ^ self.is_saddle | self.is_saddle & turned).sum())

    def forget(self) -> None:
        """Back to decisions by the smaller change alone."""
        self._preference.fill_(1.0)

    def reconsider(self, vertices: Tensor) -> None:
        """Makes the other decision likelier at stars that are wrong at ``vertices`` (V, 3)."""
        wrong = self.are_wrong(vertices)
        factor = torch.where(self.is_saddle, 1.0 / _RECONSIDERED, _RECONSIDERED).to(self._preference)
        self._preference = torch.where(wrong, factor * self._preference, self._preference)

    def are_wrong(self, vertices: Tensor) -> Tensor:
        """(R,) bool: stars with an angle sum above 2 pi that are not saddle-shaped at ``vertices`` (V, 3)."""
        x = vertices[self.stencil]
        return _are_wrong(*side_curvatures(x), angle_excess(x))

    def count_wrong(self, vertices: Tensor) -> int:
        """How many stars are wrong at ``vertices`` (V, 3), see :meth:`are_wrong`."""
        return int(self.are_wrong(vertices).sum())

    def __call__(self, state: State) -> tuple[Tensor, ...]:
        """Data of the terms."""
        if not self._data:
            self.decide(state[self.block])
        return self._data

    def lacking(
        self, x: Tensor, is_saddle: Tensor, per_curvature: Tensor, per_excess: Tensor, *, share: float
    ) -> Tensor:
        """By how much stars ``x`` (n, 7, 3) miss what they are to be, (n, 8), in curvatures of the star.

        Negative where they are; what does not matter is zero. ``is_saddle``, ``per_curvature`` and ``per_excess``
        (n,) say what each star is to be, and in which unit.
        """
        beyond, spheres = side_curvatures(x)
        margin = share * self.margin
        sides = margin + per_curvature[:, None] * beyond
        bent = 0.4 * margin - per_curvature * spheres
        excess = 0.4 * margin + per_excess * angle_excess(x)
        saddle = torch.cat([sides, bent[:, None]], dim=1)
        return torch.cat([is_saddle[:, None] * saddle, ((1.0 - is_saddle) * excess)[:, None]], dim=1)

    def lacking_derivative(self, x: Tensor, is_saddle: Tensor, per_curvature: Tensor, per_excess: Tensor) -> Tensor:
        """Jacobians (n, 8, 21) of :meth:`lacking`, with the same arguments as for that."""
        sides, spheres = side_curvatures_derivative(x)
        saddle = torch.cat([sides, -spheres[:, None]], dim=1) * (is_saddle * per_curvature)[:, None, None, None]
        other = ((1.0 - is_saddle) * per_excess)[:, None, None] * angle_excess_derivative(x)
        return by_vertices(torch.cat([saddle, other[:, None]], dim=1))

    def terms(self, *, weight: float, share: float = 1.0, ahead: bool = True) -> list[ElementTerm]:
        """Inequalities of every star.

        Args:
            weight: Of half the squares; dimensionless.
            share: Of the margin.
            ahead: Whether steps heed inequalities that hold and would not hold after them. Otherwise stars may easily
                become something else than decided.
        """
        lacking = partial(self.lacking, share=share)

        def broken(*arguments: Tensor) -> Tensor:
            return torch.relu(lacking(*arguments))

        def broken_derivative(*arguments: Tensor) -> Tensor:
            return (lacking(*arguments) > 0.0)[..., None] * self.lacking_derivative(*arguments)

        term = ElementTerm(
            SADDLE_SIDES,
            lacking,
            [(self.block, self.stencil)],
            weight=weight,
            loss=OneSided(),
            refresh=self,
            jacobian=self.lacking_derivative,
            batched=True,
        )
        return [term if ahead else replace(term, residual=broken, jacobian=broken_derivative, loss=Squares())]


class SaddleShape(Constraint):
    """Module form of :class:`SaddleSides`: half the sum of squares of what stars lack, dimensionless.

    What each star is to be is decided at given vertices and kept, so that the value is continuous; make another module
    to decide again. Zero where all stars are what they are to be, by ``margin``; unchanged by rigid motions.

    Args:
        stars: Regular vertices.
        vertices: (V, 3) where it is decided.
        margin: As of :class:`SaddleSides`.

    Example:
        >>> import torch
        >>> from torchfair.constraints import SaddleShape
        >>> from torchfair.principal import principal_edges_of_lattice
        >>> from torchfair.shapes import Catenoid, principal_triangles
        >>> mesh = principal_triangles(Catenoid(), 8, 16)
        >>> edges = principal_edges_of_lattice(mesh)
        >>> stars = edges.stars()
        >>> constraint = SaddleShape(stars, mesh.vertices)
        >>> constraint(mesh.vertices)
        tensor(0., dtype=torch.float64)
    """

    def __init__(self, stars: PrincipalStars, vertices: Tensor, *, margin: float = 0.05) -> None:
        sides = SaddleSides(stars, margin=margin)
        sides.decide(vertices.detach())
        data = sides({sides.block: vertices})
        super().__init__([replace(term, refresh=None, data=data) for term in sides.terms(weight=1.0)])


def _beyond(sides: Tensor, spheres: Tensor) -> Tensor:
    """(n,) bool: all ``sides`` (n, k) curve against the sphere."""
    return (torch.sign(spheres)[:, None] * sides < 0.0).all(1)


def _are_wrong(sides: Tensor, spheres: Tensor, excess: Tensor) -> Tensor:
    return (excess > _NEGATIVE) & ~_beyond(sides, spheres)


def _sign(values: Tensor) -> Tensor:
    """-1 or 1, 1 at zero."""
    return torch.where(values < 0, -1.0, 1.0).to(values.dtype)
