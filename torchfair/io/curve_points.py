"""Closed curves in files: text with one point a line, and drawings."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from ..errors import MeshFileError
from .closing import cleaned, joined, open_curve
from .drawn_curves import dxf_pieces, obj_pieces, rhino_pieces
from .raw_mesh import Floats
from .reading import read_bytes
from .text import check_text, split_words, to_floats


class CurvePoints(NamedTuple):
    """Points of a closed curve, in order.

    Attributes:
        points: (n, 3) float64, the first not repeated at the end.
        normals: (n, 3) float64 normals at the points, or None.
        notes: What was left out or closed, in words.
    """

    points: Tensor
    normals: Tensor | None
    notes: tuple[str, ...] = ()


def load_curve(path: str | os.PathLike[str], *, close: bool = False) -> CurvePoints:
    """Reads a closed curve from text: three numbers a line, x y z, or six with a normal.

    Commas and semicolons count as blanks, # starts a comment.

    A line of words before the numbers, such as ``x,y,z``, is passed over. The points may end with the first one
    repeated, or one within 1e-7 of the extent of it, which is left out; so are points that repeat the one before.

    Args:
        path: the file.
        close: whether an open arc is closed by a straight line: points whose ends are more than five times as far apart
            as any neighbours.

    Raises:
        MeshFileError: naming file and line, if the file cannot be read or a line is not three or six numbers; if there
            are fewer than three points; if it is an open arc that is not to be closed.
    """
    path = Path(path)
    data = check_text(path, read_bytes(path)).replace(b",", b" ").replace(b";", b" ")
    lines = [line.split(b"#", 1)[0] for line in data.splitlines()]
    head = next((number for number, line in enumerate(lines) if line.split()), 0)
    if lines and lines[head].split() and not _is_number(lines[head].split()[0]):
        lines[head] = b""
    text = split_words(b"\n".join(lines))
    sizes = set(text.sizes.tolist())
    if not sizes:
        raise MeshFileError(path, "holds no points")
    width = int(text.sizes[0])
    if width not in (3, 6) or len(sizes) > 1:
        wrong = int(np.flatnonzero(text.sizes != (width if width in (3, 6) else 3))[0])
        found = int(text.sizes[wrong])
        raise MeshFileError(path, f"expected three or six numbers in every line, found {found}", int(text.lines[wrong]))
    rows = to_floats(path, text, np.arange(len(text.words))).reshape(-1, width)
    rows, notes = cleaned(path, rows, close=close)
    values = torch.from_numpy(rows.copy())
    return CurvePoints(values[:, :3], values[:, 3:] if width == 6 else None, tuple(notes))


_DRAWINGS: dict[str, Callable[[Path], list[Floats]]] = {".obj": obj_pieces, ".dxf": dxf_pieces, ".3dm": rhino_pieces}


def load_curves(path: str | os.PathLike[str], *, close: bool = False) -> list[CurvePoints]:
    """Reads the closed curves of a file: one from text (:func:`load_curve`), all from a drawing.

    Line elements of OBJ files; lines, polylines, arcs, ellipses and splines in the model space of DXF files, with the
    package ezdxf; curves of 3DM files, with the package rhino3dm. Pieces are joined where their ends meet.

    Args:
        path: the file; what it is, is told by its extension.
        close: whether open arcs are closed by straight lines.

    Raises:
        MeshFileError: as :func:`load_curve`; or there are no curves, or open ones that are not to be closed.
        TorchfairError: the package that reads this format is not installed.
    """
    path = Path(path)
    pieces_of = _DRAWINGS.get(path.suffix.lower())
    if pieces_of is None:
        return [load_curve(path, close=close)]
    closed, open_ones = joined(pieces_of(path))
    if open_ones and not close:
        raise open_curve(path, float(np.linalg.norm(open_ones[0][0] - open_ones[0][-1])))
    result = []
    for rows in [*closed, *open_ones]:
        points, notes = cleaned(path, rows, close=True)
        result.append(CurvePoints(torch.from_numpy(points.copy()), None, tuple(notes)))
    return result


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
