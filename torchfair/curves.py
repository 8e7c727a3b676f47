"""Closed curves in space that bound surfaces: smooth pieces joined at corners."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from .errors import MeshError, ShapeError
from .geometry.spline_curves import SplineCurves

Floats = npt.NDArray[np.float64]

_SAMPLES = 24  # of arc length, between two points of the curve
_SAME = 1e-9  # of the extent: neighbours that are nearer coincide
_DENSE = 2048  # samples of a curve that is given as a function


class Span(NamedTuple):
    """A smooth stretch of a closed curve: from one corner to the next, or all of a curve without corners.

    Attributes:
        points: (n, 3) float64 given points in order; of an open span with the corners at both ends.
        closed: whether it is a whole curve without corners.
    """

    points: Tensor
    closed: bool


class ClosedCurve:
    """A closed curve through given points, smooth except at corners.

    Between corners it is a cubic spline through the points, without corners it is one closed spline: see
    :class:`~torchfair.geometry.SplineCurves`. The parameter ``s`` runs from 0 to 1 once around and is proportional to
    arc length; it is taken modulo 1.

    Args:
        points: (n, 3) in order, the first not repeated at the end, any length unit; n >= 3.
        corners: numbers of the points that are corners. By default those at which the polyline turns by more
            than ``corner_angle``.
        corner_angle: radians.

    Attributes:
        length: of the curve, in the unit of the points.
        knots: (n,) parameters of the points.
        corners: (c,) parameters of the corners, ascending.

    Raises:
        ShapeError: if ``points`` is not a floating tensor (n, 3) with n >= 3.
        MeshError: if points are not finite, neighbours coincide, or a corner is no point.
    """

    def __init__(
        self, points: Tensor, *, corners: Sequence[int] | None = None, corner_angle: float = math.radians(40.0)
    ) -> None:
        places = _checked(points)
        if corners is None:
            corners = np.flatnonzero(_turning(places) > corner_angle).tolist()
        cuts = sorted({int(corner) for corner in corners})
        if cuts and not (cuts[0] >= 0 and cuts[-1] < len(places)):
            raise MeshError(f"corners: points are numbered from 0 to {len(places) - 1}, got {cuts[:5]}")
        self._fit(places, cuts)

    @classmethod
    def from_function(cls, function: Callable[[Tensor], Tensor], corners: Sequence[float] = ()) -> ClosedCurve:
        """The curve ``function(t)``, t (n,) from 0 to 1, (n,) -> (n, 3), sampled densely.

        Args:
            function: closed, ``function(0) = function(1)``.
            corners: values of t at which it has corners.
        """
        stops = sorted({float(corner) % 1.0 for corner in corners}) or [0.0]
        spans = itertools.pairwise([*stops, stops[0] + 1.0])
        per_piece = max(_DENSE // len(stops), 16)
        times = np.concatenate([np.linspace(a, b, per_piece, endpoint=False) for a, b in spans])
        points = function(torch.from_numpy(times % 1.0))
        return cls(points.to(torch.float64), corners=[i * per_piece for i in range(len(stops))] if corners else ())

    def _fit(self, places: Floats, cuts: list[int]) -> None:
        count = len(places)
        first = cuts[0] if cuts else 0
        around = np.concatenate([np.roll(places, -first, axis=0), places[first : first + 1]])
        self._stops = np.array([cut - first for cut in cuts] + [count] if cuts else [0, count])
        self._points, self._smooth = torch.from_numpy(around), not cuts
        self._curves = SplineCurves(*zip(*self.spans(), strict=True))
        chords = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(around, axis=0), axis=1))])
        self._chords = chords
        # Arc length against the chord parameter, fine enough to be inverted by linear interpolation.
        steps = np.linspace(0.0, 1.0, _SAMPLES, endpoint=False)
        fine = np.append((chords[:-1, None] + np.diff(chords)[:, None] * steps).ravel(), chords[-1])
        arcs = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(self._place(fine), axis=0), axis=1))])
        self.length = float(arcs[-1])
        self._fine, self._arcs = fine, arcs / arcs[-1]
        knots = np.interp(chords[:-1], fine, self._arcs)
        self._start = knots[(count - first) % count]  # parameters are counted from the first point given
        self.knots = torch.from_numpy((np.roll(knots, first) - self._start) % 1.0)
        self.corners = self.knots[torch.tensor(cuts, dtype=torch.int64)].sort().values

    def spans(self) -> list[Span]:
        """The smooth stretches, from the first corner on."""
        if self._smooth:
            return [Span(self._points[:-1], True)]
        return [Span(self._points[a : b + 1], False) for a, b in itertools.pairwise(self._stops)]

    def _place(self, chord: Floats) -> Floats:
        segment = np.clip(np.searchsorted(self._chords, chord, side="right") - 1, 0, len(self._chords) - 2)
        span = np.searchsorted(self._stops, segment, side="right") - 1
        fraction = (chord - self._chords[segment]) / np.diff(self._chords)[segment]
        places = (torch.from_numpy(x) for x in (span, segment - self._stops[span], fraction))
        return self._curves.at(*places).numpy()

    def at(self, parameters: Tensor) -> Tensor:
        """Positions (n, 3) float64 at parameters (n,)."""
        s = (parameters.detach().cpu().double().numpy() + self._start) % 1.0
        return torch.from_numpy(self._place(np.interp(s, self._arcs, self._fine)))

    def spaced(self, count: int) -> Tensor:
        """(count,) ascending parameters, corners among them, as evenly spaced as they allow.

        Raises:
            MeshError: if ``count`` is smaller than 3 or than the number of corners.
        """
        stops = self.corners.tolist() or [0.0]
        if count < max(3, len(stops)):
            raise MeshError(f"{count} points are too few for a closed curve with {len(self.corners)} corners")
        spans = np.diff([*stops, stops[0] + 1.0])
        shares = _apportion(spans, count)
        parts = [a + span * np.arange(n) / n for a, span, n in zip(stops, spans, shares, strict=True)]
        return torch.from_numpy(np.sort(np.concatenate(parts) % 1.0))

    def parameters_of(self, points: Tensor) -> Tensor:
        """(n,) parameters of the places of the curve nearest to ``points`` (n, 3)."""
        asked = points.detach().cpu().double()
        spans = len(self._stops) - 1
        each = torch.arange(spans).repeat_interleave(len(asked))
        feet = self._curves.closest(asked.repeat(spans, 1), each)
        nearest = feet.distances.view(spans, -1).argmin(0, keepdim=True)
        segment, fraction = (x.view(spans, -1).gather(0, nearest)[0].numpy() for x in (feet.segments, feet.fractions))
        segment = segment + self._stops[nearest[0].numpy()]
        chord = self._chords[segment] + fraction * np.diff(self._chords)[segment]
        return torch.from_numpy((np.interp(chord, self._fine, self._arcs) - self._start) % 1.0)


def _checked(points: Tensor) -> Floats:
    if not isinstance(points, Tensor) or points.ndim != 2 or points.shape[1] != 3 or points.shape[0] < 3:
        actual = tuple(points.shape) if isinstance(points, Tensor) else type(points).__name__
        raise ShapeError("points of a closed curve", "a floating tensor (n, 3), n >= 3", actual)
    places: Floats = points.detach().cpu().double().numpy()
    bad = np.flatnonzero(~np.isfinite(places).all(1))
    if bad.size:
        raise MeshError(f"points {bad[:5].tolist()} of a closed curve are not finite")
    steps = np.linalg.norm(places - np.roll(places, -1, axis=0), axis=1)
    same = np.flatnonzero(steps <= _SAME * np.ptp(places, axis=0).max())
    if same.size:
        raise MeshError(f"points {same[:5].tolist()} of a closed curve coincide with the next ones: leave them out")
    return places


def _turning(places: Floats) -> Floats:
    """(n,) angle between the chord that arrives at a point and the one that leaves it."""
    leaving = np.roll(places, -1, axis=0) - places
    arriving = np.roll(leaving, 1, axis=0)
    sine = np.linalg.norm(np.cross(arriving, leaving), axis=1)
    angle: Floats = np.arctan2(sine, (arriving * leaving).sum(1))
    return angle


def _apportion(spans: Floats, count: int) -> list[int]:
    """At least one for each span, ``count`` in all, in proportion to the spans (largest remainders)."""
    ideal = spans / spans.sum() * count
    shares = np.maximum(np.floor(ideal), 1).astype(int)
    while shares.sum() != count:
        step = 1 if shares.sum() < count else -1
        gaps = step * (ideal - shares)
        gaps[(shares <= 1) & (step < 0)] = -np.inf
        shares[int(np.argmax(gaps))] += step
    result: list[int] = shares.tolist()
    return result
