"""Curves in text files: one point a line."""

from __future__ import annotations

import os
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from ..errors import MeshFileError
from .reading import read_bytes
from .text import check_text, split_words, to_floats


class CurvePoints(NamedTuple):
    """Points of a curve, in order.

    Attributes:
        points: (n, 3) float64.
        normals: (n, 3) float64 normals at the points, or None.
    """

    points: Tensor
    normals: Tensor | None


def load_curve(path: str | os.PathLike[str]) -> CurvePoints:
    """Reads a curve: three numbers a line, x y z, or six with a normal.

    Commas and semicolons count as blanks, # starts a comment.

    A line of words before the numbers, such as ``x,y,z``, is passed over. The points of a closed curve may end
    with the first one repeated, which is left out.

    Raises:
        MeshFileError: naming file and line, if the file cannot be read or a line is not three or six numbers.
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
    if len(rows) > 1 and (rows[0, :3] == rows[-1, :3]).all():
        rows = rows[:-1]
    values = torch.from_numpy(rows.copy())
    return CurvePoints(values[:, :3], values[:, 3:] if width == 6 else None)


def _is_number(word: bytes) -> bool:
    try:
        float(word)
    except ValueError:
        return False
    return True
