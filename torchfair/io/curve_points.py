"""Closed curves in files: text with one point a line, and drawings."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from .closing import cleaned, joined, open_curve
from .drawn_curves import dxf_pieces, obj_pieces, rhino_pieces
from .number_table import read_table
from .raw_mesh import Floats
from .reading import read_bytes


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

    Numbers are set apart by blanks, semicolons or commas; # starts a comment. A comma inside numbers that are set apart
    otherwise (0,5;0,0;1,5) is a decimal mark, and what could be either is refused.

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
    rows = read_table(path, read_bytes(path), (3, 6))
    rows, notes = cleaned(path, rows, close=close)
    values = torch.from_numpy(rows.copy())
    return CurvePoints(values[:, :3], values[:, 3:] if values.shape[1] == 6 else None, tuple(notes))


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
