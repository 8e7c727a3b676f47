"""Faces that a slit of the surface ends in, cut in two from its tip."""

from __future__ import annotations

import math

import numpy as np

from ..fields.frames import Floats
from .polygon_area import area_vector
from .polygon_sides import sharpest_angle, sides_cross

Pair = tuple[int, int]

_REFLEX = math.radians(350.0)  # from there on the boundary turns back on itself
_SHARP = math.radians(8.0)  # angles of parts; with less, other settings make better meshes
_SMALL = 0.06  # area over the mean, above which parts are large enough


def without_slits(positions: Floats, faces: list[list[int]]) -> list[list[int]]:
    """Polygons of which none has a corner of more than 350 degrees, as at the tip of a slit that ends inside it.

    Such a polygon is cut from that corner to another one, so that its parts are not small and their smallest angle is
    as large as it can be; it stays where no cut leaves two polygons with angles of 8 degrees or more and no crossings.

    Args:
        positions: (V, 3).
        faces: vertices counterclockwise, of a manifold.
    """
    reflex = [(number, tip) for number, face in enumerate(faces) if (tip := _tip(positions, face)) is not None]
    if not reflex:
        return faces
    found = [list(face) for face in faces]
    mean = float(np.mean([np.linalg.norm(area_vector(positions, face)) for face in faces]))
    taken = {(min(a, b), max(a, b)) for face in faces for a, b in zip(face, face[1:] + face[:1], strict=True)}
    for number, tip in reflex:
        parts = _cut(positions, found[number][tip:] + found[number][:tip], mean, taken)
        if parts is not None:
            found[number] = parts[0]
            found.append(parts[1])
    return found


def _tip(positions: Floats, face: list[int]) -> int | None:
    """The place in a polygon of a corner of more than 350 degrees, if there is one."""
    if len(face) < 5:
        return None
    angles = _angles(positions, face, area_vector(positions, face))
    widest = int(angles.argmax())
    return widest if angles[widest] > _REFLEX else None


def _angles(positions: Floats, face: list[int], normal: Floats) -> Floats:
    """(n,) of a polygon at its corners, from 0 to 2 pi, seen along a normal."""
    corners = positions[face]
    ahead, back = np.roll(corners, -1, axis=0) - corners, np.roll(corners, 1, axis=0) - corners
    size = max(float(np.linalg.norm(normal)), np.finfo(float).tiny)
    sines = np.cross(ahead, back) @ normal / size
    return np.asarray(np.arctan2(sines, (ahead * back).sum(1)) % (2 * np.pi))


def _cut(positions: Floats, face: list[int], mean: float, taken: set[Pair]) -> list[list[int]] | None:
    """The two parts of a polygon that is cut from its first corner; the new edge is taken then."""
    normal, best = area_vector(positions, face), None
    for k in range(2, len(face) - 1):
        edge = (min(face[0], face[k]), max(face[0], face[k]))
        parts = [face[: k + 1], [face[0], *face[k:]]]
        areas = [float(area_vector(positions, part) @ normal) / float(np.linalg.norm(normal)) for part in parts]
        if edge in taken or min(areas) <= 0 or any(sides_cross(positions[part], normal) for part in parts):
            continue
        sharpest = min(sharpest_angle(positions[part]) for part in parts)
        rated = (min(min(areas) / mean, _SMALL), sharpest)
        if sharpest >= _SHARP and (best is None or rated > best[0]):
            best = rated, edge, parts
    if best is None:
        return None
    taken.add(best[1])
    return best[2]
