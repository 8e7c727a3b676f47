"""Points of closed curves as they come from files: joined pieces, repeated points, open ends."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import MeshFileError
from .raw_mesh import Floats

SAME = 1e-7  # of the extent of a curve: nearer points are the same
_OPEN = 5.0  # longest steps of a text file: ends that are farther apart are those of an arc


class Cleaned(NamedTuple):
    """A closed curve without repeated points.

    Attributes:
        rows: (n, 3) or (n, 6), the first not repeated at the end.
        notes: What was left out or closed, in words.
    """

    rows: Floats
    notes: list[str]


def cleaned(path: Path, rows: Floats, *, close: bool) -> Cleaned:
    """Rows (n, 3) or (n, 6) of a curve that is taken to be closed, unless its ends are far apart.

    Raises:
        MeshFileError: fewer than three points are left, or the curve is an open arc that is not to be closed.
    """
    largest = float(np.abs(rows[:, :3]).max(initial=0.0))
    unit = 2.0 ** float(np.frexp(largest)[1] - 1) if largest else 1.0
    points, notes = rows[:, :3] / unit, []  # so that no distance overflows
    extent = float(np.ptp(points, axis=0).max()) if len(points) else 0.0
    exact = len(rows) > 1 and bool((points[0] == points[-1]).all())
    if len(rows) > 1 and np.linalg.norm(points[0] - points[-1]) <= SAME * extent:
        if not exact:
            gap = unit * np.linalg.norm(points[0] - points[-1])
            notes.append(f"{path.name}: the last point is {gap:.2g} from the first one: taken for the same")
        rows, points = rows[:-1], points[:-1]
    elif len(rows) > 2:
        _refuse_open(path, points, unit, notes, close)
    steps = np.linalg.norm(np.diff(points, axis=0), axis=1)
    repeated = np.flatnonzero(steps <= SAME * extent) + 1
    if repeated.size:
        named = ", ".join(map(str, repeated[:5].tolist())) + (", ..." if repeated.size > 5 else "")
        notes.append(f"{path.name}: {repeated.size} point(s) repeat the one before and are left out: {named} (from 0)")
        rows = np.delete(rows, repeated, axis=0)
    if len(rows) < 3:
        raise MeshFileError(path, f"a closed curve needs three different points, found {len(rows)}")
    return Cleaned(rows, notes)


def _refuse_open(path: Path, points: Floats, unit: float, notes: list[str], close: bool) -> None:
    gap = float(np.linalg.norm(points[0] - points[-1]))
    longest = float(np.linalg.norm(np.diff(points, axis=0), axis=1).max())
    if gap <= _OPEN * longest:
        return
    if not close:
        raise open_curve(path, unit * gap)
    notes.append(f"{path.name}: closed by a straight line of length {unit * gap:.4g}")


def open_curve(path: Path, gap: float) -> MeshFileError:
    """The error of an arc that is not to be closed."""
    return MeshFileError(path, f"is an open arc, whose ends are {gap:.4g} apart; --close joins them by a straight line")


def joined(pieces: list[Floats]) -> tuple[list[Floats], list[Floats]]:
    """Pieces (n, 3) put together where their ends meet: closed curves, which end with their first point; open ones."""
    pieces = [piece for piece in pieces if len(piece) > 1]
    if not pieces:
        return [], []
    tolerance = SAME * float(np.ptp(np.concatenate(pieces), axis=0).max())
    closed: list[Floats] = []
    open_ones: list[Floats] = []
    while pieces:
        chain = pieces.pop(0)
        while np.linalg.norm(chain[0] - chain[-1]) > tolerance:
            found = _next_piece(chain[-1], pieces, tolerance)
            if found is None:
                chain = chain[::-1]
                found = _next_piece(chain[-1], pieces, tolerance)
            if found is None:
                open_ones.append(chain)
                break
            number, piece = found
            del pieces[number]
            chain = np.concatenate([chain, piece[1:]])
        else:
            closed.append(chain)
    return closed, open_ones


def _next_piece(end: Floats, pieces: list[Floats], tolerance: float) -> tuple[int, Floats] | None:
    """Number of the first piece that begins or ends there, and the piece from there on."""
    for number, piece in enumerate(pieces):
        for one in (piece, piece[::-1]):
            if np.linalg.norm(one[0] - end) <= tolerance:
                return number, one
    return None
