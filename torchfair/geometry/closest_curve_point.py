"""Exact closest points on polylines, such as the pieces of a boundary."""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import numpy as np
import torch
from torch import Tensor

from .._connectivity import first_few
from ..errors import MeshError, ShapeError
from ._closest_boxes import Floats, Ints
from ._closest_points import check_points, to_columns
from ._closest_query import Kind, ask
from ._closest_search import nearest_pieces
from ._closest_segments import Segments


class ClosestCurvePoints(NamedTuple):
    """Closest points on polylines, one for each of N query points.

    Floating tensors have the dtype and all tensors the device of the query points; nothing carries a gradient.

    Attributes:
        positions: (N, 3) closest point.
        distances: (N,) its distance from the query point, >= 0.
        segments: (N,) number of the segment it lies on, within its own curve; segment ``i`` runs from point
            ``i`` to the next.
        fractions: (N,) where on the segment, 0 at its start and 1 at its end.
        tangents: (N, 3) unit vector along the segment; zero only on a curve whose points all coincide.
    """

    positions: Tensor
    distances: Tensor
    segments: Tensor
    fractions: Tensor
    tangents: Tensor


class ReferenceCurves:
    """Several polylines; every query point belongs to one of them and sees only that one.

    Exact like :class:`~torchfair.geometry.closest_point.ReferenceSurface`: the points of a curve have distance
    0, and of several closest points of equal distance the one on the segment with the lowest number is taken.
    Segments without length are passed over.

    Args:
        curves: positions (n, 3) of each curve, n >= 2. Later changes of the tensors have no effect.
        closed: whether each curve has a segment from its last point to its first.

    Raises:
        ShapeError: if a curve is not a floating tensor (n, 3), or ``closed`` has another length.
        MeshError: if there is no curve, one has fewer than two points, or a coordinate is not finite or
            beyond 1e70.
    """

    _answer: ClassVar[tuple[Kind, ...]] = ("vector", "number", "index", "number", "vector")

    def __init__(self, curves: Sequence[Tensor], closed: Sequence[bool]) -> None:
        if len(curves) != len(closed):
            raise ShapeError("closed", f"one bool for each of {len(curves)} curves", len(closed))
        if not curves:
            raise MeshError("no curve was given. Give at least one polyline.")
        self._curve_count = len(curves)
        starts, ends, numbers, owners = [], [], [], []
        for curve, (points, is_closed) in enumerate(zip(curves, closed, strict=True)):
            start, end = _segment_ends(to_columns(points, f"curve {curve}"), is_closed, curve)
            used = np.flatnonzero((start != end).any(0))
            used = used if used.size else np.zeros(1, np.int64)
            starts.append(start[:, used])
            ends.append(end[:, used])
            numbers.append(used)
            owners.append(np.full(used.size, curve))
        self._numbers = np.concatenate(numbers)
        self._segments = Segments(np.concatenate(starts, 1), np.concatenate(ends, 1), np.concatenate(owners))

    def closest(self, points: Tensor, curves: Tensor) -> ClosestCurvePoints:
        """Closest point of each of ``points`` (N, 3) on its own curve, number ``curves`` (N,).

        Raises:
            ShapeError: if ``points`` is not a floating tensor (N, 3) or ``curves`` not an integer tensor (N,).
            MeshError: if a coordinate is not finite or beyond 1e70, or there is no curve of that number.
        """
        check_points(points, "points")
        expected = f"an integer tensor ({points.shape[0]},), the curve of each point"
        if not isinstance(curves, Tensor):
            raise ShapeError("curves", expected, type(curves).__name__)
        if curves.shape != points.shape[:1] or curves.is_floating_point() or curves.dtype == torch.bool:
            raise ShapeError("curves", expected, f"{tuple(curves.shape)} {curves.dtype}")
        return ClosestCurvePoints(*ask(self, points, curves))

    def _search(self, points: Floats, owners: Tensor | None) -> Sequence[Floats | Ints]:
        assert owners is not None
        pieces = nearest_pieces(self._segments, self._segments.place(points, self._checked(owners)))
        squared, positions, fractions = self._segments.locate(points, pieces)
        tangents = self._segments.tangents[:, pieces]
        return positions.T, np.sqrt(squared), self._numbers[pieces], fractions, tangents.T

    def _checked(self, curves: Tensor) -> Ints:
        owners = curves.detach().cpu().numpy().astype(np.int64)
        wrong = np.flatnonzero((owners < 0) | (owners >= self._curve_count))
        if wrong.size:
            named = (f"point {row} asks for curve {owners[row]}" for row in wrong)
            raise MeshError(
                f"curve numbers out of range 0..{self._curve_count - 1}: {first_few(named, wrong.size)}. "
                "Count curves from zero."
            )
        return owners


class ReferenceCurve:
    """One polyline to which exact distances are measured: :class:`ReferenceCurves` with a single curve.

    Args:
        points: (n, 3) positions, n >= 2.
        closed: whether a segment joins the last point to the first.

    Example:
        >>> from torchfair.geometry import ReferenceCurve
        >>> import torch
        >>> corner = ReferenceCurve(torch.tensor([[0.0, 0, 0], [4, 0, 0], [4, 3, 0]]), closed=False)
        >>> corner.closest(torch.tensor([[1.0, 2, 0], [9, 1, 0]])).distances
        tensor([2., 5.])
    """

    def __init__(self, points: Tensor, closed: bool) -> None:
        self._curves = ReferenceCurves([points], [closed])

    def closest(self, points: Tensor) -> ClosestCurvePoints:
        """Closest points of ``points`` (N, 3); see :meth:`ReferenceCurves.closest`."""
        return self._curves.closest(points, torch.zeros(points.shape[:1], dtype=torch.int64, device=points.device))


def _segment_ends(points: Floats, closed: bool, curve: int) -> tuple[Floats, Floats]:
    """Starts and ends (3, n or n - 1) of the segments of a polyline (3, n)."""
    count = points.shape[1]
    if count < 2:
        raise MeshError(f"curve {curve} has {count} point(s). Give at least two.")
    ends = np.roll(points, -1, axis=1)
    return (points, ends) if closed else (points[:, :-1], ends[:, :-1])
