"""Cuts the faces of a polygon mesh into triangles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..topology import Topology
from ._closest_boxes import Floats, Ints

_FOLDED = -1e-12  # largest share of a face's squared area by which a triangle of a fan may lie backwards


class Pieces(NamedTuple):
    """Triangles that fill the faces of a mesh.

    Attributes:
        points: (P, 3) the vertices, then the centres of the faces that are fanned.
        corners: (T, 3) numbers of points.
        faces: (T,) face of each triangle, ascending.
    """

    points: Floats
    corners: Ints
    faces: Ints


def cut_faces(vertices: Floats, topology: Topology) -> Pieces:
    """Triangles as they are, other faces as fans around the mean of their corners.

    A face that does not see all its corners from there (not convex enough) is cut along diagonals instead.
    """
    points, corners, faces = [vertices], [np.zeros((0, 3), np.int64)], [np.zeros(0, np.int64)]
    count = vertices.shape[0]
    for size, group in topology.faces_by_size.items():
        numbers, polygons = (tensor.cpu().numpy() for tensor in group)
        if size == 3:
            corners.append(polygons)
            faces.append(numbers)
            continue
        star = _sees_corners(vertices[polygons])
        for number, polygon in zip(numbers[~star], polygons[~star], strict=True):
            corners.append(polygon[_clip_ears(vertices[polygon])])
            faces.append(np.full(size - 2, number))
        numbers, polygons = numbers[star], polygons[star]
        centres = np.arange(count, count + numbers.size)
        fans = [polygons, np.roll(polygons, -1, axis=1), centres[:, None].repeat(size, axis=1)]
        points.append(vertices[polygons].mean(1))
        corners.append(np.stack(fans, axis=2).reshape(-1, 3))
        faces.append(numbers.repeat(size))
        count += numbers.size
    of_face = np.concatenate(faces)
    order = of_face.argsort(kind="stable")
    return Pieces(np.concatenate(points), np.concatenate(corners)[order], of_face[order])


def _sees_corners(polygons: Floats) -> npt.NDArray[np.bool_]:
    """Whether the fan around the mean of the corners does not fold back, for polygons (n, k, 3)."""
    spokes = polygons - polygons.mean(1, keepdims=True)
    areas = np.cross(spokes, np.roll(spokes, -1, axis=1))
    total = areas.sum(1, keepdims=True)
    shares = (areas * total).sum(2)
    facing: npt.NDArray[np.bool_] = (shares >= _FOLDED * (total * total).sum(2)).all(1)
    return facing


def _clip_ears(polygon: Floats) -> Ints:
    """Triangles (k - 2, 3) of corner numbers that fill the polygon (k, 3), which is projected to its best-fit plane."""
    centred = polygon - polygon.mean(0)
    plane = centred @ np.linalg.svd(centred, full_matrices=False)[2][:2].T
    if _turn(plane, np.roll(plane, -1, axis=0)).sum() < 0:
        plane[:, 1] *= -1.0
    ring = np.arange(len(plane))
    triangles = []
    while ring.size > 3:
        # A polygon without ears has no area or crosses itself: any corner will do.
        ear = next((i for i in range(ring.size) if _is_ear(plane[ring], i)), 0)
        triangles.append(ring.take([ear - 1, ear, ear + 1], mode="wrap"))
        ring = np.delete(ring, ear)
    return np.stack([*triangles, ring]).astype(np.int64)


def _is_ear(plane: Floats, corner: int) -> bool:
    """Whether the polygon (k, 2) is convex at the corner and the triangle to its neighbours holds no other corner."""
    around = [corner - 1, corner, corner + 1]
    before, tip, after = plane.take(around, axis=0, mode="wrap")
    if _turn(tip - before, after - tip) <= 0:
        return False
    rest = np.delete(plane, np.mod(around, len(plane)), axis=0)
    held = (_turn(tip - before, rest - before) > 0) & (_turn(after - tip, rest - tip) > 0)
    held &= _turn(before - after, rest - after) >= 0
    return not held.any()


def _turn(a: Floats, b: Floats) -> Floats:
    """Cross product of plane vectors (..., 2)."""
    turn: Floats = a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
    return turn
