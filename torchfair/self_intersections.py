"""Where a surface runs through itself."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from ._embedded_stars import embedded_stars
from ._exact_triangles import meet_exactly
from ._one_mesh import one_mesh
from ._ranges import ranges
from .topology import Topology
from .triangulation import triangulate

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]

_SURE = 1e-12  # of the extent of the mesh: smaller gaps and overlaps are decided without rounding
_MOST_PAIRS = 1_000_000  # of boxes that are looked at together
_MOST_CELLS = 2_000  # of the grid, along an axis
_MOST_ENTRIES = 8  # of boxes in its cells, on average


def self_intersections(vertices: Tensor, topology: Topology) -> Tensor:
    """Pairs of faces that meet where they should not.

    Triangles without a common vertex meet if they have a point in common, touching included; triangles with one common
    vertex, if they meet anywhere else. Triangles with a common edge are not looked at: what they can do, fold back onto
    each other, is a dihedral angle of 180 degrees. Polygons are cut into triangles as by
    ``triangulation.triangulate``, and two of them meet if triangles of theirs do; the triangles of one polygon are not
    compared.

    Pairs of bounding boxes come from a grid. Triangles are told apart, or not, by their projections onto all axes that
    can separate them; where that is a matter of rounding, rational arithmetic decides. So the answer is exact for the
    coordinates as they are. Stars that are seen to run around their vertex once, from somewhere, are settled as such.

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
    margin = _SURE * float(np.abs(p - p[:1, :1]).max()) if len(p) else 0.0
    settled = np.zeros(len(points), bool)
    if topology.has_fans:
        settled = embedded_stars(points, triangles, topology.is_boundary_vertex.cpu().numpy(), margin)
    kept = np.flatnonzero(area > 0.0)
    p, triangles, owners = p[kept], triangles[kept], owners[kept]
    corners = [np.ascontiguousarray(column) for column in triangles.T]
    found = [np.zeros((0, 2), np.int64)]
    for pairs in _near_pairs(p):
        pairs = pairs[owners[pairs[:, 0]] != owners[pairs[:, 1]]]
        common, vertex = _common_vertices(corners, pairs)
        apart, touching = pairs[common == 0], pairs[(common == 1) & ~settled[vertex]]
        found += [apart[_meet(p, apart, margin)], touching[_meet_elsewhere(p, triangles, touching, margin)]]
    named = np.sort(owners[np.concatenate(found)], axis=1)
    return torch.from_numpy(np.unique(named, axis=0)).to(vertices.device)


def _common_vertices(corners: list[Ints], pairs: Ints) -> tuple[Ints, Ints]:
    """(n,) how many vertices two triangles have in common; and which, where it is one, else 0."""
    first, second = ([corner[side] for corner in corners] for side in (pairs[:, 0], pairs[:, 1]))
    count, vertex = np.zeros(len(pairs), np.int64), np.zeros(len(pairs), np.int64)
    for own in first:
        shared = (own == second[0]) | (own == second[1]) | (own == second[2])
        count += shared
        vertex += own * shared
    return count, np.where(count == 1, vertex, 0)


