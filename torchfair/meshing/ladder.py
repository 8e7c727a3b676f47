"""Other settings, one after the other, where the first give no valid mesh."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ..fields import Directions
from ..settings.meshing_settings import MeshingSettings
from .failed_attempt import FailedAttemptError
from .lattice import Lattice
from .no_mesh import no_mesh
from .piece_mesh import PieceMesh
from .plan import Plan
from .plans import Kind, Rung, plans
from .pose import Pose
from .prepared import Prepared
from .surface import DesignSurface

_SHARE = 0.5  # of the time limit, for plans that keep creases
_RETRIES = 2  # with creases not aligned where a map is turned over


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
    prepared = Prepared(surface, directions, lattice, settings, pose.length(resolution))
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
    raise no_mesh(failures, surface, spacing)


def _with_retries(prepared: Prepared, rung: Rung, failures: list[FailedAttemptError]) -> tuple[PieceMesh, Plan] | None:
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
