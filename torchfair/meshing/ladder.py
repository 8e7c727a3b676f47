"""Other settings, one after the other, where the first give no valid mesh."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from functools import cache

from ..errors import MeshError
from ..fields import Directions
from .attempt import FailedAttemptError, PieceMesh, Plan, attempt
from .combing import combed
from .creases import Creases, find_creases
from .cut_graph import CutGraph
from .lattice import Lattice
from .settings import MeshingSettings
from .surface import DesignSurface

_SMOOTHER = (1.0, 4.0, 16.0, 64.0)  # times the smoothing length
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
    first: int = 0,
) -> tuple[PieceMesh, str, int]:
    """The mesh of a component by the first plan that gives a valid one, what was changed, and the plan's number.

    Args:
        surface: the component.
        directions: of its triangles.
        lattice: that is laid on it.
        spacing: length of edges.
        smoothing: of directions, over the spacing.
        settings: of the mesh.
        first: number of the plan to begin with.

    Raises:
        NoMeshError: if none does.
    """
    began = time.process_time()
    failure: FailedAttemptError | None = None
    number = 0

    @cache
    def finer(spacing: float) -> tuple[DesignSurface, Directions]:
        return surface.cut_finer(directions, spacing)

    @cache
    def creases(spacing: float, kept: bool) -> Creases:
        triangles = finer(spacing)[0]
        sharp = triangles.sharp & kept
        return find_creases(triangles.frames, sharp, settings.corner_angle, spacing)

    @cache
    def graph(spacing: float, smoothing: float, kept: bool) -> CutGraph:
        triangles, carried = finer(spacing)
        merging, sharp = settings.merging * spacing, creases(spacing, kept)
        return combed(triangles.frames, carried, lattice.symmetry, smoothing, merging, sharp, settings.boundary_angle)

    tried = enumerate(plans(spacing, smoothing, settings, bool(surface.sharp.any())))
    for place, (plan, words) in itertools.islice(tried, first, None):
        late = plan.creases and time.process_time() - began > settings.time_limit
        if number and (not settings.fallback or late):
            continue
        number += 1
        try:
            field = graph(plan.spacing, plan.smoothing, plan.creases)
            sharp = creases(plan.spacing, plan.creases)
            return attempt(finer(plan.spacing)[0], sharp, field, lattice, plan, settings), words, place
        except FailedAttemptError as error:
            failure = error if failure is None or failure.vertex < 0 else failure
    assert failure is not None
    raise NoMeshError(_refusal(failure, number), failure.vertex)


def plans(spacing: float, smoothing: float, settings: MeshingSettings, creased: bool) -> Iterator[tuple[Plan, str]]:
    """What is tried, and how that differs from what was asked for; without the creases at last, where there are any."""
    can_align = settings.align_boundary or creased
    for scale in _SPACINGS:
        for smoother in _SMOOTHER:
            for align in (True, False) if can_align else (False,):
                plan = Plan(spacing * scale, spacing * smoothing * smoother, align)
                words = [
                    f"directions smoothed over {smoothing * smoother:g} edges" if smoother != 1 else "",
                    f"{'boundary and creases' if creased else 'boundary'} not aligned"
                    if can_align and not align
                    else "",
                    f"{abs(scale**-2 - 1):.0%} {'more' if scale < 1 else 'fewer'} faces" if scale != 1 else "",
                ]
                yield plan, ", ".join(filter(None, words))
    if creased:
        yield Plan(spacing, spacing * smoothing, settings.align_boundary, creases=False), "creases not kept"


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