def _near_pairs(p: Floats) -> Iterator[Ints]:
    """Pairs (n, 2) of triangles (F, 3, 3) whose boxes meet, some at a time.

    Every box is entered into the cells of a grid that it meets, cells of about the size of the boxes; a pair belongs to
    the cell in which both boxes begin.
    """
    if not len(p):
        return
    a, b, c = (p[:, i] for i in range(3))
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    first_cell, last_cell, shape = _cells(low, high)
    low, high = np.ascontiguousarray(low.T), np.ascontiguousarray(high.T)
    sizes = last_cell - first_cell + 1
    owner = np.repeat(np.arange(len(p)), sizes.prod(1))
    within = ranges(np.zeros(len(p), np.int64), sizes.prod(1))
    across = sizes[owner]
    x, rest = within // (across[:, 1] * across[:, 2]), within % (across[:, 1] * across[:, 2])
    steps = np.stack([x, rest // across[:, 2], rest % across[:, 2]], 1)
    cell = np.ravel_multi_index(tuple((first_cell[owner] + steps).T), shape)
    order = np.argsort(cell, kind="stable")
    cell, owner = cell[order], owner[order]
    counts = np.searchsorted(cell, cell, side="right") - np.arange(len(cell)) - 1
    total = np.cumsum(counts)
    start = 0
    while start < len(cell):
        before = total[start - 1] if start else 0
        stop = max(start + 1, int(np.searchsorted(total, before + _MOST_PAIRS)))
        here, own = np.arange(start, stop), counts[start:stop]
        place, second = np.repeat(here, own), owner[ranges(here + 1, own)]
        first = owner[place]
        for axis in range(3):
            close = (low[axis][first] <= high[axis][second]) & (low[axis][second] <= high[axis][first])
            place, first, second = place[close], first[close], second[close]
        begins = np.ravel_multi_index(tuple(np.maximum(first_cell[first], first_cell[second]).T), shape)
        mine = begins == cell[place]
        yield np.stack([first[mine], second[mine]], 1)
        start = stop


def _cells(low: Floats, high: Floats) -> tuple[Ints, Ints, tuple[int, int, int]]:
    """First and last cell (F, 3) of every box in a grid, and its shape; no more than some entries for every box."""
    origin, extent = low.min(0), high.max(0) - low.min(0)
    size = max(2.0 * float((high - low).mean()), float(extent.max()) / _MOST_CELLS)
    while True:
        counts = np.clip(np.floor(extent / size), 1, _MOST_CELLS).astype(np.int64) if size > 0.0 else np.ones(3, int)
        scale = np.divide(counts, extent, out=np.zeros(3), where=extent > 0.0)
        first, last = (np.clip(((x - origin) * scale).astype(np.int64), 0, counts - 1) for x in (low, high))
        if (last - first + 1).prod(1).sum() <= _MOST_ENTRIES * len(low) or (counts == 1).all():
            return first, last, (int(counts[0]), int(counts[1]), int(counts[2]))
        size *= 2.0


def _meet(p: Floats, pairs: Ints, margin: float) -> Mask:
    """Whether triangles without a common vertex have a common point."""
    a, b = p[pairs[:, 0]], p[pairs[:, 1]]
    left = np.arange(len(pairs))
    for normal in _normals(a), _normals(b):  # along these nearly all of them are apart
        left = left[_gaps(a[left], b[left], normal[left]) <= margin]
    a, b = a[left], b[left]
    gaps = np.full(len(left), -np.inf)
    for axes in _axes(a, b):
        gaps = np.maximum(gaps, _gaps(a, b, axes))
    result: Mask = np.zeros(len(pairs), bool)
    result[left] = gaps < -margin
    for doubtful in np.flatnonzero(np.abs(gaps) <= margin):
        result[left[doubtful]] = meet_exactly(a[doubtful], b[doubtful])
    return result


def _gaps(a: Floats, b: Floats, axes: Floats) -> Floats:
    """(n,) by how much triangles are apart along axes (n, 3) of any length; negative where they overlap."""
    length = np.linalg.norm(axes, axis=1)
    unit = axes / np.maximum(length, 1e-300)[:, None]
    s, t = (np.einsum("nij,nj->ni", x - a[:, :1], unit) for x in (a, b))
    gaps: Floats = np.where(length > 0.0, np.maximum(t.min(1) - s.max(1), s.min(1) - t.max(1)), -np.inf)
    return gaps


def _normals(a: Floats) -> Floats:
    """(n, 3) of triangles (n, 3, 3), of any length."""
    normals: Floats = np.cross(a[:, 1] - a[:, 0], a[:, 2] - a[:, 1])
    return normals


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
    left = np.arange(len(pairs))
    for some in _middle_axes, _wedge_axes:  # the first ones tell most of them apart
        here, there = s[left], t[left]
        apart = np.zeros(len(left), bool)
        for axes in some(here, there):
            axes = axes / np.maximum(np.linalg.norm(axes, axis=1, keepdims=True), 1e-300)
            low, high = np.einsum("nij,nj->ni", here, axes).min(1), np.einsum("nij,nj->ni", there, axes).max(1)
            apart |= (low > margin) & (high < -margin)
        left = left[~apart]
    result = np.zeros(len(pairs), bool)
    for doubtful in left:
        result[doubtful] = meet_exactly(a[doubtful], b[doubtful], common=True)
    return result


def _middle_axes(s: Floats, t: Floats) -> Iterator[Floats]:
    """Directions along which two wedges, spanned by (n, 2, 3) sides, may lie on different sides of their tip."""
    s, t = (x / np.linalg.norm(x, axis=2, keepdims=True) for x in (s, t))
    middles = [x.sum(1) / np.linalg.norm(x.sum(1), axis=1, keepdims=True).clip(1e-300) for x in (s, t)]
    yield middles[0] - middles[1]


def _wedge_axes(s: Floats, t: Floats) -> Iterator[Floats]:
    """More directions of that kind."""
    s, t = (x / np.linalg.norm(x, axis=2, keepdims=True) for x in (s, t))
    normals = [np.cross(x[:, 0], x[:, 1]) for x in (s, t)]
    for i in range(2):
        for j in range(2):  # a plane that nearly holds one side of each
            ridge = np.cross(s[:, i], t[:, j])
            axes = np.cross(ridge, s[:, i] + t[:, j])
            yield from (axes, -axes)
            yield from (ridge, -ridge)
    yield from (sign * normal for normal in normals for sign in (1.0, -1.0))
