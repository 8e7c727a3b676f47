"""Regular lattices turned against the parameter lines."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
import torch

from torchfair.errors import MeshError

from ._checks import require_finite
from ._delaunay import Mask, Triangulation, triangulate
from .shape_mesh import Points, ShapeMesh, build_mesh, check_count
from .surface import Surface

Ints = npt.NDArray[np.int64]
Kind = Literal["triangles", "quads", "split"]

_TOO_COARSE = "the lattice is too coarse to close up around the surface. Ask for more rows or columns."
_GAP = 0.55  # lattice points closer to the boundary than this many spacings are left out


def rotated_lattice(surface: Surface, rows: int, columns: int, angle: float, *, kind: Kind = "triangles") -> ShapeMesh:
    """Lattice whose first direction makes ``angle`` with the u-lines.

    It has about as many vertices as a grid of ``rows`` by ``columns`` cells, and is regular in the parameter plane
    after u and v are scaled by the mean lengths of ``x_u`` and ``x_v``: on the surface it is nearly isotropic, and
    exactly so where the parametrisation is isothermal.

    Patch boundaries are clean: their vertices lie equally spaced on the parameter rectangle, and a band of
    triangles, about one cell wide, joins them to the lattice. In periodic directions the lattice closes up
    without a seam: angle and spacing are rounded to the nearest lattice that does so (in both directions: up
    to a slight shear).

    Args:
        surface: where the vertices lie.
        rows: with ``columns``, sets the density of vertices.
        columns: see ``rows``.
        angle: radians.
        kind: equilateral ``"triangles"``; square ``"quads"``, which are not planar (the band along boundaries
            stays triangular); or ``"split"``: squares cut along the diagonal at ``angle + pi/4``.

    Raises:
        MeshError: for a sphere that reaches a pole, where no such lattice exists, an unknown kind, and meshes
            too coarse to close up.
    """
    if kind not in ("triangles", "quads", "split"):
        raise MeshError(f'kind must be "triangles", "quads" or "split", got {kind!r}')
    if any(surface.poles):
        raise MeshError(
            "there is no lattice around a pole. Use a zone, such as Sphere(latitudes=(-1, 1)), or icosphere."
        )
    require_finite(angle=angle)
    check_count("rows", rows, 3, "the lattice must fit")
    check_count("columns", columns, 3, "the lattice must fit")
    scale, size = metric_scale(surface)
    lattice = _closed_lattice(size, surface.periodic, rows * columns, angle, hexagonal=kind == "triangles")
    labels, inner = _inner_points(lattice)
    outer = boundary_points(size, surface.periodic, lattice.spacing)
    points = np.concatenate([inner, outer])
    fixed = np.arange(len(points)) >= len(inner)
    triangulation = triangulate(points, fixed, size, surface.periodic)
    faces: object = triangulation.faces
    if kind != "triangles":
        faces = _square_cells(lattice, labels, triangulation, split=kind == "split")
    origin = np.array([ends[0] for ends in surface.domain])
    try:
        return build_mesh(surface, origin + points / scale, faces)
    except MeshError as error:  # two edges between the same vertices, around the surface on either side
        raise MeshError(_TOO_COARSE) from error


def metric_scale(surface: Surface) -> tuple[Points, tuple[float, float]]:
    """Mean lengths of ``x_u, x_v`` over the patch, and the parameter rectangle measured with them."""
    (u0, u1), (v0, v1) = surface.domain
    middles = (torch.arange(16, dtype=torch.float64) + 0.5) / 16
    u, v = torch.meshgrid(u0 + (u1 - u0) * middles, v0 + (v1 - v0) * middles, indexing="ij")
    speeds = (torch.linalg.vector_norm(x, dim=-1) for x in surface.tangents(u, v))
    scale = np.array([float(speed.mean()) for speed in speeds])
    return scale, (float(scale[0] * (u1 - u0)), float(scale[1] * (v1 - v0)))


def boundary_points(size: tuple[float, float], periodic: tuple[bool, bool], spacing: float) -> Points:
    """Points about ``spacing`` apart on the sides of the rectangle that are boundary, corners included once."""
    width, height = (np.arange(count) / count for count in (max(round(s / spacing), 1) for s in size))
    zero, one = np.zeros_like, np.ones_like
    sides = []
    if not periodic[1]:
        sides += [np.stack([width, zero(width)], 1), np.stack([1 - width, one(width)], 1)]
    if not periodic[0]:
        sides += [np.stack([one(height), height], 1), np.stack([zero(height), 1 - height], 1)]
    points: Points = np.concatenate([np.zeros((0, 2)), *sides]) * np.array(size)
    return points


@dataclass(frozen=True)
class _Lattice:
    """Points ``centre + basis @ label`` for integer labels, in a rectangle.

    Attributes:
        size: of the rectangle.
        periods: labels of the period vectors, as columns; zero columns where the rectangle does not close up.
    """

    size: tuple[float, float]
    periodic: tuple[bool, bool]
    spacing: float
    basis: Points
    periods: Ints
    centre: Points

    def reduce(self, labels: Ints) -> Ints:
        """The representative of labels ``(n, 2)`` modulo the periods; integer arithmetic throughout."""
        n, reduced = self.periods, labels
        if all(self.periodic):
            determinant = n[0, 0] * n[1, 1] - n[0, 1] * n[1, 0]
            adjugate = np.array([[n[1, 1], -n[0, 1]], [-n[1, 0], n[0, 0]]])
            reduced = labels - (labels @ adjugate.T // determinant) @ n.T
        elif any(self.periodic):
            step = n.sum(1)  # the only period
            reduced = labels - np.outer(labels @ step // (step @ step), step)
        return reduced


def _closed_lattice(
    size: tuple[float, float], periodic: tuple[bool, bool], count: int, angle: float, *, hexagonal: bool
) -> _Lattice:
    """The lattice of about ``count`` points, adjusted so that the period vectors are lattice vectors."""
    area = size[0] * size[1]
    spacing = float(np.sqrt(area / count * (2 / np.sqrt(3) if hexagonal else 1)))
    turns = angle + np.array([0, np.pi / 3 if hexagonal else np.pi / 2])
    basis = spacing * np.stack([np.cos(turns), np.sin(turns)])
    periods = np.rint(np.linalg.solve(basis, np.diag(size))).astype(np.int64) * np.array(periodic, np.int64)
    if all(periodic):
        _require_closing(abs(np.linalg.det(periods)) >= 0.5)
        basis = np.diag(size) @ np.linalg.inv(periods)
    elif any(periodic):
        _require_closing(bool(periods.any()))
        axis = periodic.index(True)
        ratio = complex(*np.diag(size)[axis]) / complex(*(basis @ periods[:, axis]))
        basis = np.array([[ratio.real, -ratio.imag], [ratio.imag, ratio.real]]) @ basis
    return _Lattice(size, periodic, spacing, basis, periods, 0.5 * np.array(size))


def _require_closing(closes: bool) -> None:
    if not closes:
        raise MeshError(_TOO_COARSE)


def _inner_points(lattice: _Lattice) -> tuple[Ints, Points]:
    """Labels and positions of the lattice points, one for each point of the closed surface."""
    size = np.array(lattice.size)
    half = 0.5 * size + lattice.spacing
    reach = np.ceil(np.abs(np.linalg.inv(lattice.basis)) @ half).astype(np.int64)
    spans = [np.arange(-r, r + 1) for r in reach]
    labels = np.stack(np.meshgrid(*spans, indexing="ij"), axis=-1).reshape(-1, 2)
    near = (np.abs(labels @ lattice.basis.T) <= half).all(1)
    labels = np.unique(lattice.reduce(labels[near]), axis=0)
    points = lattice.centre + labels @ lattice.basis.T
    wraps = np.floor(points / size).astype(np.int64) * np.array(lattice.periodic)
    labels, points = labels - wraps @ lattice.periods.T, points - wraps * size
    gap = _GAP * lattice.spacing
    inside: Mask = (np.array(lattice.periodic) | ((points > gap) & (points < size - gap))).all(axis=1)
    return labels[inside], points[inside]


def _square_cells(lattice: _Lattice, labels: Ints, triangulation: Triangulation, *, split: bool) -> list[list[int]]:
    """Joins the two triangles of every lattice square; ``split`` cuts it again along its (1, 1) diagonal."""
    faces, tiles = triangulation
    known: Mask = faces.max(axis=1) < len(labels)
    corner = labels[np.where(known[:, None], faces, 0)] + tiles @ lattice.periods.T
    origin = corner.min(1)
    spread = corner.max(1) - origin
    known = known & (spread[:, 0] == 1) & (spread[:, 1] == 1)
    cells, owner = np.unique(lattice.reduce(origin[known]), axis=0, return_inverse=True)
    squares = np.full((len(cells), 4), -1)
    code = (corner[known] - origin[known][:, None]) @ [1, 2]
    squares[owner.reshape(-1, 1), code] = faces[known]
    whole: Mask = squares.min(axis=1) >= 0
    rest: Mask = ~known
    rest[known] = ~whole[owner.ravel()]
    quads = squares[whole][:, [0, 1, 3, 2]]
    pieces = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]]) if split else quads
    joined: list[list[int]] = [*pieces.tolist(), *faces[rest].tolist()]
    return joined
