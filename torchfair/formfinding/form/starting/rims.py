"""Rims that cannot bound a surface: those that cross or overlap themselves or each other."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import torch

from ....curves import ClosedCurve
from ....errors import MeshError
from .patch import Floats

_SAMPLES = 400  # of a curve, and its corners
_TOUCH = 1e-5  # of the longest curve: the chords of two samplings of one circle are as near as that


def refuse_crossing_rims(curves: Sequence[ClosedCurve]) -> None:
    """Raises MeshError naming the place where a curve crosses, touches or overlaps itself or another one."""
    sampled = [_sampled(curve) for curve in curves]
    margin = _TOUCH * max((curve.length for curve in curves), default=0.0)
    for i, first in enumerate(sampled):
        for j, second in enumerate(sampled[: i + 1]):
            gaps = segment_distances(first, np.roll(first, -1, axis=0), second, np.roll(second, -1, axis=0))
            if i == j:
                here = np.arange(len(first))
                for step in (-1, 0, 1):
                    gaps[here, (here + step) % len(first)] = np.inf
            if gaps.min() > margin:
                continue
            row = int(np.unravel_index(gaps.argmin(), gaps.shape)[0])
            place = ", ".join(f"{x:.6g}" for x in first[row])
            if i == j:
                raise MeshError(
                    f"{_name(i, len(curves))} crosses itself near ({place}), or touches itself: a boundary passes "
                    "every place once. Cut it into several closed curves, or move its points apart"
                )
            if (gaps.min(1) <= margin).mean() > 0.5:
                raise MeshError(f"curves {j} and {i} are the same (counted from 0): give each boundary curve once")
            raise MeshError(f"curves {j} and {i} (counted from 0) cross or touch near ({place}): move them apart")


def _name(number: int, count: int) -> str:
    return "the curve" if count == 1 else f"curve {number} (counted from 0)"


def _sampled(curve: ClosedCurve) -> Floats:
    places = curve.spaced(max(_SAMPLES, 4 * len(curve.corners)))
    points: Floats = curve.at(torch.as_tensor(places)).numpy()
    return points


def segment_distances(p: Floats, q: Floats, a: Floats, b: Floats) -> Floats:
    """(n, m) distances between segments p q (n, 3) and a b (m, 3) in space; those without length are points."""
    u, v = (q - p)[:, None], (b - a)[None]
    w = p[:, None] - a[None]
    uu, vv, uv = (u * u).sum(2), (v * v).sum(2), (u * v).sum(2)
    uw, vw = (u * w).sum(2), (v * w).sum(2)
    square = uu * vv - uv * uv
    with np.errstate(divide="ignore", invalid="ignore"):
        s = np.where(square > 1e-14 * uu * vv, (uv * vw - vv * uw) / square, 0.0).clip(0.0, 1.0)
        t = np.where(vv > 0.0, (uv * s + vw) / vv, 0.0).clip(0.0, 1.0)
        s = np.where(uu > 0.0, (uv * t - uw) / uu, 0.0).clip(0.0, 1.0)
        t = np.where(vv > 0.0, (uv * s + vw) / vv, 0.0).clip(0.0, 1.0)
    gaps: Floats = np.linalg.norm(w + s[:, :, None] * u - t[:, :, None] * v, axis=2)
    return gaps
