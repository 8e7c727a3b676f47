"""Smooth curves through given points, and exact closest points on them."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from .._connectivity import first_few
from ..errors import MeshError, ShapeError
from ._box_descent import BoxDescent
from ._closest_boxes import BoxTree, Floats
from ._closest_points import to_columns
from ._closest_segments import APART
from ._ops import dot, gather
from ._spline_feet import SegmentFeet
from ._spline_fit import Knots, spline_coefficients

_CHUNK = 8192  # points at once
_BEYOND = 1e-8  # of a segment


class SplineFeet(NamedTuple):
    """Closest points on spline curves, one for each of N query points.

    Floating tensors have the dtype of the query points; nothing carries a gradient.

    Attributes:
        positions: (N, 3) closest point.
        distances: (N,) its distance from the query point, >= 0.
        segments: (N,) number of the segment it lies on, within its own curve; segment ``i`` runs from point
            ``i`` to the next.
        fractions: (N,) where on the segment, by the parameter of the spline, 0 at its start and 1 at its end.
        tangents: (N, 3) unit tangent, in the direction of the points.
        curvatures: (N, 3) curvature vector, the second derivative by arc length; in 1 / length, orthogonal to the
            tangent.
        beyond_end: (N,) bool: the closest point is an end of an open curve and the query point lies beyond the normal
            plane there. Elsewhere the offset of the query point is orthogonal to the tangent.
    """

    positions: Tensor
    distances: Tensor
    segments: Tensor
    fractions: Tensor
    tangents: Tensor
    curvatures: Tensor
    beyond_end: Tensor


class SplineCurves:
    """Several smooth curves through given points; every query point belongs to one of them and sees only that one.

    Each curve is a cubic spline with continuous curvature; its parameter is the length of chords. Closed ones are
    smooth all around. Open ones have constant second derivatives on their first and last segments; through two points
    goes a straight line, through three a parabola. Cut curves at corners: a spline through a sharp turn overshoots.

    A circle is met to fourth order in the distance of points, as are smooth closed curves and the inside of open ones;
    on the first and the last segment of a twisted curve it is third order. Where the polyline turns by at most 40
    degrees at each point, no segment goes farther from its chord than about a fifth of its length, however uneven the
    points are (a circle that turns by 40 degrees from point to point: 9 percent).

    Args:
        curves: (n, 3) points of each curve, any length unit; n >= 2, closed ones n >= 3. On the device where queries
            will be. Later changes of the tensors have no effect.
        closed: whether each curve returns from its last point to its first.

    Raises:
        ShapeError: if a curve is not a floating tensor (n, 3), or ``closed`` has another length.
        MeshError: if there is no curve, one has too few points or neighbours that coincide, or a coordinate is not
            finite or beyond 1e70.

    Example:
        >>> from torchfair.geometry import SplineCurves
        >>> import torch
        >>> square = torch.tensor([[1.0, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0]])
        >>> round = SplineCurves([square], [True])
        >>> feet = round.closest(torch.tensor([[2.0, 0, 0]]), torch.tensor([0]))
        >>> feet.distances, feet.tangents
        (tensor([1.]), tensor([[0., 1., 0.]]))
    """

    def __init__(self, curves: Sequence[Tensor], closed: Sequence[bool]) -> None:
        if len(curves) != len(closed):
            raise ShapeError("closed", f"one bool for each of {len(curves)} curves", len(closed))
        if not curves:
            raise MeshError("no curve was given. Give at least one.")
        points = [_checked(x, ring, number) for number, (x, ring) in enumerate(zip(curves, closed, strict=True))]
        device = curves[0].device
        knots = Knots.of(points, list(closed))
        coefficients = spline_coefficients(knots)
        a, b, c, _ = coefficients.transpose(1, 0, 2)
        hulls = np.stack([a, a + b / 3.0, a + (2.0 * b + c) / 3.0, knots.ends], 1)
        level = APART * knots.curves[None]
        corners = (np.concatenate([pick(hulls, axis=1).T, level]) for pick in (np.min, np.max))
        self._descent = BoxDescent(BoxTree(*corners), device)
        self._coefficients = torch.from_numpy(coefficients).to(device)
        self._feet = SegmentFeet(self._coefficients)
        self._ends = torch.from_numpy(knots.ends).to(device)
        labels = knots.curves, knots.is_first, knots.is_last
        self._labels = [torch.from_numpy(label).to(device) for label in labels]
        self._first = torch.from_numpy(np.searchsorted(knots.curves, np.arange(len(points)))).to(device)

    def to(self, device: torch.device | str) -> SplineCurves:
        """The same curves for queries on another device; itself if it is there."""
        if self._coefficients.device == torch.device(device):
            return self
        moved = copy.copy(self)
        moved._descent = self._descent.to(device)
        moved._coefficients, moved._ends = self._coefficients.to(device), self._ends.to(device)
        moved._feet = SegmentFeet(moved._coefficients)
        moved._labels = [label.to(device) for label in self._labels]
        moved._first = self._first.to(device)
        return moved

    def at(self, curves: Tensor, segments: Tensor, fractions: Tensor) -> Tensor:
        """Positions (N, 3) float64 at ``fractions`` (N,) of ``segments`` (N,) of ``curves`` (N,)."""
        return self._at(self._first[curves] + segments, fractions.to(self._coefficients))

    def closest(self, points: Tensor, curves: Tensor) -> SplineFeet:
        """Closest point of each of ``points`` (N, 3) on its own curve, number ``curves`` (N,).

        Exact to rounding, computed in float64; the given points of a curve have distance 0. The answer is a foot, but
        it may not be the nearest one of a point that has about equally near ones on more than eight segments, or
        several on an eighth of one: so far away are points near centres of curvature. It depends on the point alone.

        All operations are those of torch on the device of the curves, and their sizes depend on sizes only. So nothing
        is checked: coordinates that are not finite give distances that are not.

        Raises:
            ShapeError: if ``points`` is not a floating tensor (N, 3) or ``curves`` not an integer tensor (N,).
        """
        if points.dim() != 2 or points.shape[1] != 3 or not points.is_floating_point():
            raise ShapeError("points", "a floating tensor (N, 3)", f"{tuple(points.shape)} {points.dtype}")
        if curves.shape != points.shape[:1] or curves.is_floating_point() or curves.dtype == torch.bool:
            expected = f"an integer tensor ({points.shape[0]},), the curve of each point"
            raise ShapeError("curves", expected, f"{tuple(curves.shape)} {curves.dtype}")
        with torch.no_grad():
            chunks = zip(torch.split(points.detach(), _CHUNK), torch.split(curves.long(), _CHUNK), strict=True)
            parts = [self._closest(some.to(self._coefficients.dtype), mine) for some, mine in chunks]
            joined = parts[0] if len(parts) == 1 else [torch.cat(part) for part in zip(*parts, strict=True)]
            return SplineFeet(*(x.to(points.dtype) if x.is_floating_point() else x for x in joined))

    def _closest(self, points: Tensor, curves: Tensor) -> SplineFeet:
        level = APART * curves[None].to(points.dtype)
        segments = self._descent.candidates(torch.cat([points.T, level]))
        u, squared, slopes = self._feet.nearest(points, segments)
        flat = segments.reshape(-1)
        owner, is_first, is_last = (label.index_select(0, flat).view(segments.shape) for label in self._labels)
        early, late = (u == 0.0) & (slopes > 0.0), (u == 1.0) & (slopes < 0.0)
        # Where the distance falls on across an end of a segment, the foot is on the next one.
        passed = (early & ~is_first) | (late & ~is_last)
        order = torch.where(owner == curves[:, None], torch.where(passed, 4.0 * squared, squared), torch.inf)
        best = order.argmin(1, keepdim=True)
        segment, u, slope, at_end = (x.gather(1, best)[:, 0] for x in (segments, u, slopes, early | late))
        foot, tangent, curvature, speed = self._frame(segment, u)
        beyond = at_end & (slope.abs() > _BEYOND * speed.square())
        distance = torch.linalg.vector_norm(points - foot, dim=1)
        return SplineFeet(foot, distance, segment - self._first[curves], u, tangent, curvature, beyond)

    def _at(self, segments: Tensor, u: Tensor) -> Tensor:
        a, b, c, d = gather(self._coefficients.flatten(1), segments).view(-1, 4, 3).unbind(1)
        u = u[:, None]
        return torch.where(u == 1.0, gather(self._ends, segments), a + u * (b + u * (c + u * d)))

    def _frame(self, segments: Tensor, u: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Positions, unit tangents, curvature vectors and speeds."""
        _, b, c, d = gather(self._coefficients.flatten(1), segments).view(-1, 4, 3).unbind(1)
        w = u[:, None]
        velocity, acceleration = b + w * (2.0 * c + w * (3.0 * d)), 2.0 * c + w * (6.0 * d)
        speed = torch.linalg.vector_norm(velocity, dim=1)
        tangent = velocity / speed.clamp_min(1e-300)[:, None]
        across = acceleration - dot(acceleration, tangent)[:, None] * tangent
        return self._at(segments, u), tangent, across / speed.square().clamp_min(1e-300)[:, None], speed


def _checked(points: Tensor, closed: bool, curve: int) -> Floats:
    places: Floats = np.ascontiguousarray(to_columns(points, f"curve {curve}").T)
    least = 3 if closed else 2
    if len(places) < least:
        kind = "closed" if closed else "open"
        raise MeshError(f"curve {curve} is {kind} and has {len(places)} point(s). Give at least {least}.")
    same = np.flatnonzero((places == np.roll(places, -1, axis=0)).all(1))
    same = same if closed else same[same < len(places) - 1]
    if same.size:
        named = (str(row) for row in same)
        raise MeshError(
            f"curve {curve}: points coincide with the next ones: {first_few(named, same.size)}. Leave them out."
        )
    return places
