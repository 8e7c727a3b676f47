"""What one attempt at a mesh does."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..fields.frames import Floats


@dataclass(frozen=True)
class Plan:
    """What one attempt does.

    Attributes:
        spacing: length of edges.
        smoothing: length over which directions are smoothed.
        align: whether boundary runs and creases become lines.
        creases: whether they are kept.
        even: where positive, rows follow crosses, see :func:`even_crosses`: the weight of lengths in it.
        apart: (n, 3) places near which creases do not become lines.
    """

    spacing: float
    smoothing: float
    align: bool
    creases: bool = True
    even: float = 0.0
    apart: Floats = field(default_factory=lambda: np.zeros((0, 3)))
