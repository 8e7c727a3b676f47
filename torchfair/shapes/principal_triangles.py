"""Triangle meshes on the half-shifted lattice of parameter lines."""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from torchfair.errors import MeshError

from .principal_quads import equal_steps, merge_poles, require_principal
from .shape_mesh import Direction, Points, ShapeMesh, build_mesh, check_count
from .surface import Surface

Ints = npt.NDArray[np.int64]
Ends = Literal["straight", "zigzag"]


def principal_triangles(
    surface: Surface, rows: int, columns: int, *, along: Direction = "u", ends: Ends = "straight"
) -> ShapeMesh:
    r"""Half-shifted lattice on principal parameter lines: one third of the edges principal, the others symmetric.

    ``rows`` still divides v and ``columns`` divides u. With ``along="u"`` the principal edges run along u, and
    every other u-line is shifted by half a cell. Pairs of triangles form rhombi whose diagonal is a principal
    edge::

        o-----o-----o        straight ends (default): shifted lines get an extra vertex on the boundary, which
        |\   / \   /|        closes the lattice with half triangles, so the boundary is a parameter line.
        o-o-----o-o-o
        |/   \ /   \|        zigzag ends: no half triangles; the boundary runs o-/\-o and all triangles are
        o-----o-----o        alike, but the mesh covers half a cell less there on every other line.

    Raises:
        MeshError: if parameter lines are not principal (:func:`parameter_triangles` does not mind); if the
            direction across the principal edges is periodic and its number of cells is odd, or less than four;
            for zigzag ends at poles; or for too few rows or columns.
    """
    require_principal(surface)
    return _triangles(surface, rows, columns, along, ends)


def parameter_triangles(
    surface: Surface, rows: int, columns: int, *, along: Direction = "u", ends: Ends = "straight"
) -> ShapeMesh:
    """As :func:`principal_triangles`, on any surface: the lattice follows the parameter lines, principal or not.

    On :class:`Paraboloid` that is the lattice over the x, y plane with principal edges on the axes.
    """
    return _triangles(surface, rows, columns, along, ends)


def _triangles(surface: Surface, rows: int, columns: int, along: Direction, ends: Ends) -> ShapeMesh:
    if along not in ("u", "v"):
        raise MeshError(f'along must be "u" or "v", got {along!r}')
    if ends not in ("straight", "zigzag"):
        raise MeshError(f'ends must be "straight" or "zigzag", got {ends!r}')
    axis = 0 if along == "u" else 1  # of the principal edges
    cells, lines = (columns, rows) if along == "u" else (rows, columns)
    _check_lattice(surface, axis, cells, lines, ends)
    periodic = surface.periodic[axis]
    stations = equal_steps(surface, 1 - axis, lines)
    straight = ends == "straight" and not periodic
    places = [_line(surface, axis, cells, shifted=j % 2 == 1, straight=straight) for j in range(len(stations))]
    starts = np.cumsum([0, *map(len, places)])
    strips = []
    for below in range(lines):
        above = (below + 1) % len(stations)
        even, odd = (below, above) if below % 2 == 0 else (above, below)
        strip = _strip(starts[even], starts[odd], cells, periodic=periodic, straight=straight)
        strips.append(strip if below % 2 == 0 else strip[:, ::-1])
    faces = np.concatenate(strips)
    across = np.repeat(stations, np.diff(starts))
    parameters = np.stack([np.concatenate(places), across], axis=1)
    if along == "v":
        parameters, faces = parameters[:, ::-1], faces[:, ::-1]
    return build_mesh(surface, *merge_poles(surface, parameters, faces))


def _check_lattice(surface: Surface, axis: int, cells: int, lines: int, ends: Ends) -> None:
    for direction, count in ((axis, cells), (1 - axis, lines)):
        least, why = 2 if all(surface.poles) else 1, "the mesh needs a cell, or two between poles"
        if surface.periodic[direction]:
            least, why = 3 if direction == axis else 4, f"{'uv'[direction]} is periodic"
        check_count(("columns", "rows")[direction], count, least, why)
    across, name = "uv"[1 - axis], ("columns", "rows")[1 - axis]
    if surface.periodic[1 - axis] and lines % 2:
        raise MeshError(
            f"{name} must be even, got {lines}: every other line is shifted by half a cell, and the surface closes "
            f'up in {across}. Take {lines + 1}, or principal edges along="{across}".'
        )
    if ends == "zigzag" and axis == 1 and any(surface.poles):
        raise MeshError('ends="zigzag" along v leaves holes at the poles of the sphere. Use straight ends.')


def _line(surface: Surface, axis: int, cells: int, *, shifted: bool, straight: bool) -> Points:
    """Parameters of the vertices on one line; shifted ones come first, then the two extra ends."""
    low, high = surface.domain[axis]
    if not shifted:
        return equal_steps(surface, axis, cells)
    middle = low + (high - low) * (np.arange(cells) + 0.5) / cells
    return np.concatenate([middle, [low, high]]) if straight else middle


def _strip(even: int, odd: int, cells: int, *, periodic: bool, straight: bool) -> Ints:
    """Triangles between a line (below) and a shifted line (above), from the first vertex of each."""
    i = np.arange(cells)
    e, following = even + i, even + (i + 1) % (cells if periodic else cells + 1)
    up = np.stack([e, following, odd + i], axis=1)
    inner = i if periodic else i[:-1]
    down = np.stack([following[inner], odd + (inner + 1) % cells, odd + inner], axis=1)
    parts = [up, down]
    if straight:
        left, right = odd + cells, odd + cells + 1
        parts.append(np.array([[even, odd, left], [even + cells, right, odd + cells - 1]]))
    return np.concatenate(parts)
