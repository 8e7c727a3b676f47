"""Closed bodies with sharp edges, meshed by irregular triangles: a stepped block with holes, and a cylinder."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from torchfair.topology import Topology

Points = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Mesh = tuple[Tensor, Topology]

_CLOSEST = 0.72  # distance of inner vertices, over the spacing along the boundary
_CANDIDATES = 30  # random points to choose from, per vertex
_WELD = 1e-6  # over the spacing
_STEP = np.array([[0, 0], [3, 0], [3, 1], [1.5, 1], [1.5, 2], [0, 2]], float)  # profile of the block, x and z
_UPRIGHT, _LEVEL = ((2.25, 1.0), 0.35), ((0.75, 1.25), 0.4)  # centres and radii of its holes


@dataclass(frozen=True)
class Sheet:
    """A flat or developed region with holes, and where it lies in space.

    Attributes:
        loops: Closed polygons (n, 2) around the region and around its holes, in any order.
        place: Map of points (n, 2) to (n, 3); counterclockwise becomes counterclockwise seen from outside.
    """

    loops: Sequence[Points]
    place: Callable[[Points], Points]


def block(faces: int, seed: int = 0) -> Mesh:
    """A stepped block with two drilled holes, about ``faces`` triangles of even size.

    3 long, 2 wide and 2 high, the step 1.5 long and 1 high; an upright hole through the step, and one across.
    """
    walls = 2 * math.pi * (_UPRIGHT[1] + 2 * _LEVEL[1])
    area = 2 * 4.5 + 2 * 10 + walls - 2 * math.pi * (_UPRIGHT[1] ** 2 + _LEVEL[1] ** 2)
    h = _spacing(area, faces)
    upright, level = _circle(*_UPRIGHT, h), _circle(*_LEVEL, h)
    front = _polygon(_STEP, h)
    sheets = [
        Sheet([front, level], _plane((0, 0, 0), (1, 0, 0), (0, 0, 1))),
        Sheet([_mirrored(front), _mirrored(level)], _plane((0, 2, 0), (-1, 0, 0), (0, 0, 1))),
        _wall(_LEVEL[1], 2.0, h, (0.75, 2.0, 1.25), (1, 0, 0), (0, 0, 1), inwards=True),
        _wall(_UPRIGHT[1], 1.0, h, (2.25, 1.0, 0.0), (1, 0, 0), (0, 1, 0), inwards=True),
    ]
    for start, end in zip(_STEP, np.roll(_STEP, -1, axis=0), strict=True):
        along = end - start
        length = float(np.linalg.norm(along))
        direction = along / length
        loops = [_polygon(np.array([[0, 0], [length, 0], [length, 2], [0, 2]], float), h)]
        if direction[0] != 0 and max(start[0], end[0]) == 3:
            loops.append(np.stack([(upright[:, 0] - start[0]) * direction[0], upright[:, 1]], axis=1))
        place = _plane((start[0], 2, start[1]), (direction[0], 0, direction[1]), (0, -1, 0))
        sheets.append(Sheet(loops, place))
    return _weld(sheets, h, seed)


def cylinder(faces: int, seed: int = 0) -> Mesh:
    """A closed cylinder of radius 1 and height 2.5 with flat ends, about ``faces`` triangles of even size."""
    h = _spacing(2 * math.pi * 3.5, faces)
    rim = _circle((0.0, 0.0), 1.0, h)
    return _weld(
        [
            Sheet([rim], _plane((0, 0, 2.5), (1, 0, 0), (0, 1, 0))),
            Sheet([_mirrored(rim)], _plane((0, 0, 0), (-1, 0, 0), (0, 1, 0))),
            _wall(1.0, 2.5, h, (0, 0, 0), (1, 0, 0), (0, 1, 0), inwards=False),
        ],
        h,
        seed,
    )


# ---- sheets --------------------------------------------------------------------------------------------


def _spacing(area: float, faces: int) -> float:
    return math.sqrt(area / faces * 4 / math.sqrt(3))


def _polygon(corners: Points, h: float) -> Points:
    """The polygon with its sides divided into pieces of length about ``h``."""
    sides = []
    for start, end in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        pieces = max(round(float(np.linalg.norm(end - start)) / h), 1)
        sides.append(start + (end - start) * (np.arange(pieces) / pieces)[:, None])
    return np.concatenate(sides)


def _circle(centre: tuple[float, float], radius: float, h: float) -> Points:
    angle = 2 * math.pi * np.arange(_pieces(radius, h)) / _pieces(radius, h)
    return np.array(centre) + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def _pieces(radius: float, h: float) -> int:
    return 2 * max(round(math.pi * radius / h), 4)  # even, so that the circle is its own mirror image


def _mirrored(points: Points) -> Points:
    return points * [-1.0, 1.0]


def _plane(origin: Sequence[float], u: Sequence[float], v: Sequence[float]) -> Callable[[Points], Points]:
    """The plane through ``origin`` seen from the side of u x v."""
    return lambda p: np.array(origin, float) + p[:, :1] * np.array(u, float) + p[:, 1:] * np.array(v, float)


def _wall(
    radius: float,
    depth: float,
    h: float,
    origin: Sequence[float],
    u: Sequence[float],
    v: Sequence[float],
    *,
    inwards: bool,
) -> Sheet:
    """A round wall of circles in the plane of u and v that rise from ``origin`` along u x v, cut open at one line."""
    around, pieces = 2 * math.pi * radius, _pieces(radius, h)
    across = max(round(depth / h), 1)
    s, t = np.arange(pieces) / pieces * around, np.arange(across) / across * depth
    loop = np.concatenate(
        [
            np.stack([s, 0 * s], axis=1),
            np.stack([0 * t + around, t], axis=1),
            np.stack([around - s, 0 * s + depth], axis=1),
            np.stack([0 * t, depth - t], axis=1),
        ]
    )
    axis, turn = np.cross(u, v), -1.0 if inwards else 1.0

    def place(p: Points) -> Points:
        angle = turn * p[:, :1] / radius
        round_ = np.cos(angle) * np.array(u, float) + np.sin(angle) * np.array(v, float)
        return np.array(origin, float) + radius * round_ + p[:, 1:] * axis

    return Sheet([loop], place)


# ---- triangles -----------------------------------------------------------------------------------------


def _weld(sheets: Sequence[Sheet], h: float, seed: int) -> Mesh:
    """The triangulated sheets, joined where vertices coincide."""
    random = np.random.default_rng(seed)
    places, faces, count = [], [], 0
    for sheet in sheets:
        points, triangles = _triangulated(sheet.loops, h, random)
        places.append(sheet.place(points))
        faces.append(triangles + count)
        count += len(points)
    place = np.concatenate(places)
    _, first, number = np.unique(np.round(place / (_WELD * h)), axis=0, return_index=True, return_inverse=True)
    topology = Topology.from_faces(number.reshape(-1)[np.concatenate(faces)], num_vertices=len(first))
    return torch.from_numpy(place[first]), topology


def _triangulated(loops: Sequence[Points], h: float, random: np.random.Generator) -> tuple[Points, Ints]:
    """Vertices spread evenly over a region of the plane, and its Delaunay triangles, counterclockwise."""
    from scipy.spatial import Delaunay, cKDTree

    outline = np.concatenate(loops)
    low, high = outline.min(0), outline.max(0)
    count = int(_CANDIDATES * np.prod(high - low) / h**2)
    candidates = random.uniform(low, high, (count, 2))
    candidates = candidates[_is_inside(candidates, loops)]
    distance = np.asarray(cKDTree(outline).query(candidates)[0])
    tree, chosen = cKDTree(candidates), []
    while distance.max() > _CLOSEST * h:
        chosen.append(int(np.argmax(distance)))
        near = tree.query_ball_point(candidates[chosen[-1]], distance[chosen[-1]])
        away = np.linalg.norm(candidates[near] - candidates[chosen[-1]], axis=1)
        distance[near] = np.minimum(distance[near], away)
    points = np.concatenate([outline, candidates[chosen]])
    triangles = Delaunay(points).simplices.astype(np.int64)
    a, b, c = points[triangles].transpose(1, 0, 2)
    area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
    triangles[area < 0] = triangles[area < 0][:, ::-1]
    kept = _is_inside((a + b + c) / 3, loops) & (np.abs(area) > 1e-6 * h**2)
    return points, triangles[kept]


def _is_inside(points: Points, loops: Sequence[Points]) -> npt.NDArray[np.bool_]:
    """Whether points (n, 2) are inside an odd number of polygons."""
    inside = np.zeros(len(points), bool)
    for loop in loops:
        for (x0, y0), (x1, y1) in zip(loop, np.roll(loop, -1, axis=0), strict=True):
            if y0 != y1:
                crossed = (points[:, 1] < y0) != (points[:, 1] < y1)
                inside ^= crossed & (points[:, 0] < x0 + (points[:, 1] - y0) * (x1 - x0) / (y1 - y0))
    return inside
