"""Flat strips beside each other on a sheet."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..errors import TorchfairError
from ._unroll import Floats


def upright(flat: Floats) -> Floats:
    """The points (n, 2, 2) turned so that their bounding box is smallest, its long side along x, a corner at 0."""
    from scipy.spatial import ConvexHull

    points = flat.reshape(-1, 2)
    hull = points[ConvexHull(points).vertices]
    side = np.roll(hull, -1, axis=0) - hull
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    normal = np.stack([-side[:, 1], side[:, 0]], axis=1)
    extents = np.stack([np.ptp(hull @ axes.T, axis=0) for axes in (side, normal)])
    best = int(extents.prod(0).argmin())
    is_long = extents[0, best] >= extents[1, best]
    frame = np.stack([side[best], normal[best]] if is_long else [normal[best], -side[best]])
    turned = points @ frame.T
    placed: Floats = (turned - turned.min(0)).reshape(flat.shape)
    return placed


class Layout(NamedTuple):
    """Where the strips go on the sheet.

    Attributes:
        corners: (S, 2) where to move the lower left corner of each bounding box.
        size: width and height of the sheet.
    """

    corners: Floats
    size: tuple[float, float]


def shelves(boxes: Floats, gap: float, width: float | None) -> Layout:
    """Places boxes (S, 2) in rows, high ones first, each ``gap`` away from its neighbours and the rim.

    Raises:
        TorchfairError: if a box is broader than the sheet.
    """
    if not len(boxes):
        return Layout(boxes, (0.0, 0.0))
    broadest = float(boxes[:, 0].max()) + 2 * gap
    if width is None:
        width = max(broadest, math.sqrt(1.2 * float((boxes + gap).prod(1).sum())))
    if width < broadest * (1 - 1e-9):
        raise TorchfairError(f"sheet_width: a strip needs {broadest:.6g} with gaps, the sheet has {width:.6g}")
    corners = np.zeros_like(boxes)
    x = y = gap
    row = 0.0
    for box in np.lexsort((np.arange(len(boxes)), -boxes[:, 0], -boxes[:, 1])).tolist():
        across, up = boxes[box].tolist()
        if x > gap and x + across + gap > width * (1 + 1e-9):
            x, y, row = gap, y + row + gap, 0.0
        corners[box] = x, y
        x, row = x + across + gap, max(row, up)
    return Layout(corners, (width, y + row + gap))
