"""What is drawn of flat strips, in millimetres."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..errors import TorchfairError
from ._unroll import Floats
from .developable_strips import DevelopableStrips

_LABEL_SIZE = 0.3  # of the width of a strip
_TURNED = " v"
_STROKE = 1 / 1500  # of the longer side of a sheet


class Label(NamedTuple):
    """A word in the middle of a strip.

    Attributes:
        text: the name of the strip after a #, which tells 6 from 9; with a v behind where the normals point to the foot
            of the word and not to its top.
        place: the middle of the word.
        angle: degrees, counterclockwise from the x axis, above -90 up to 90: the word runs along the polyline, upright.
        size: height of the letters.
    """

    text: str
    place: tuple[float, float]
    angle: float
    size: float


class StripDrawing(NamedTuple):
    """Lines and words, y upwards.

    Attributes:
        size: width and height of all sheets.
        sheets: how many there are, one above the other.
        stroke: width of lines, which follows the size, so that they can be seen and told apart.
        outlines: (n, 2) points of each closed outline, to be cut.
        scores: (k, 2, 2) rulings inside the strips, to be folded or bent along.
        labels: a name for every strip.
    """

    size: tuple[float, float]
    sheets: int
    stroke: float
    outlines: list[Floats]
    scores: Floats
    labels: list[Label]


def draw_strips(strips: DevelopableStrips, millimetres: float) -> StripDrawing:
    """The drawing, ``millimetres`` for each unit of length of the strips.

    Raises:
        TorchfairError: if ``millimetres`` is not a positive number, or there are no strips.
    """
    if not (math.isfinite(millimetres) and millimetres > 0):
        raise TorchfairError(f"millimetres: expected a positive number, got {millimetres}")
    if not strips.names:
        raise TorchfairError("there are no strips to draw")
    rulings: Floats = millimetres * strips.uv.numpy().reshape(-1, 2, 2)
    offsets = strips.offsets.numpy()
    inner = np.ones(len(rulings), np.bool_)
    inner[offsets[:-1]] = inner[offsets[1:] - 1] = False
    labels = []
    for name, begin, end in zip(strips.names, offsets[:-1].tolist(), offsets[1:].tolist(), strict=True):
        quad = rulings[(begin + end) // 2 - 1 : (begin + end) // 2 + 1]
        x, y = (quad[1] - quad[0]).mean(0).tolist()
        width = float(np.linalg.norm(quad[:, 1] - quad[:, 0], axis=1).min())
        place = quad.mean((0, 1)).tolist()
        along = math.degrees(math.atan2(y, x))
        angle = _upright(along)
        text = f"#{name}" if abs(angle - along) < 90.0 else f"#{name}{_TURNED}"
        labels.append(Label(text, (place[0], place[1]), angle, _LABEL_SIZE * width))
    width, height = (millimetres * extent for extent in strips.sheet)
    return StripDrawing(
        size=(width, height),
        sheets=strips.sheets,
        stroke=_STROKE * max(width, height / strips.sheets),
        outlines=[millimetres * outline.numpy() for outline in strips.outlines()],
        scores=rulings[inner],
        labels=labels,
    )


def _upright(angle: float) -> float:
    """The angle in degrees, or that of the other way along the line, above -90 up to 90."""
    return 90.0 - (90.0 - angle) % 180.0
