"""Where a surface runs through itself."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from ._exact_triangles import meet_exactly
from ._one_mesh import one_mesh
from ._ranges import ranges
from .topology import Topology
from .triangulation import triangulate

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

_SURE = 1e-12  # of the extent of the mesh: smaller gaps and overlaps are decided without rounding
_MOST_PAIRS = 4_000_000  # of boxes that are looked at together


def self_intersections(vertices: Tensor, topology: Topology) -> Tensor:
    """Pairs of faces that meet where they should not.

    Triangles without a common vertex meet if they have a point in common, touching included; triangles with one common
    vertex, if they meet anywhere else. Triangles with a common edge are not looked at: what they can do, fold back onto
    each other, is a dihedral angle of 180 degrees. Polygons are cut into triangles as by
    ``triangulation.triangulate``, and two of them meet if triangles of theirs do; the triangles of one polygon are not
    compared.

    Pairs of bounding boxes come from a sweep. Triangles are told apart, or not, by their projections onto all axes that
    can separate them; where that is a matter of rounding, rational arithmetic decides. So the answer is exact for the
    coordinates as they are.

    Args:
        vertices: (V, 3), any length unit.
        topology: any polygons.

    Returns:
        (n, 2) int64 face numbers, ascending; faces without area are left out.

    Raises:
        ShapeError: vertices are not one mesh that fits the topology.

    Example::

        assert not len(self_intersections(vertices, topology))
    """
    places = one_mesh(vertices, topology)
    cut = triangulate(places, topology)
    points, triangles, owners = places.cpu().numpy(), cut.triangles.cpu().numpy(), cut.faces.cpu().numpy()
    p = points[triangles]
    area = np.linalg.norm(np.cross(p[:, 1] - p[:, 0], p[:, 2] - p[:, 0]), axis=1)
    kept = np.flatnonzero(area > 0.0)
    p, triangles, owners = p[kept], triangles[kept], owners[kept]
    found = [np.zeros((0, 2), np.int64)]
    for pairs in _near_pairs(p):
        pairs = pairs[owners[pairs[:, 0]] != owners[pairs[:, 1]]]
        common = (triangles[pairs[:, 0], :, None] == triangles[pairs[:, 1], None, :]).sum((1, 2))
        apart, touching = pairs[common == 0], pairs[common == 1]
        margin = _SURE * float(np.abs(p - p[:1, :1]).max())
        found += [apart[_meet(p, apart, margin)], touching[_meet_elsewhere(p, triangles, touching, margin)]]
    named = np.sort(owners[np.concatenate(found)], axis=1)
    return torch.from_numpy(np.unique(named, axis=0)).to(vertices.device)


def _near_pairs(p: Floats) -> Iterator[Ints]:
    """Pairs (n, 2) of triangles (F, 3, 3) whose boxes meet, some at a time."""
    low, high = p.min(1), p.max(1)
    if not len(p):
        return
    axis = int(np.ptp(low, axis=0).argmax())
    others = [other for other in range(3) if other != axis]
    order = np.argsort(low[:, axis], kind="stable")
    low, high = low[order], high[order]
    last = np.searchsorted(low[:, axis], high[:, axis], side="right")
    counts = last - np.arange(len(p)) - 1
    total = np.cumsum(counts)
    start = 0
    while start < len(p):
        before = total[start - 1] if start else 0
        stop = max(start + 1, int(np.searchsorted(total, before + _MOST_PAIRS)))
        here, own = np.arange(start, stop), counts[start:stop]
        first, second = np.repeat(here, own), ranges(here + 1, own)
        for other in others:
            close = (low[first, other] <= high[second, other]) & (low[second, other] <= high[first, other])
            first, second = first[close], second[close]
        yield np.stack([order[first], order[second]], 1)
        start = stop


def _meet(p: Floats, pairs: Ints, margin: float) -> Mask:
    """Whether triangles without a common vertex have a common point."""
    a, b = p[pairs[:, 0]], p[pairs[:, 1]]
    gaps = np.full(len(pairs), -np.inf)
    for axes in _axes(a, b):
        length = np.linalg.norm(axes, axis=1)
        unit = axes / np.maximum(length, 1e-300)[:, None]
        s, t = (np.einsum("nij,nj->ni", x - a[:, :1], unit) for x in (a, b))
        gap = np.maximum(t.min(1) - s.max(1), s.min(1) - t.max(1))
        gaps = np.maximum(gaps, np.where(length > 0.0, gap, -np.inf))
    result: Mask = gaps < -margin
    for doubtful in np.flatnonzero(np.abs(gaps) <= margin):
        result[doubtful] = meet_exactly(a[doubtful], b[doubtful])
    return result


def _axes(a: Floats, b: Floats) -> Iterator[Floats]:
    """All directions along which triangles (n, 3, 3) can be apart, coplanar ones too, one after the other."""
    sides = [np.roll(x, -1, axis=1) - x for x in (a, b)]
    normals = [np.cross(side[:, 0], side[:, 1]) for side in sides]
    normals = [n / np.linalg.norm(n, axis=1, keepdims=True) for n in normals]
    sides = [side / np.linalg.norm(side, axis=2, keepdims=True) for side in sides]
    yield from normals
    for normal, side in zip(normals, sides, strict=True):
        for i in range(3):
            yield np.cross(normal, side[:, i])
    for i in range(3):
        for j in range(3):
            axes = np.cross(sides[0][:, i], sides[1][:, j])
            small = np.linalg.norm(axes, axis=1) < 1e-6  # parallel sides: the axes above are enough, this one is noise
            yield np.where(small[:, None], 0.0, axes)


def _meet_elsewhere(p: Floats, triangles: Ints, pairs: Ints, margin: float) -> Mask:
    """Whether triangles with one common vertex have another common point."""
    first, second = triangles[pairs[:, 0]], triangles[pairs[:, 1]]
    same = first[:, :, None] == second[:, None, :]
    turns = same.any(2).argmax(1), same.any(1).argmax(1)
    rows = np.arange(len(pairs))[:, None]
    a, b = (p[pairs[:, side]][rows, (turn[:, None] + np.arange(3)) % 3] for side, turn in enumerate(turns))
    s, t = (x[:, 1:] - x[:, :1] for x in (a, b))  # the two sides at the common vertex
    apart = np.zeros(len(pairs), bool)
    for axes in _wedge_axes(s, t):
        axes = axes / np.maximum(np.linalg.norm(axes, axis=1, keepdims=True), 1e-300)
        low, high = np.einsum("nij,nj->ni", s, axes).min(1), np.einsum("nij,nj->ni", t, axes).max(1)
        apart |= (low > margin) & (high < -margin)
    result = np.zeros(len(pairs), bool)
    for doubtful in np.flatnonzero(~apart):
        result[doubtful] = meet_exactly(a[doubtful], b[doubtful], common=True)
    return result


def _wedge_axes(s: Floats, t: Floats) -> Iterator[Floats]:
    """Directions along which two wedges, spanned by (n, 2, 3) sides, may lie on different sides of their tip."""
    s, t = (x / np.linalg.norm(x, axis=2, keepdims=True) for x in (s, t))
    middles = [x.sum(1) / np.linalg.norm(x.sum(1), axis=1, keepdims=True).clip(1e-300) for x in (s, t)]
    yield middles[0] - middles[1]
    normals = [np.cross(x[:, 0], x[:, 1]) for x in (s, t)]
    for i in range(2):
        for j in range(2):  # a plane that nearly holds one side of each
            ridge = np.cross(s[:, i], t[:, j])
            axes = np.cross(ridge, s[:, i] + t[:, j])
            yield from (axes, -axes)
            yield from (ridge, -ridge)
    yield from (sign * normal for normal in normals for sign in (1.0, -1.0))
