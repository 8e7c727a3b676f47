"""Boundary loops that are too short for a mesh to go around them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..fields.frames import Floats
from .polygon_area import area_vector
from .surface import DesignSurface
from .verification import shape_of

_SHORTEST = 3.0  # spacings: with two, triangles went around the tip of a cone; cells of less collapse
_OF_A_DISK = 1  # Euler number
_SLIT = 1e-6  # of the squared length: area that rounding makes of a loop without any


class SmallLoop(NamedTuple):
    """A boundary loop, as of a hole.

    Attributes:
        length: of its edges.
        vertex: number of one of its vertices in the mesh that was given, -1 if none was given.
        place: (3,) where that is.
        is_hole: whether the surface is more than a disk with this rim.
        is_slit: whether it encloses no area, as where a vertex lies in the middle of an edge of a neighbour.
    """

    length: float
    vertex: int
    place: Floats
    is_hole: bool
    is_slit: bool

    def remedy(self, spacing: float) -> str:
        """What is wrong with edges of a length, and what to do, in words."""
        if self.is_slit:
            return (
                "the boundary loop there encloses no area: a vertex lies on an edge that it does not belong to "
                "(T-junction), or edges at one place are not joined. torchfair.repair_mesh(..., weld=True) "
                "(--repair --weld) closes it"
            )
        times = (_SHORTEST * spacing / self.length) ** 2
        name, close = ("boundary loop (hole)", "close it, or ") if self.is_hole else ("boundary", "")
        return (
            f"the {name} there is {self.length:.3g} long, edges are to be {spacing:.3g}: {close}ask for edges of "
            f"{self.length / _SHORTEST:.3g} or less, which are about {times:.2g} times as many faces"
        )


def small_loop(surface: DesignSurface, spacing: float) -> SmallLoop | None:
    """The shortest boundary loop of a surface, if it is shorter than three edges of a length; else None."""
    loops = [loop.numpy() for loop in surface.topology.boundary_loops()]
    points = surface.vertices.numpy()
    lengths = [float(np.linalg.norm(points[np.roll(loop, -1)] - points[loop], axis=1).sum()) for loop in loops]
    if not lengths or min(lengths) >= _SHORTEST * spacing:
        return None
    loop = loops[int(np.argmin(lengths))]
    numbers = surface.numbers.numpy()[loop]
    given = numbers >= 0
    vertex = loop[given][numbers[given].argmin()] if given.any() else loop[0]
    is_hole = shape_of(surface.topology).euler_number != _OF_A_DISK
    is_slit = bool(np.linalg.norm(area_vector(points, loop.tolist())) <= _SLIT * min(lengths) ** 2)
    return SmallLoop(min(lengths), int(surface.numbers[vertex]), points[vertex], is_hole, is_slit)
