"""Which lattice is laid on a surface: squares, or triangles with one edge along a principal direction."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..fields import Symmetry
from ..fields.frames import Floats


@dataclass(frozen=True)
class Lattice:
    """A lattice of whole numbers.

    Attributes:
        symmetry: of its field: 4 if a quarter turn brings it to itself, 2 if only half a turn does.
        shear: (2, 2) rows: from whole coordinates to lengths along and across the field, in spacings.
        spacings: along and across, over the spacing.
    """

    symmetry: Symmetry
    shear: tuple[tuple[float, float], tuple[float, float]]
    spacings: tuple[float, float]

    @property
    def has_rows(self) -> bool:
        """Whether its points lie in rows along one direction, and its cells are cut into triangles."""
        return self.symmetry == 2

    @property
    def aligned(self) -> tuple[int, ...]:
        """Coordinates that are constant along the field or across it."""
        return tuple(k for k in (0, 1) if self.shear[k][1 - k] == 0)

    @property
    def matrix(self) -> Floats:
        """The shear as an array."""
        return np.array(self.shear)

    @property
    def cell(self) -> float:
        """Area of a cell over the squared spacing."""
        return self.spacings[0] * self.spacings[1]


SQUARES = Lattice(4, ((1.0, 0.0), (0.0, 1.0)), (1.0, 1.0))


def triangle_lattice(ratio: float) -> Lattice:
    """Rows of points half a spacing apart from each other: cells are cut into two triangles by a diagonal.

    With coordinates (a, v) a point lies a - v/2 along its row v: a cell from (0, 0) has the sides (1, 0), which is
    principal, and (0, 1), half a spacing back; its diagonal (1, 1) is half a spacing ahead.

    Args:
        ratio: distance of rows over the spacing along them; sqrt(3)/2 for equilateral triangles.
    """
    return Lattice(2, ((1.0, -0.5), (0.0, 1.0)), (1.0, ratio))
