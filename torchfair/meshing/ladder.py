"""Other settings, one after the other, where the first give no valid mesh."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from ..errors import MeshError
from ..fields import Directions
from ..settings.meshing_settings import MeshingSettings
from .attempt import FailedAttemptError, PieceMesh, Plan, attempt
from .combing import combed
from .creases import Creases, find_creases
from .cut_graph import CutGraph
from .lattice import Lattice
from .surface import DesignSurface

_SMOOTHER = (1.0, 4.0, 16.0, 64.0)  # times the smoothing length
_ROWS = ((1.0, 0.0), (1.0, 0.3), (1.0, 10.0), (4.0, 0.0), (1.0, 0.3), (1.0, 10.0), (16.0, 0.0), (64.0, 0.0))
"""The same for lattices with rows, and how crosses are made even; at first where the plan before failed by far."""

_SHARE = 0.5  # of the time limit, for plans that keep creases
_RETRIES = 2  # with creases not aligned where a map is turned over
_SPACINGS = (1.0, 0.967, 1.037, 0.934, 1.08)  # counts up and down by 7 and 15 %


class NoMeshError(MeshError):
    """A surface of which no valid principal mesh was found.

    Attributes:
        vertex: number of a vertex where the last attempt went wrong, -1 if unknown.
    """

    def __init__(self, message: str, vertex: int = -1) -> None:
        super().__init__(message)
        self.vertex = vertex


Kind = tuple[float, bool, bool, float]


class Rung(NamedTuple):
    """A plan, how in words it differs from what was asked for, and by which factors.

    Attributes:
        early: whether it is for surfaces on which the same without even crosses failed by far.
    """

    plan: Plan
    words: str
    scale: float
    smoother: float
    early: bool

    @property
    def kind(self) -> Kind:
        """What it has in common with plans of a spacing a little different."""
        return self.smoother, self.plan.align, self.plan.creases, self.plan.even

    def is_worth_it(self, hopeless: set[Kind]) -> bool:
        """Whether to try it when plans of some kinds failed by far."""
        return self.kind not in hopeless and (not self.early or (*self.kind[:3], 0.0) in hopeless)


def mesh_component(
    surface: DesignSurface,
    directions: Directions,
    lattice: Lattice,
    spacing: float,
    smoothing: float,
    settings: MeshingSettings,
    first: int | None = None,
    resolution: float | None = None,
) -> tuple[PieceMesh, str, int]:
    """The mesh of a component by the first plan that gives a valid one, what was changed, and the plan's number.

    Args:
        surface: the component.
        directions: of its triangles.
        lattice: that is laid on it.
        spacing: length of edges.
        smoothing: of directions, over the spacing.
        settings: of the mesh.
        first: number of the plan to begin with, which gave a mesh with another spacing; then spacings are not changed.
        resolution: length of edges for which triangles are made fine enough, by default the spacing.

    Raises:
        NoMeshError: if none does.
    """
    creased = bool(surface.sharp.any())
    plain = surface.without_creases()
    began = time.process_time()
    failure: FailedAttemptError | None = None
    number = 0

    @cache
    def finer(kept: bool) -> tuple[DesignSurface, Directions]:
        length = spacing if resolution is None else resolution
        if kept or not creased:
            return surface.cut_finer(directions, length)
        return plain.cut_finer(smooth(), length)

    @cache
    def smooth() -> Directions:
        return plain.directions(settings.noise)[0]

    @cache
    def creases(spacing: float, kept: bool) -> Creases:
        triangles = finer(kept)[0]
        return find_creases(triangles.frames, triangles.sharp, settings.corner_angle, spacing)

    @cache
    def graph(spacing: float, smoothing: float, kept: bool, even: float) -> CutGraph:
        triangles, carried = finer(kept)
        merging, sharp, angle = settings.merging * spacing, creases(spacing, kept), settings.boundary_angle
        try:
            return combed(triangles.frames, carried, lattice.symmetry, smoothing, merging, sharp, angle, even=even)
        except MeshError as error:
            raise FailedAttemptError(str(error), hopeless=True) from None

    hopeless: set[Kind] = set()
    done: set[tuple[float, Kind]] = set()
    for place, rung in _from(first, list(plans(spacing, smoothing, settings, creased, lattice.has_rows))):
        plan = rung.plan
        limit = settings.time_limit * (_SHARE if plan.creases else 1.0)
        late = time.process_time() - began > limit
        again = (rung.scale, rung.kind) in done
        if number and (not settings.fallback or late or again or not rung.is_worth_it(hopeless)):
            continue
        done.add((rung.scale, rung.kind))
        for _ in range(1 + _RETRIES * (settings.fallback and plan.creases and plan.align)):
            number += 1
            try:
                field = graph(plan.spacing, plan.smoothing, plan.creases, plan.even)
                sharp = creases(plan.spacing, plan.creases)
                triangles = finer(plan.creases)[0]
                return attempt(triangles, sharp, field, lattice, plan, settings), _in_words(plan, rung.words), place
            except FailedAttemptError as error:
                failure = error if failure is None or failure.vertex < 0 else failure
                if error.hopeless:
                    hopeless.add(rung.kind)
                if error.place is None or error.hopeless:
                    break
                plan = replace(plan, apart=np.concatenate([plan.apart, error.place[None]]))
    assert failure is not None
    raise NoMeshError(_refusal(failure, number), failure.vertex)


def _from(first: int | None, rungs: list[Rung]) -> Iterator[tuple[int, Rung]]:
    """Numbers of plans and plans: all of them, or those from the first on that differ from it in neither size."""
    begin = rungs[first or 0]
    for place, rung in itertools.islice(enumerate(rungs), first, None):
        if first is None or (rung.scale, rung.plan.creases) == (begin.scale, begin.plan.creases):
            yield place, rung


def _in_words(plan: Plan, words: str) -> str:
    places = ", ".join(f"({x:.3g}, {y:.3g}, {z:.3g})" for x, y, z in plan.apart)
    return ", ".join(filter(None, [words, f"creases not aligned near {places}" if places else ""]))


def plans(
    spacing: float, smoothing: float, settings: MeshingSettings, creased: bool = False, rows: bool = False
) -> Iterator[Rung]:
    """What is tried, one after the other; without the creases at last, where there are any.

    Args:
        spacing: length of edges.
        smoothing: of directions, over the spacing.
        settings: of the mesh.
        creased: whether there are creases.
        rows: whether the lattice has rows, which may follow either of two principal directions.
    """
    for kept in (True, False) if creased else (False,):
        can_align = settings.align_boundary or kept
        curves = "boundary and creases" if kept else "boundary"
        for scale in _SPACINGS:
            for number, (smoother, even) in enumerate(_ROWS if rows else [(of, 0.0) for of in _SMOOTHER]):
                for align in (True, False) if can_align else (False,):
                    words = [
                        "creases not kept" if creased and not kept else "",
                        f"directions smoothed over {smoothing * smoother:g} edges" if smoother != 1 else "",
                        "rows not along the same principal curvature everywhere" if even else "",
                        f"{curves} not aligned" if can_align and not align else "",
                        f"{abs(scale**-2 - 1):.0%} {'more' if scale < 1 else 'fewer'} faces" if scale != 1 else "",
                    ]
                    plan = Plan(spacing * scale, spacing * smoothing * smoother, align, kept, even)
                    yield Rung(plan, ", ".join(filter(None, words)), scale, smoother, even > 0 and number < 3)


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
