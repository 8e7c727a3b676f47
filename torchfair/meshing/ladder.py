"""Other settings, one after the other, where the first give no valid mesh."""

from __future__ import annotations

import time
from collections.abc import Iterator
from functools import cache

from ..errors import MeshError
from ..fields import Directions
from .attempt import FailedAttemptError, PieceMesh, Plan, attempt
from .combing import combed
from .cut_graph import CutGraph
from .lattice import Lattice
from .settings import MeshingSettings
from .surface import DesignSurface

_SMOOTHER = (1.0, 4.0, 16.0)  # times the smoothing length
_SPACINGS = (1.0, 0.967, 1.037, 0.934, 1.08)  # counts up and down by 7 and 15 %


class NoMeshError(MeshError):
    """A surface of which no valid principal mesh was found.

    Attributes:
        vertex: number of a vertex where the last attempt went wrong, -1 if unknown.
    """

    def __init__(self, message: str, vertex: int = -1) -> None:
        super().__init__(message)
        self.vertex = vertex


def mesh_component(
    surface: DesignSurface,
    directions: Directions,
    lattice: Lattice,
    spacing: float,
    smoothing: float,
    settings: MeshingSettings,
) -> tuple[PieceMesh, str]:
    """The mesh of a component by the first plan that gives a valid one, and what was changed, in words.

    Raises:
        NoMeshError: if none does.
    """
    began = time.monotonic()
    failure: FailedAttemptError | None = None
    number = 0

    @cache
    def finer(spacing: float) -> tuple[DesignSurface, Directions]:
        return surface.cut_finer(directions, spacing)

    @cache
    def graph(spacing: float, smoothing: float) -> CutGraph:
        triangles, carried = finer(spacing)
        return combed(triangles.frames, carried, lattice.symmetry, smoothing, settings.merging * spacing)

    for plan, words in plans(spacing, smoothing, settings):
        if number and (not settings.fallback or time.monotonic() - began > settings.time_limit):
            break
        number += 1
        try:
            return attempt(finer(plan.spacing)[0], graph(plan.spacing, plan.smoothing), lattice, plan, settings), words
        except FailedAttemptError as error:
            failure = error if failure is None or failure.vertex < 0 else failure
    assert failure is not None
    raise NoMeshError(_refusal(failure, number), failure.vertex)


def plans(spacing: float, smoothing: float, settings: MeshingSettings) -> Iterator[tuple[Plan, str]]:
    """What is tried, and how that differs from what was asked for."""
    for scale in _SPACINGS:
        for smoother in _SMOOTHER:
            for align in (True, False) if settings.align_boundary else (False,):
                plan = Plan(spacing * scale, spacing * smoothing * smoother, align)
                words = [
                    f"directions smoothed over {smoothing * smoother:g} edges" if smoother != 1 else "",
                    "boundary not aligned" if settings.align_boundary and not align else "",
                    f"{abs(scale**-2 - 1):.0%} {'more' if scale < 1 else 'fewer'} faces" if scale != 1 else "",
                ]
                yield plan, ", ".join(filter(None, words))


def _refusal(failure: FailedAttemptError, number: int) -> str:
    where = ""
    if failure.vertex >= 0 and failure.place is not None:
        x, y, z = failure.place
        where = f" near vertex {failure.vertex} at ({x:.4g}, {y:.4g}, {z:.4g})"
    tried = f"{number} setting(s) tried" if number > 1 else "one setting tried"
    return (
        f"no valid mesh was found{where}: {failure} ({tried}). Ask for more or fewer faces, smooth directions over a "
        "longer length (smoothing), or give a finer or smoother surface"
    )
