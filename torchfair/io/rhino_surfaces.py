"""Surfaces of 3DM files as meshes: a grid in their parameters, exact positions at its points.

Trimmed surfaces are not sampled: their boundary is not along the grid.
"""

from __future__ import annotations

import itertools
import math
from typing import Any, NamedTuple

import numpy as np

from ..errors import SettingsError
from .raw_mesh import Floats, Ints

Cells = tuple[int, int]
_SOUTH, _EAST, _NORTH, _WEST = range(4)  # sides of the domain, as openNURBS counts them
_AROUND = 3  # fewest cells around a closed surface, and
_ACROSS = 2  # between two poles: fewer give no mesh
_MOST = 10_000_000  # cells of a surface: more take minutes and gigabytes


class Patch(NamedTuple):
    """A surface of an object: whether its normal is turned, and whether curves cut parts of its domain away.

    None, where a damaged file holds none.
    """

    surface: Any
    turned: bool = False
    trimmed: bool = False


def checked_cells(surfaces: int | tuple[int, int]) -> Cells:
    """Numbers of cells in both directions.

    Raises:
        SettingsError: they are not one or two whole numbers of at least 1, or make more than ten million cells.
    """
    cells = surfaces if isinstance(surfaces, tuple) else (surfaces, surfaces)
    if len(cells) != 2 or any(isinstance(n, bool) or not isinstance(n, int) or n < 1 for n in cells):
        raise SettingsError(f"surfaces must be one or two whole numbers of at least 1, got {surfaces!r}")
    if cells[0] * cells[1] > _MOST:
        raise SettingsError(f"surfaces may ask for {_MOST} cells a surface, got {cells[0]} by {cells[1]}: take fewer")
    return cells


def patches_of(rhino: Any, geometry: Any) -> list[Patch]:
    """Surfaces of an object, none if it is something else."""
    if isinstance(geometry, rhino.Extrusion):
        geometry = geometry.ToBrep(False)
    if isinstance(geometry, rhino.Brep):
        faces = [geometry.Faces[i] for i in range(len(geometry.Faces))]
        return [_patch_of(face) for face in faces]
    return [Patch(geometry)] if isinstance(geometry, rhino.Surface) else []


def _patch_of(face: Any) -> Patch:
    surface, copy = face.UnderlyingSurface(), face.DuplicateFace(False)
    if surface is None or copy is None:
        return Patch(None)
    return Patch(surface, face.OrientationIsReversed, not copy.IsSurface)


def sampled(patch: Patch, cells: Cells) -> tuple[Floats, list[list[int]]]:
    """Points (n, 3) of a grid, and its quads, counterclockwise around the normal.

    Seams of a closed surface are closed, and a side that is one point (a pole) is one vertex with triangles around it.
    """
    surface = patch.surface
    singular = [surface.IsSingular(side) for side in range(4)]
    closed = [surface.IsClosed(axis) for axis in (0, 1)]
    poles = [singular[_EAST] and singular[_WEST], singular[_SOUTH] and singular[_NORTH]]
    fewest = [_AROUND if closed[axis] else _ACROSS if poles[axis] else 1 for axis in (0, 1)]
    us, vs = (_stops(surface, axis, max(cells[axis], fewest[axis])) for axis in (0, 1))
    places = [surface.PointAt(u, v) for u in us for v in vs]
    points = np.array([(place.X, place.Y, place.Z) for place in places], np.float64)
    numbers = np.arange(len(points)).reshape(len(us), len(vs))
    numbers = _joined(numbers, singular, closed)
    rings = np.stack([numbers[:-1, :-1], numbers[1:, :-1], numbers[1:, 1:], numbers[:-1, 1:]], -1).reshape(-1, 4)
    used, corners = np.unique(rings, return_inverse=True)
    quads = corners.reshape(-1, 4)[:, :: -1 if patch.turned else 1].tolist()
    faces = [list(dict.fromkeys(quad)) for quad in quads]  # at poles corners are the same
    return points[used], [face for face in faces if len(face) >= 3]


def _joined(numbers: Ints, singular: list[bool], closed: list[bool]) -> Ints:
    """Numbers of the points of a grid, where those at the same place have the same."""
    sides = {_SOUTH: numbers[:, 0], _EAST: numbers[-1], _NORTH: numbers[:, -1], _WEST: numbers[0]}  # views
    for side, row in sides.items():
        if singular[side]:
            row[:] = row[0]
    if closed[0]:
        numbers[-1] = numbers[0]
    if closed[1]:
        numbers[:, -1] = numbers[:, 0]
    return numbers


def _stops(surface: Any, axis: int, count: int) -> list[float]:
    """Parameters of a grid: even, but for lines at which the surface may have a kink, which are in it."""
    domain = surface.Domain(axis)
    start, end = domain.T0, domain.T1
    ends = [start, *(knot for knot in _kinks(surface, axis) if start < knot < end), end]
    stops = [start]
    for a, b in itertools.pairwise(ends):
        steps = max(1, math.ceil(count * (b - a) / (end - start) - 1e-9))  # 1e-9: quarters are even but for rounding
        stops += np.linspace(a, b, steps + 1)[1:].tolist()
    return stops


def _kinks(surface: Any, axis: int) -> list[float]:
    """Parameters of knots at which the tangent plane may jump: as often there as the degree is high."""
    form = surface.ToNurbsSurface()
    if form is None:
        return []
    knots, others = ((form.KnotsU, form.KnotsV), (form.KnotsV, form.KnotsU))[axis]
    values, counts = np.unique(np.array(list(knots)), return_counts=True)
    found = []
    for knot in values[counts >= form.Degree(axis)].tolist():
        pair = (knot, others[0]) if axis == 0 else (others[0], knot)
        known, *parameters = surface.GetSurfaceParameterFromNurbsFormParameter(*pair)
        found += [parameters[axis]] if known else []
    return sorted(found)
