"""Loops over the triangles of a mesh for the normal variation, compiled by the optional package numba.

Imported only where numba is there. Formulas and their bounds are those of ``_normal_variation_kernel``, in double
precision; here every triangle is read once for its normal and once for all else, and nothing is stored between.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numba
import numpy as np

Floats = np.ndarray[Any, np.dtype[np.float64]]
Ints = np.ndarray[Any, np.dtype[np.uint32]]


def _compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The function as machine code, kept on disk where that is possible; runs beside other threads."""
    settings: dict[str, Any] = {"nogil": True, "error_model": "numpy"}
    try:
        compiled: Callable[..., Any] = numba.njit(cache=True, **settings)(function)
    except RuntimeError:  # no folder to keep it in
        compiled = numba.njit(**settings)(function)
    return compiled


def _write_normals(
    points: Floats, scale: float, corners: Ints, start: int, stop: int, bounds: tuple[float, float, float], out: Floats
) -> None:
    """Unit normal n and ``1/|N|`` (F, 4) of triangles ``start`` to ``stop``; see ``_write_normals`` of the kernel.

    ``bounds`` are the square of the bound of degenerate triangles, the largest ``1/|N|`` and the length of the
    "normal" of a degenerate triangle.
    """
    degenerate, largest, far = bounds
    for f in range(start, stop):
        a, b, c = corners[f, 0], corners[f, 1], corners[f, 2]
        ax, ay, az = _between(points, a, b, scale)
        bx, by, bz = _between(points, b, c, scale)
        cx, cy, cz = _between(points, c, a, scale)
        squares = ax * ax + ay * ay + az * az + bx * bx + by * by + bz * bz + cx * cx + cy * cy + cz * cz
        nx, ny, nz = ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx
        squared = nx * nx + ny * ny + nz * nz
        valid = squared > squares * squares * degenerate
        inverse = min(1.0 / math.sqrt(squared), largest) if valid else 0.0 / (squared + 1.0)  # 0 or no number
        out[f, 0] = nx * inverse - (0.0 if valid else far)
        out[f, 1], out[f, 2], out[f, 3] = ny * inverse, nz * inverse, inverse


def _add_forces(
    points: Floats, scale: float, corners: Ints, behind: Ints, start: int, stop: int, normals: Floats, forces: Floats
) -> float:
    """Adds dE/dp (V, 3) of triangles ``start`` to ``stop`` to ``forces``; twice their energy.

    ``behind`` (F, 3) is the triangle behind each side, the triangle itself on the boundary.
    """
    total = 0.0
    for f in range(start, stop):
        a, b, c = corners[f, 0], corners[f, 1], corners[f, 2]
        ax, ay, az = _between(points, a, b, scale)
        bx, by, bz = _between(points, b, c, scale)
        cx, cy, cz = _between(points, c, a, scale)
        nx, ny, nz, inverse = normals[f, 0], normals[f, 1], normals[f, 2], normals[f, 3]
        dx, dy, dz = _between(normals, behind[f, 0], f, 1.0)
        turn, at_a, term = _side(ax, ay, az, dx, dy, dz)
        gx, gy, gz, total = turn * dx, turn * dy, turn * dz, total + term
        dx, dy, dz = _between(normals, behind[f, 1], f, 1.0)
        turn, at_b, term = _side(bx, by, bz, dx, dy, dz)
        gx, gy, gz, total = gx + turn * dx, gy + turn * dy, gz + turn * dz, total + term
        dx, dy, dz = _between(normals, behind[f, 2], f, 1.0)
        turn, at_c, term = _side(cx, cy, cz, dx, dy, dz)
        gx, gy, gz, total = gx + turn * dx, gy + turn * dy, gz + turn * dz, total + term
        along = gx * nx + gy * ny + gz * nz
        gx, gy, gz = (gx - along * nx) * inverse, (gy - along * ny) * inverse, (gz - along * nz) * inverse
        fx = gy * bz - gz * by + at_a * ax - at_c * cx
        fy = gz * bx - gx * bz + at_a * ay - at_c * cy
        fz = gx * by - gy * bx + at_a * az - at_c * cz
        hx = gy * cz - gz * cy + at_b * bx - at_a * ax
        hy = gz * cx - gx * cz + at_b * by - at_a * ay
        hz = gx * cy - gy * cx + at_b * bz - at_a * az
        _add(forces, a, fx, fy, fz)
        _add(forces, b, hx, hy, hz)
        _add(forces, c, -fx - hx, -fy - hy, -fz - hz)
    return total


@numba.njit(inline="always")  # type: ignore[untyped-decorator, unused-ignore]
def _between(points: Floats, a: int, b: int, scale: float) -> tuple[float, float, float]:
    """From b to a."""
    return (
        (points[a, 0] - points[b, 0]) * scale,
        (points[a, 1] - points[b, 1]) * scale,
        (points[a, 2] - points[b, 2]) * scale,
    )


@numba.njit(inline="always")  # type: ignore[untyped-decorator, unused-ignore]
def _side(ex: float, ey: float, ez: float, dx: float, dy: float, dz: float) -> tuple[float, float, float]:
    """``|e|/|d|``, ``|d|/|e| / 2`` and ``|e| |d|``; the first two are 0 as in ``_terms`` of the kernel."""
    length, jump = ex * ex + ey * ey + ez * ez, dx * dx + dy * dy + dz * dz
    both = length * jump
    root = 1.0 / math.sqrt(both) if both > 0.0 else 0.0  # nor where it is no number
    stretch = (5.0 if jump > 5.0 else jump) * root
    return root * length, 0.5 * stretch, length * stretch


@numba.njit(inline="always")  # type: ignore[untyped-decorator, unused-ignore]
def _add(forces: Floats, v: int, x: float, y: float, z: float) -> None:
    forces[v, 0] += x
    forces[v, 1] += y
    forces[v, 2] += z


write_normals = _compiled(_write_normals)
add_forces = _compiled(_add_forces)
