"""What is drawn of flat strips, in millimetres."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..errors import TorchfairError
from ._unroll import Floats
from .developable_strips import DevelopableStrips

_LABEL_SIZE = 0.3  # of the width of a strip


class Label(NamedTuple):
    """A word in the middle of a strip.

    Attributes:
        text: the name of the strip after a #, which tells 6 from 9.
        place: the middle of the word.
        angle: degrees, counterclockwise from the x axis; the word runs along the polyline, its top towards the normals.
        size: height of the letters.
    """

    text: str
    place: tuple[float, float]
    angle: float
    size: float


class StripDrawing(NamedTuple):
    """Lines and words, y upwards.

    Attributes:
        size: width and height.
        outlines: (n, 2) points of each closed outline, to be cut.
        scores: (k, 2, 2) rulings inside the strips, to be folded or bent along.
        labels: a name for every strip.
    """

    size: tuple[float, float]
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
        labels.append(Label(f"#{name}", (place[0], place[1]), math.degrees(math.atan2(y, x)), _LABEL_SIZE * width))
    return StripDrawing(
        size=(millimetres * strips.sheet[0], millimetres * strips.sheet[1]),
        outlines=[millimetres * outline.numpy() for outline in strips.outlines()],
        scores=rulings[inner],
        labels=labels,
    )
