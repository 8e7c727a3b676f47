"""Polylines, positions and normals that strips can stand on."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from .._half_edges import first_few
from ..errors import MeshError, ShapeError, TorchfairError
from ._unroll import Floats, Ints


class StripInput(NamedTuple):
    """What strips stand on.

    Attributes:
        lines: vertex numbers along the polylines, without what has no normal.
        numbers: the polyline that each line comes from.
        points: (V, 3) positions.
        normals: (V, 3) unit normals, zero where there is none.
    """

    lines: list[Ints]
    numbers: list[int]
    points: Floats
    normals: Floats

    @property
    def edges(self) -> Ints:
        """(n, 2) consecutive vertices of all lines."""
        steps = [np.stack([line[:-1], line[1:]], axis=1) for line in self.lines]
        return np.concatenate([np.zeros((0, 2), np.int64), *steps])


def prepare(vertices: Tensor, polylines: Sequence[Tensor], normals: Tensor) -> StripInput:
    """Checked input.

    Raises:
        ShapeError, MeshError, TorchfairError: as :func:`developable_strips`.
    """
    if vertices.ndim != 2 or vertices.shape[1] != 3 or not vertices.is_floating_point():
        raise ShapeError("vertices", "a floating tensor (V, 3)", f"{tuple(vertices.shape)} {vertices.dtype}")
    if normals.shape != vertices.shape:
        raise ShapeError("normals", f"({len(vertices)}, 3)", tuple(normals.shape))
    points: Floats = vertices.detach().cpu().double().numpy()
    unit: Floats = normals.detach().cpu().double().numpy()
    used = [_checked(line, len(points)) for line in polylines]
    on_lines = np.unique(np.concatenate([np.zeros(0, np.int64), *used]))
    for name, values in (("vertices", points), ("normals", unit)):
        bad = on_lines[~np.isfinite(values[on_lines]).all(1)]
        if bad.size:
            raise TorchfairError(f"{name}: not finite at vertices {first_few(bad.tolist(), bad.size)} of polylines")
    lengths = np.linalg.norm(unit, axis=1, keepdims=True)
    unit = np.divide(unit, lengths, out=np.zeros_like(unit), where=lengths > 0)
    missing = lengths[:, 0] == 0
    parts = [(part, number) for number, line in enumerate(used) for part in _without(line, missing)]
    return StripInput([part for part, _ in parts], [number for _, number in parts], points, unit)


def _checked(line: Tensor, count: int) -> Ints:
    if line.ndim != 1 or line.dtype != torch.int64 or len(line) < 2:
        expected = "vertex numbers (n,) int64, two or more"
        raise ShapeError("polylines", expected, f"{tuple(line.shape)} {line.dtype}")
    numbers: Ints = line.cpu().numpy()
    outside = numbers[(numbers < 0) | (numbers >= count)]
    if outside.size:
        raise MeshError(f"polylines: no such vertices: {outside[:5].tolist()}; the mesh has {count}")
    return numbers


def _without(line: Ints, missing: npt.NDArray[np.bool_]) -> list[Ints]:
    """The parts of a polyline, of two vertices or more, that have normals."""
    gaps = np.flatnonzero(missing[line])
    if not gaps.size:
        return [line]
    if line[0] == line[-1]:  # go round from a gap to the same gap
        line = np.roll(line[:-1], -gaps[0])
        gaps = np.flatnonzero(missing[line])
    bounds = itertools.pairwise([-1, *gaps.tolist(), len(line)])
    return [line[a + 1 : b] for a, b in bounds if b - a > 2]
