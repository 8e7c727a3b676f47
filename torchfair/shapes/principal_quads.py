"""Quad meshes along the parameter lines, and what they share with the triangle meshes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from torchfair.errors import MeshError

from ._quadrature import Domain
from .shape_mesh import Points, ShapeMesh, build_mesh, check_count
from .surface import Surface

Ints = npt.NDArray[np.int64]


def principal_quads(surface: Surface, rows: int, columns: int) -> ShapeMesh:
    """Quads between equally spaced principal parameter lines, ``columns`` cells along u and ``rows`` along v.

    At the poles of a closed sphere the quads of the last rows become triangles around one vertex. Quads are
    not exactly planar on most surfaces.

    Raises:
        MeshError: if parameter lines are not principal, or for too few rows or columns.
    """
    require_principal(surface)
    return _quads(surface, rows, columns)


def parameter_quads(surface: Surface, rows: int, columns: int) -> ShapeMesh:
    """As :func:`principal_quads`, on any surface: the quads follow the parameter lines, principal or not."""
    return _quads(surface, rows, columns)


def interior_absolute_curvature(surface: Surface, rows: int, columns: int) -> float:
    """C of the part of the surface that the interior edges of :func:`principal_quads` stand for. A length.

    Edges along u carry the bending across them, that of the v-lines, from half a row before to half a row after;
    boundary edges carry none. So the curvature of v-lines counts on the patch less half a row at the ends of
    v, that of u-lines on the patch less half a column at the ends of u. E of the quads converges to this
    number with order two, also on patches with boundary; on closed surfaces it is C itself.

    Raises:
        MeshError: if parameter lines are not principal.
    """
    require_principal(surface)
    of_u = _less_half_a_cell(surface, 0, columns)
    of_v = _less_half_a_cell(surface, 1, rows)
    return surface.absolute_line_curvatures(of_u)[0] + surface.absolute_line_curvatures(of_v)[1]


def _less_half_a_cell(surface: Surface, axis: int, cells: int) -> Domain:
    check_count(("columns", "rows")[axis], cells, 2, "two cells have one line of interior edges between them")
    ranges = list(surface.domain)
    if not surface.periodic[axis]:
        low, high = ranges[axis]
        half = 0.5 * (high - low) / cells
        ends = surface.poles if axis == 1 else (False, False)
        ranges[axis] = (low if ends[0] else low + half, high if ends[1] else high - half)
    return (ranges[0], ranges[1])


def require_principal(surface: Surface) -> None:
    """Raises MeshError, naming the surfaces that will do, unless parameter lines are principal."""
    if not surface.parameter_lines_are_principal:
        raise MeshError(
            f"the parameter lines of {type(surface).__name__} are not principal curvature lines. Principal meshes "
            "exist on Sphere, Torus, Cylinder, Cone, Catenoid, Hyperboloid, PrincipalParaboloid, Enneper and "
            "PrincipalHelicoid; parameter_quads and parameter_triangles follow parameter lines on any surface."
        )


# ---- quads ---------------------------------------------------------------------------------------------


def _quads(surface: Surface, rows: int, columns: int) -> ShapeMesh:
    for axis, (name, cells) in enumerate((("columns", columns), ("rows", rows))):
        least, why = 2 if axis == 1 and all(surface.poles) else 1, "the mesh needs a cell, or two between poles"
        if surface.periodic[axis]:
            least, why = 3, f"{'uv'[axis]} is periodic"
        check_count(name, cells, least, why)
    u, v = equal_steps(surface, 0, columns), equal_steps(surface, 1, rows)
    index = np.arange(len(u) * len(v)).reshape(len(v), len(u))
    across = index[:, np.arange(columns + 1) % len(u)]
    grid = across[np.arange(rows + 1) % len(v)]
    faces = np.stack([grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:], grid[1:, :-1]], axis=-1).reshape(-1, 4)
    parameters = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    return build_mesh(surface, *merge_poles(surface, parameters, faces))


def equal_steps(surface: Surface, axis: int, cells: int) -> Points:
    """Equally spaced parameters; in a periodic direction without the end, which is the start."""
    return np.linspace(*surface.domain[axis], cells + 1)[: cells + (not surface.periodic[axis])]


def merge_poles(surface: Surface, parameters: Points, faces: Ints) -> tuple[Points, list[list[int]]]:
    """Makes one vertex of all vertices at a pole and drops the corners and faces that vanish by it."""
    target = np.arange(len(parameters))
    for value, is_pole in zip(surface.domain[1], surface.poles, strict=True):
        if is_pole:
            at_pole = np.flatnonzero(np.abs(parameters[:, 1] - value) < 1e-12)
            target[at_pole] = at_pole[0]
    kept, renumbered = np.unique(target, return_inverse=True)
    merged = [list(dict.fromkeys(face)) for face in renumbered[faces].tolist()]
    return parameters[kept], [face for face in merged if len(face) > 2]
