"""Regular start surfaces: a hexagon of the triangular lattice in one curve, staggered rows between two."""

from __future__ import annotations

import math

import numpy as np
import torch
from torch import Tensor

from ...._graph import graph_laplacian
from ....curves import ClosedCurve
from ....linear import factorise
from ....topology import Topology

_TURNS = 360  # places of the second curve that are tried against the first


def hexagonal_disk(curve: ClosedCurve, count: int) -> tuple[Tensor, Topology]:
    """All inner vertices have valence 6 and lie in the mean of their neighbours."""
    rings = max(1, round((math.sqrt(12.0 * count - 3.0) - 3.0) / 6.0))  # 1 + 3 n (n + 1) vertices
    while 6 * rings < len(curve.corners):
        rings += 1
    topology = Topology.from_faces(_hexagon(rings))
    vertices = torch.zeros(topology.num_vertices, 3, dtype=torch.float64)
    edge = topology.num_vertices - 6 * rings
    vertices[edge:] = curve.at(curve.spaced(6 * rings))
    return _harmonic(vertices, topology), topology


def _hexagon(rings: int) -> np.ndarray:
    """Triangles (F, 3) of a hexagon of the triangular lattice; ring j holds 6 j vertices, the outermost last."""
    faces = []
    first = [0, *(1 + 3 * j * (j - 1) for j in range(1, rings + 1))]
    for j in range(1, rings + 1):
        inner, outer = first[j - 1], first[j]
        inside, outside = max(6 * (j - 1), 1), 6 * j
        side, step = np.divmod(np.arange(outside), j)
        below = inner + (side * (j - 1) + np.minimum(step, j - 1)) % inside
        here, following = outer + np.arange(outside), outer + (np.arange(outside) + 1) % outside
        faces.append(np.stack([below, here, following], 1))
        if j > 1:
            side, step = np.divmod(np.arange(inside), j - 1)
            ahead = outer + side * j + step + 1
            faces.append(np.stack([inner + np.arange(inside), ahead, inner + (np.arange(inside) + 1) % inside], 1))
    return np.concatenate(faces)


def staggered_annulus(first: ClosedCurve, second: ClosedCurve, count: int) -> tuple[Tensor, Topology]:
    """Rows on the straight lines between the curves, which start where the lines are shortest."""
    around = 0.5 * (first.length + second.length)
    bottom, top = _matched(first, second, _TURNS)
    width = float((first.at(bottom) - second.at(top)).norm(dim=1).mean())
    edge = math.sqrt(around * width / count * 2.0 / math.sqrt(3.0))
    columns = max(6, len(first.corners), len(second.corners), round(around / edge))
    rows = max(2, 2 * round(0.5 * (count / columns - 1.0)))  # even, so that neither curve has a shifted row
    columns = max(6, len(first.corners), len(second.corners), round(count / (rows + 1)))
    bottom, top = _matched(first, second, columns)
    places = []
    for row in range(rows + 1):
        shift = 0.5 * (row % 2)
        ends = (first.at(_between(bottom, shift)), second.at(_between(top, shift)))
        places.append(ends[0].lerp(ends[1], row / rows))
    return torch.cat(places), Topology.from_faces(_rows(rows, columns))


def _matched(first: ClosedCurve, second: ClosedCurve, count: int) -> tuple[Tensor, Tensor]:
    """Parameters (count,) on both curves, of either direction on the second, that lie as near as possible."""
    bottom, top = first.spaced(count), second.spaced(count)
    points, best, nearest = first.at(bottom), top, math.inf
    for candidate in (top, top.flip(0)):
        places = second.at(candidate)
        gaps = [float((points - places.roll(shift, 0)).square().sum()) for shift in range(count)]
        if min(gaps) < nearest:
            nearest, best = min(gaps), candidate.roll(int(np.argmin(gaps)), 0)
    return bottom, best


def _between(parameters: Tensor, shift: float) -> Tensor:
    """Parameters shifted by a fraction of the way to the next ones, around the circle."""
    ahead = torch.remainder(parameters.roll(-1, 0) - parameters + 0.5, 1.0) - 0.5
    return parameters + shift * ahead


def _rows(rows: int, columns: int) -> np.ndarray:
    """Triangles between rows, of which every second one is shifted by half a cell."""
    i = np.arange(columns)
    after = (i + 1) % columns
    faces = []
    for row in range(rows):
        a, b = row * columns + i, row * columns + after
        c, d = a + columns, b + columns
        pairs = ((a, b, c), (b, d, c)) if row % 2 == 0 else ((a, b, d), (a, d, c))
        faces += [np.stack(triangle, 1) for triangle in pairs]
    return np.concatenate(faces)


def _harmonic(vertices: Tensor, topology: Topology) -> Tensor:
    """Puts every inner vertex in the mean of its neighbours; boundary vertices stay."""
    free = np.flatnonzero(~topology.is_boundary_vertex.numpy())
    held = np.flatnonzero(topology.is_boundary_vertex.numpy())
    rows = graph_laplacian(topology)[free]
    if not free.size:
        return vertices.clone()
    pulls = torch.from_numpy(-(rows[:, held] @ vertices[held].numpy()))
    result = vertices.clone()
    result[free] = factorise(rows[:, free]).solve(pulls).values
    return result
