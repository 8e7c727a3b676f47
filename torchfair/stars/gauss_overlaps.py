"""Where the Gauss image of a whole mesh crosses itself."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from .._one_mesh import one_mesh
from ..errors import MeshError
from ..geometry import gauss_image
from ..topology import Topology
from .pyramid import normal_noise

MOST_PAIRS = 30_000_000
"""Pairs of arcs near each other from which on :func:`gauss_overlaps` gives up, by default."""

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
_BLOCK = 1 << 15  # arcs whose neighbours are listed at a time


class GaussOverlaps(NamedTuple):
    """Crossings of the arcs of a Gauss image.

    Attributes:
        crossings: pairs of arcs that cross.
        within_pyramids: pairs among them whose edges meet at an inner vertex: self-intersections of normal
            pyramids.
    """

    crossings: int
    within_pyramids: int

    @property
    def between_stars(self) -> int:
        """Crossings of arcs that belong to no common pyramid, where parts of the surface have equal normals."""
        return self.crossings - self.within_pyramids


def gauss_overlaps(vertices: Tensor, topology: Topology, *, most_pairs: int = MOST_PAIRS) -> GaussOverlaps:
    """Counts the pairs of arcs of the Gauss image that cross in inner points of both.

    What counts as a crossing is said at :func:`~torchfair.stars.arc_crossings`. A smooth surface that has every
    normal only once has an image without crossings; one that has some normals in several places, such as a
    torus, has crossings ``between_stars`` however well it is meshed.

    Arcs that can meet are found with a tree of their midpoints for each class of lengths, so that it costs a
    little more than the number of pairs near each other.

    Args:
        vertices: positions (V, 3) of one mesh, any length unit.
        topology: connectivity; any polygons, mixed.
        most_pairs: how many pairs near each other to look at, at most: about 30 seconds with the default.

    Raises:
        ShapeError: if ``vertices`` is not a floating tensor (V, 3).
        MeshError: if there are more pairs than that. Crumpled meshes have most arcs near each other.
    """
    vertices = one_mesh(vertices, topology)
    image = gauss_image(vertices, topology)
    points: Floats = image.points.cpu().to(torch.float64).numpy()
    noise: Floats = normal_noise(vertices, topology).cpu().to(torch.float64).numpy()
    arcs: Ints = image.arcs.cpu().numpy()
    edges: Ints = topology.interior_edges.cpu().numpy()
    inner = ~topology.is_boundary_vertex.cpu().numpy()
    total = local = 0
    for first, second in _near_pairs(points, arcs, most_pairs):
        a, b, c, d = arcs[first, 0], arcs[first, 1], arcs[second, 0], arcs[second, 1]
        crossed = _cross(points, noise, a, b, c, d)
        first, second = first[crossed], second[crossed]
        total += len(first)
        for i, j in ((0, 0), (0, 1), (1, 0), (1, 1)):
            shared = edges[first, i]
            local += int((inner[shared] & (shared == edges[second, j])).sum())
    return GaussOverlaps(total, local)


def _near_pairs(points: Floats, arcs: Ints, most_pairs: int) -> Iterator[tuple[Ints, Ints]]:
    """Pairs of arcs whose midpoints are no farther apart than half their lengths together, in blocks.

    Arcs are sorted into classes of lengths, each twice as long as the next; one long arc then makes no
    trouble for the many short ones.
    """
    from scipy.spatial import cKDTree

    start, stop = points[arcs[:, 0]], points[arcs[:, 1]]
    chords = np.linalg.norm(stop - start, axis=1)
    used = np.flatnonzero((chords > 0) & np.isfinite(chords) & (np.abs(start).sum(1) > 0) & (np.abs(stop).sum(1) > 0))
    middle, reach = (start + stop)[used] / 2, chords[used] / 2
    # A chord lies below its arc; the middle of the arc stands for it, and its reach is half of its length at most.
    middle = middle / np.maximum(np.linalg.norm(middle, axis=1, keepdims=True), 1e-12)
    reach = np.minimum(reach * np.pi / 2, 2.0)
    level = np.floor(np.log2(reach)).astype(np.int64)
    members = [np.flatnonzero(level == value) for value in np.unique(level)]
    trees = [cKDTree(middle[group]) for group in members]
    longest = [float(reach[group].max()) for group in members]
    couples = [(i, j) for i in range(len(members)) for j in range(i, len(members))]
    sizes = [int(trees[i].count_neighbors(trees[j], longest[i] + longest[j])) for i, j in couples]
    if sum(sizes) > 2 * most_pairs:
        raise MeshError(
            f"the Gauss image has {sum(sizes)} pairs of arcs near each other, more than the {most_pairs} that are "
            "looked at. Raise most_pairs, or count the self-intersections of pyramids only."
        )
    for i, j in couples:
        for at in range(0, len(members[i]), _BLOCK):
            some = members[i][at : at + _BLOCK]
            table = cKDTree(middle[some]).sparse_distance_matrix(
                trees[j], longest[i] + longest[j], output_type="ndarray"
            )
            first, second = some[table["i"]], members[j][table["j"]]
            kept = first < second if i == j else slice(None)
            yield used[first[kept]], used[second[kept]]


def _cross(points: Floats, noise: Floats, a: Ints, b: Ints, c: Ints, d: Ints) -> npt.NDArray[np.bool_]:
    """Whether arcs ``ab`` and ``cd`` cross, see :func:`~torchfair.stars.arc_crossings`."""
    worst = np.maximum(np.maximum(noise[a], noise[b]), np.maximum(noise[c], noise[d])) + 8 * np.finfo(float).eps
    signs = [_side(points, worst, *triple) for triple in ((a, b, c), (a, b, d), (c, d, a), (c, d, b))]
    s, ahead, back, back_ahead = signs
    apart = (a != c) & (a != d) & (b != c) & (b != d)
    crossed: npt.NDArray[np.bool_] = (s != 0) & (ahead == -s) & (back == ahead) & (back_ahead == -back) & apart
    return crossed


def _side(points: Floats, noise: Floats, a: Ints, b: Ints, c: Ints) -> npt.NDArray[np.int8]:
    step, offset = points[b] - points[a], points[c] - points[a]
    determinant = np.einsum("ij,ij->i", np.cross(points[a], step), offset)
    sides = sum(np.linalg.norm(side, axis=1) for side in (step, offset, points[c] - points[b]))
    doubt = noise * (sides + 4 * noise)  # as in arcs.side_determinants
    return np.where(np.abs(determinant) > doubt, np.sign(determinant), 0).astype(np.int8)
