"""Other settings, one after the other, where the first give no valid mesh."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from dataclasses import replace
from functools import cache
from typing import NamedTuple

import numpy as np

from ..errors import MeshError, SingularSystemError
from ..fields import Directions
from ..fields.frames import Floats
from ..settings.meshing_settings import MeshingSettings
from .attempt import FailedAttemptError, PieceMesh, Plan, attempt
from .combing import combed
from .creases import Creases, find_creases
from .cut_graph import CutGraph
from .lattice import Lattice
from .plans import Kind, Rung, plans
from .pose import Pose
from .small_loops import small_loop
from .surface import DesignSurface

_PATHS = 1.3  # times the merging length of quads: paths along edges are longer than straight ones
_SHARE = 0.5  # of the time limit, for plans that keep creases
_RETRIES = 2  # with creases not aligned where a map is turned over


class NoMeshError(MeshError):
    """A surface of which no valid principal mesh was found.

    Attributes:
        vertex: number of a vertex where the last attempt went wrong, -1 if unknown.
    """

    def __init__(self, message: str, vertex: int = -1) -> None:
        super().__init__(message)
        self.vertex = vertex


class Again(NamedTuple):
    """How a component that has a mesh is meshed with another spacing.

    Attributes:
        plan: number of the plan that gave the mesh; only plans of its size follow.
        resolution: length of edges for which triangles are made fine enough.
        others: whether any may follow, or only what was done before will do.
    """

    plan: int
    resolution: float
    others: bool = True


def mesh_component(
    surface: DesignSurface,
    directions: Directions,
    lattice: Lattice,
    spacing: float,
    smoothing: float,
    settings: MeshingSettings,
    again: Again | None = None,
) -> tuple[PieceMesh, str, int]:
    """The mesh of a component by the first plan that gives a valid one, what was changed, and the plan's number.

    Args:
        surface: the component.
        directions: of its triangles.
        lattice: that is laid on it.
        spacing: length of edges.
        smoothing: of directions, over the spacing.
        settings: of the mesh.
        again: what is kept of a mesh with another spacing.

    Raises:
        NoMeshError: if none does.
    """
    resolution = spacing if again is None else again.resolution
    pose = surface.pose
    prepared = _Prepared(surface, directions, lattice, settings, pose.length(resolution))
    creased, bounded = bool(surface.sharp.any()), surface.topology.num_interior_edges < surface.topology.num_edges
    rungs = list(plans(pose.length(spacing), smoothing, settings, creased, lattice.has_rows, bounded))
    began = time.process_time()
    failures: list[FailedAttemptError] = []
    hopeless: set[Kind] = set()
    done: set[tuple[float, Kind]] = set()
    for number, rung in _numbered(rungs, again):
        limit = settings.time_limit * (_SHARE if rung.plan.creases else 1.0)
        late = time.process_time() - began > limit
        repeats = (rung.scale, rung.kind) in done
        if failures and (not settings.fallback or late or repeats or not rung.is_worth_it(hopeless)):
            continue
        done.add((rung.scale, rung.kind))
        found = _with_retries(prepared, rung, failures)
        if found is not None:
            mesh, plan = found
            return mesh.moved(pose), _in_words(plan, rung.words, pose), number
        if failures[-1].hopeless:
            hopeless.add(rung.kind)
    placed = [failure for failure in failures if failure.vertex >= 0]
    if not placed and (loop := small_loop(surface, spacing)) is not None:
        words = f"{failures[-1]} ({_tried(len(failures))}); {loop.remedy(spacing)}"
        raise NoMeshError(f"no valid mesh was found{_near(loop.vertex, loop.place)}: {words}", loop.vertex)
    told = placed[0] if placed else failures[-1]
    raise NoMeshError(_refusal(told, len(failures), pose), told.vertex)


class _Prepared:
    """What attempts at a component share, each thing made once.

    Attributes:
        surface: of :func:`mesh_component`, in its pose, as all lengths are.
        directions, lattice, settings: of it.
        resolution: length of edges for which triangles are made fine enough.
    """

    def __init__(
        self,
        surface: DesignSurface,
        directions: Directions,
        lattice: Lattice,
        settings: MeshingSettings,
        resolution: float,
    ) -> None:
        self.given, self.surface, self.resolution = surface, surface.placed, resolution
        self.directions = surface.pose.directions(directions)
        self.lattice, self.settings = lattice, settings
        self._finer, self._creases, self._graph = cache(self._cut_finer), cache(self._find_creases), cache(self._combed)

    def attempt(self, plan: Plan) -> PieceMesh:
        """The mesh as planned.

        Raises:
            FailedAttemptError: if there is none.
        """
        graph = self._graph(plan.spacing, plan.smoothing, plan.creases, plan.even)
        creases, triangles = self._creases(plan.spacing, plan.creases), self._finer(plan.creases)[0]
        try:
            return attempt(triangles, creases, graph, self.lattice, plan, self.settings)
        except SingularSystemError:
            raise FailedAttemptError("triangles are too thin to be mapped to the plane") from None

    def _cut_finer(self, kept: bool) -> tuple[DesignSurface, Directions]:
        if kept or not self.surface.sharp.any():
            return self.surface.cut_finer(self.directions, self.resolution)
        plain = self.surface.without_creases()
        directions, _ = self.given.without_creases().directions(self.settings.noise)
        return plain.cut_finer(self.given.pose.directions(directions), self.resolution)

    def _find_creases(self, spacing: float, kept: bool) -> Creases:
        triangles = self._finer(kept)[0]
        return find_creases(triangles.frames, triangles.sharp, self.settings.corner_angle, spacing)

    def _combed(self, spacing: float, smoothing: float, kept: bool, even: float) -> CutGraph:
        triangles, directions = self._finer(kept)
        merging = self.settings.merging * spacing * (1.0 if self.lattice.has_rows else _PATHS)
        creases = self._creases(spacing, kept)
        angle, symmetry = self.settings.boundary_angle, self.lattice.symmetry
        try:
            return combed(triangles.frames, directions, symmetry, smoothing, merging, creases, angle, even=even)
        except MeshError as error:
            raise FailedAttemptError(str(error), hopeless=True) from None


def _with_retries(prepared: _Prepared, rung: Rung, failures: list[FailedAttemptError]) -> tuple[PieceMesh, Plan] | None:
    """The mesh of a plan and that plan, also without creases as lines where it failed; or failures."""
    plan = rung.plan
    for _ in range(1 + _RETRIES * (prepared.settings.fallback and plan.creases and plan.align)):
        try:
            return prepared.attempt(plan), plan
        except FailedAttemptError as error:
            failures.append(error)
            if error.place is None or error.hopeless:
                break
            plan = replace(plan, apart=np.concatenate([plan.apart, error.place[None]]))
    return None


def _numbered(rungs: list[Rung], again: Again | None) -> Iterator[tuple[int, Rung]]:
    """Numbers of plans and plans: all of them, or those from one on that differ from it in neither size."""
    if again is None:
        yield from enumerate(rungs)
        return
    begin = rungs[again.plan]
    for number, rung in itertools.islice(enumerate(rungs), again.plan, None if again.others else again.plan + 1):
        if (rung.scale, rung.plan.creases) == (begin.scale, begin.plan.creases):
            yield number, rung


def _in_words(plan: Plan, words: str, pose: Pose) -> str:
    places = ", ".join(f"({x:.3g}, {y:.3g}, {z:.3g})" for x, y, z in pose.back(plan.apart))
    return ", ".join(filter(None, [words, f"creases not aligned near {places}" if places else ""]))


def _refusal(failure: FailedAttemptError, number: int, pose: Pose) -> str:
    where = "" if failure.place is None else _near(failure.vertex, pose.back(failure.place[None])[0])
    return (
        f"no valid mesh was found{where}: {failure} ({_tried(number)}). Ask for more or fewer faces, smooth directions "
        "over a longer length (smoothing), or give a finer or smoother surface"
    )


def _near(vertex: int, place: Floats) -> str:
    x, y, z = place
    return f" near vertex {vertex} at ({x:.4g}, {y:.4g}, {z:.4g})" if vertex >= 0 else ""


def _tried(number: int) -> str:
    return f"{number} setting(s) tried" if number > 1 else "one setting tried"
