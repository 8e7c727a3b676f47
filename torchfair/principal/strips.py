"""Developable strips orthogonal to a mesh along polylines (paper section 2.3, Figs. 5 and 14)."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from ..errors import TorchfairError
from ..topology import Topology
from ._overlaps import pieces
from ._sheet import shelves, upright
from ._strip_input import prepare
from ._unroll import Floats, Ints, unroll
from .developable_strips import DevelopableStrips
from .strip_limits import require_clear


def developable_strips(
    vertices: Tensor,
    polylines: Sequence[Tensor],
    normals: Tensor,
    height: float,
    *,
    depth: float = 0.0,
    gap: float | None = None,
    sheet_width: float | None = None,
    sheet_height: float | None = None,
) -> DevelopableStrips:
    """Strips of quads ``v, w, w + h n(w), v + h n(v)`` along polylines, unrolled and laid out on a sheet.

    A quad is planar exactly if ``det(n(v), n(w), w - v) = 0``, which principal-symmetric meshes fulfil along principal
    edges; :attr:`DevelopableStrips.planarity` and :attr:`DevelopableStrips.isometry_errors` tell how well.

    Closed polylines are cut at their first vertex. Strips that would overlap themselves on the sheet, as rings that
    wind round more than once do, are cut into pieces that do not, if possible equally long ones; so are strips that
    are too long or too high for the sheet. On the sheet strips lie in rows, those with high bounding boxes first.

    Args:
        vertices: (V, 3) positions, any length unit.
        polylines: vertex numbers, two or more each, such as from :meth:`PrincipalEdges.polylines`; a closed one
            repeats its first vertex at the end.
        normals: (V, 3), of any length; zero vectors where there is none: strips leave out the edges there.
        height: from the mesh to the side of the normals, in the unit of the vertices.
        depth: from the mesh to the other side.
        gap: distance between strips on the sheet and to its rim, at least as much as the cut and the thickness of the
            material ask for; a quarter of the width of the strips by default.
        sheet_width: width of the sheet; by default the best of several, from about square to twice as broad as that.

        sheet_height: height of a sheet, of which there are as many as it takes, one above the other; by default there
            is one, as high as it has to be.

    Raises:
        ShapeError: for tensors of another shape.
        TorchfairError: for numbers that are not finite, lengths that are negative, a width of zero, or a sheet that is
            too narrow for a single quad.
        MeshError: if a polyline has a vertex that does not exist, an edge has no length, a normal lies along an edge,
            or rulings meet within a strip, naming edges and :func:`strip_limits`.
    """
    _check_lengths(height=height, depth=depth, gap=gap, sheet_width=sheet_width, sheet_height=sheet_height)
    given = prepare(vertices, polylines, normals)
    require_clear(given, height, depth)
    gap = (height + depth) / 4 if gap is None else gap
    flat, cut, owners = [], [], []
    for line, number in zip(given.lines, given.numbers, strict=True):
        foot, across = given.points[line], given.normals[line]
        rulings = np.stack([foot - depth * across, foot + height * across], axis=1)
        unrolled = unroll(rulings)
        for begin, end in itertools.pairwise(pieces(unrolled)):
            for a, b, part in _fitting(unrolled, begin, end, (sheet_width, sheet_height), gap):
                flat.append(part)
                cut.append((line[a : b + 1], rulings[a : b + 1]))
                owners.append(number)
    layout = shelves(np.array([part.max((0, 1)) for part in flat]).reshape(-1, 2), gap, sheet_width, sheet_height)
    placed = [part + corner for part, corner in zip(flat, layout.corners, strict=True)]
    offsets = np.cumsum([0, *(len(line) for line, _ in cut)])
    count = int(offsets[-1])
    return DevelopableStrips(
        vertices=torch.from_numpy(np.concatenate([np.zeros((0, 2, 3)), *(part for _, part in cut)]).reshape(-1, 3)),
        topology=Topology.from_faces(_quads(offsets), num_vertices=2 * count),
        uv=torch.from_numpy(np.concatenate([np.zeros((0, 2, 2)), *placed]).reshape(-1, 2)),
        sheet=(layout.width, layout.height),
        mesh_vertices=torch.from_numpy(np.concatenate([np.zeros(0, np.int64), *(line for line, _ in cut)])),
        offsets=torch.from_numpy(offsets),
        polylines=torch.tensor(owners, dtype=torch.int64),
        names=_names(owners),
        sheets=layout.sheets,
    )


def _check_lengths(**lengths: float | None) -> None:
    for name, value in lengths.items():
        if value is not None and not (math.isfinite(value) and value >= 0):
            raise TorchfairError(f"{name}: expected a length that is finite and not negative, got {value}")
    if not (lengths["height"] or 0.0) + (lengths["depth"] or 0.0) > 0:
        raise TorchfairError("height: a strip needs a height or a depth above 0")


def _fitting(
    flat: Floats, begin: int, end: int, sheet: tuple[float | None, float | None], gap: float
) -> list[tuple[int, int, Floats]]:
    """The quads from ``begin`` to ``end``, halved until they fit on the sheet: first and last ruling, and points."""
    points = upright(flat[begin : end + 1])
    sizes = points.max((0, 1)).tolist()
    fits = all(most is None or size + 2 * gap <= most for size, most in zip(sizes, sheet, strict=True))
    if fits or end - begin == 1:
        return [(begin, end, points)]
    middle = (begin + end) // 2
    return _fitting(flat, begin, middle, sheet, gap) + _fitting(flat, middle, end, sheet, gap)


def _quads(offsets: Ints) -> Ints:
    first = np.setdiff1d(np.arange(offsets[-1]), offsets[1:] - 1)
    quads: Ints = 2 * first[:, None] + np.array([0, 2, 3, 1])
    return quads


def _names(owners: list[int]) -> tuple[str, ...]:
    names: list[str] = []
    for number, group in itertools.groupby(owners):
        parts = len(list(group))
        names += [str(number + 1)] if parts == 1 else [f"{number + 1}{_letters(part)}" for part in range(parts)]
    return tuple(names)


def _letters(number: int) -> str:
    """a, b, ..., z, aa, ab, ..."""
    rest, last = divmod(number, 26)
    return (_letters(rest - 1) if rest else "") + chr(ord("a") + last)
