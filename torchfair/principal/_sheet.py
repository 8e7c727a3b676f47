"""Flat strips beside each other on a sheet."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..errors import TorchfairError
from ._unroll import Floats


class SheetError(TorchfairError):
    """A sheet on which a strip finds no room.

    Attributes:
        side: ``"sheet_width"`` or ``"sheet_height"``.
        needed, given: lengths in the unit of the strips.
    """

    def __init__(self, side: str, needed: float, given: float) -> None:
        super().__init__(f"{side}: a strip needs {needed:.6g} with gaps, the sheet has {given:.6g}")
        self.side, self.needed, self.given = side, needed, given


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
        width: of the sheet.
        height: of the sheet, or of all sheets above each other.
        sheets: how many there are, of equal height.
    """

    corners: Floats
    width: float
    height: float
    sheets: int = 1


def shelves(boxes: Floats, gap: float, width: float | None, height: float | None = None) -> Layout:
    """Places boxes (S, 2) in rows, high ones first, each ``gap`` away from its neighbours and the rim.

    Without a width, the smallest of several sheets is taken that are not much longer than broad.

    With a height there are as many sheets as it takes, one above the other.

    Raises:
        SheetError: if a box is broader or higher than the sheet.
    """
    if not len(boxes):
        return Layout(boxes, 0.0, 0.0)
    broadest = float(boxes[:, 0].max()) + 2 * gap
    highest = float(boxes[:, 1].max()) + 2 * gap
    if height is not None and height < highest * (1 - 1e-9):
        raise SheetError("sheet_height", highest, height)
    if width is not None:
        if width < broadest * (1 - 1e-9):
            raise SheetError("sheet_width", broadest, width)
        return _first_fit(boxes, gap, width, height)._replace(width=width)
    square = math.sqrt(float((boxes + gap).prod(1).sum()))
    tried = [_first_fit(boxes, gap, max(broadest, square * step / 8), height) for step in range(8, 17)]
    return min(tried, key=lambda layout: layout.width * layout.height)


def _first_fit(boxes: Floats, gap: float, width: float, height: float | None) -> Layout:
    """Every box goes to the first row that has room for it; the sheet is as wide as the fullest row."""
    corners = np.zeros_like(boxes)
    rows: list[list[float]] = []  # where the next box goes in each row: x, y
    top, sheet = gap, 0
    for box in np.lexsort((-boxes[:, 0], -boxes[:, 1])).tolist():
        across, up = boxes[box].tolist()
        row = next((row for row in rows if row[0] + across + gap <= width * (1 + 1e-9)), None)
        if row is None:
            if height is not None and top + up + gap > (sheet + 1) * height * (1 + 1e-9):
                sheet += 1
                top = sheet * height + gap
            row = [gap, top]
            rows.append(row)
            top += up + gap
        corners[box] = row
        row[0] += across + gap
    total = top if height is None else (sheet + 1) * height
    return Layout(corners, max(row[0] for row in rows), total, sheet + 1)
