"""Writes vertices and faces as lines of text."""

from __future__ import annotations

import itertools

from .raw_mesh import Floats, RawMesh


def vertex_lines(points: Floats, prefix: str = "") -> str:
    """One line per point; the digits are the shortest that read back to the same float64."""
    texts = list(map(repr, points.ravel().tolist()))
    xs, ys, zs = texts[0::3], texts[1::3], texts[2::3]
    return "".join(f"{prefix}{x} {y} {z}\n" for x, y, z in zip(xs, ys, zs, strict=True))


def face_lines(mesh: RawMesh, *, prefix: str = "", with_size: bool = False, first_index: int = 0) -> str:
    """One line per face."""
    texts = list(map(str, (mesh.corners + first_index).tolist()))
    spans = itertools.pairwise(mesh.offsets.tolist())
    if with_size:
        return "".join(f"{b - a} {' '.join(texts[a:b])}\n" for a, b in spans)
    return "".join(f"{prefix}{' '.join(texts[a:b])}\n" for a, b in spans)
