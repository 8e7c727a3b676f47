"""Built-in roofs: a free-form canopy, and a hybrid roof of triangles and planar quads."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from torchfair.errors import TorchfairError
from torchfair.topology import Topology

from ._checks import require_positive
from ._quadrature import Domain
from .rotated_lattice import rotated_lattice
from .shape_mesh import check_count
from .surface import Surface

Points = npt.NDArray[np.float64]


@dataclass(frozen=True)
class Canopy(Surface):
    """Station canopy: a vault along x that rises and falls from bay to bay, with flared eaves; normals up.

    Crests are domes (K > 0), the valleys between them saddles (K < 0), and so are the flares. With
    ``t = v / (width / 2)`` the height is ``rise (1 - t^2) (1 - flare t^2) (1 + swing cos(2 pi u bays / length))``;
    in plan the long sides bulge by ``bulge``. Lengths in metres, say. Parameter lines are not principal. C by
    quadrature.
    """

    length: float = 36.0
    width: float = 16.0
    rise: float = 3.5
    bays: float = 2.0
    swing: float = 0.45
    flare: float = 0.6
    bulge: float = 0.12

    def __post_init__(self) -> None:
        require_positive(length=self.length, width=self.width, rise=self.rise, bays=self.bays)

    @property
    def domain(self) -> Domain:
        """``|u| <= length / 2`` along the canopy, ``|v| <= width / 2`` across."""
        return ((-self.length / 2, self.length / 2), (-self.width / 2, self.width / 2))

    def _position(self, u: Tensor, v: Tensor) -> Tensor:
        t = v / (self.width / 2)
        plan = 1 + self.bulge * (math.pi * u / self.length).cos()
        wave = 1 + self.swing * (2 * math.pi * self.bays / self.length * u).cos()
        height = self.rise * (1 - t**2) * (1 - self.flare * t**2) * wave
        return torch.stack([u, v * plan, height], dim=-1)


def example_roof() -> tuple[Tensor, Topology]:
    """The built-in example: a :class:`Canopy` of about 1600 triangles whose edges ignore its curvature.

    Returns ``(vertices (V, 3) float64, topology)``. The lattice, squares cut by diagonals, is turned against the
    axis of the canopy, so its normal variation lies a third above C of the surface: there is something to gain.
    """
    mesh = rotated_lattice(Canopy(), 20, 40, 0.3, kind="split")
    return mesh.vertices, mesh.topology


def hybrid_roof(
    strips: int = 13, columns: int = 47, *, irregularity: float = 0.3, seed: int = 0
) -> tuple[Tensor, Topology]:
    r"""A rolling roof of alternating strips of planar quads and of triangles, about 1250 vertices by default.

    The roof is a translational surface ``a(u) + b(v)`` with domes, hollows and saddles; a and b are not
    orthogonal, so its edges are not principal. Every strip of quads is a polyline and a copy of it moved along
    b, so all quads are parallelograms and exactly planar, wherever the polyline has its vertices. Neighbouring
    strips are shifted by half a cell and joined by triangles::

        o-----o-----o-----o     strip of quads
        |     |     |     |
        o-----o-----o-----o
        | \   / \   / \   / |     strip of triangles
        o--o-----o-----o--o
        |  |     |     |  |     strip of quads

    ``irregularity`` moves the vertices of each polyline at random, along it by up to half that share of a cell
    and up or down by up to three twentieths of it, so that the roof is not yet optimal.

    Args:
        strips: number of quad strips, at least 2.
        columns: quads along a strip, at least 2.
        irregularity: from 0 (all vertices on the translational surface) to below 1.
        seed: of the random generator.

    Returns:
        ``(vertices (V, 3) float64, topology)``; faces counterclockwise seen from above. Lengths in metres, say.

    Raises:
        MeshError: for too few strips or columns.
        TorchfairError: if ``irregularity`` is not in ``[0, 1)``.
    """
    check_count("strips", strips, 2, "triangles lie between two strips")
    check_count("columns", columns, 2, "the shifted strips need inner vertices")
    if not 0 <= irregularity < 1:
        raise TorchfairError(f"irregularity must be at least 0 and less than 1, got {irregularity}")
    random = np.random.default_rng(seed)
    vertices: list[Points] = []
    faces: list[list[int]] = []
    previous: list[int] = []
    for strip in range(strips):
        polyline = _polyline(columns, shifted=strip % 2 == 1, irregularity=irregularity, random=random)
        start, size = sum(map(len, vertices)), len(polyline)
        low, high = list(range(start, start + size)), list(range(start + size, start + 2 * size))
        place = _profile(np.array([2 * strip, 2 * strip + 1]) / (2 * strips - 1))
        vertices += [polyline + place[0], polyline + place[1]]
        faces += _zip(previous, low)
        faces += [[a, b, c, d] for a, b, c, d in zip(low, low[1:], high[1:], high, strict=False)]
        previous = high
    return torch.from_numpy(np.concatenate(vertices)), Topology.from_faces(faces)


def _polyline(columns: int, *, shifted: bool, irregularity: float, random: np.random.Generator) -> Points:
    """Vertices along a strip; shifted ones lie in the middles of the cells, with the two ends added."""
    places = np.arange(columns) + 0.5 if shifted else np.arange(1.0, columns)
    places = places + 0.5 * irregularity * random.uniform(-1, 1, len(places))
    points = _rail(np.concatenate([[0.0], places / columns, [1.0]]))
    cell = _SPAN / columns
    points[:, 2] += 0.15 * irregularity * cell * random.uniform(-1, 1, len(points))
    return points


_SPAN = 44.0


def _rail(u: Points) -> Points:
    """The curve a(u), u in [0, 1]: along the roof."""
    side = 3 * np.sin(math.pi * u) ** 2 + 6 * u
    return np.stack([_SPAN * u, side, 1.6 * np.sin(4.4 * math.pi * u + 0.4) + 1.2 * u], axis=1)


def _profile(v: Points) -> Points:
    """The curve b(v), v in [0, 1]: across the roof."""
    return np.stack([2 * np.sin(math.pi * v) + 2 * v, _SPAN / 2 * v, 1.3 * np.sin(2.6 * math.pi * v + 0.8)], axis=1)


def _zip(low: list[int], high: list[int]) -> list[list[int]]:
    """Triangles between two rows, one of which has a vertex more because it is shifted by half a cell.

    Steps are taken in turn, starting and ending on the row with more vertices.
    """
    faces: list[list[int]] = []
    if not low:
        return faces
    i, j = 0, 0
    for step in range(len(low) + len(high) - 2):
        on_low = (step % 2 == 0) == (len(low) > len(high))
        if on_low:
            faces.append([low[i], low[i + 1], high[j]])
            i += 1
        else:
            faces.append([low[i], high[j + 1], high[j]])
            j += 1
    return faces
