"""Principal quads made planar: the end of the chain from a design surface to panels (paper section 6, Fig. 17)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from torch import Tensor

from ...projection import Callback, Status
from ...settings.fair_settings import FairSettings
from ...topology import Topology
from ..job import JobResult, Level
from ..job.recipe import fixed_note
from .kept_corners import corners_of_surface, held_corners
from .panels import PLANAR_PROMISE
from .planarity_goal import KEEP_LIMIT
from .recipe import minimise_normal_variation

if TYPE_CHECKING:
    from ...meshing import QuadMesh

    _Solved = tuple[JobResult[Level], dict[str, Any]]
    _IsBetter = Callable[[Mapping[str, Any], Mapping[str, Any]], bool]  # than the first solve, by reports

PLANAR_QUADS = FairSettings(
    planar="quads",
    distance_limit=0.03,
    directions="keep",
    direction_weight=300.0,
    energy_weight=10.0,
    largest_area=1.5,
    smallest_share=0.05,
)
"""Planar polygons at most 3 % of a mean edge from the surface, with edges that keep their directions.

Panels grow by half at most: since edges of the boundary have no E, panels there would grow threefold. None becomes less
than a twentieth of the mean, or than nine tenths of what it was where that is less.
"""

_TURNED = 1.0  # degrees in the mean, beyond which edges turn too far
_STIFFER = replace(PLANAR_QUADS, direction_weight=3000.0)
_LITTLE = 0.5  # degrees in the mean, up to which edges may turn farther for less E
_LEAST = 1.01  # E over C, beyond which they do
_SOFTER = replace(PLANAR_QUADS, direction_weight=100.0)
_LITTLE_SOFTER = replace(PLANAR_QUADS, direction_weight=200.0)
_STAYS = 1e-9  # of an edge
_REMEDY = (
    "ask for more faces, which are more nearly planar before, or make a rough surface smooth first: torchfair denoise"
)
_HOPELESS = 0.1  # planarity in mean edges of a face, beyond which nothing more is tried
_MOST_STEPS = 250  # of a solve after which directions are not weighed anew
_NEARLY = 0.01  # planarity in mean edges of a face, from which other settings may make panels planar


def planar_quads(
    mesh: QuadMesh, surface: tuple[Tensor, Topology], *, callback: Callback | None = None
) -> tuple[QuadMesh, JobResult[Level]]:
    """A principal mesh with planar polygons near the surface that it was made from.

    Lowers E under ``PLANAR_QUADS``; what `torchfair mesh --planar` does. There is a second solve from the same start:

    - where panels are nearly planar, to 0.01, but not planar. Directions count two thirds then, and what is planar
      is taken;
    - where that turns edges away from principal directions by more than 1 degree in the mean. Directions count ten
      times then, and what turns edges less is taken;
    - where that keeps its promises but E ends above 1.01 C, and edges turned by at most half a degree. Directions count
      a third then, and what has less E is taken, if edges turn by at most 1 degree.

    There is none where the first is far from planar, by more than 0.1; and those for directions and E there are only
    if it took at most 250 steps.

    The result of a second solve is taken only where it keeps promises and limits as well as the first does; vertices
    may end as far from the surface as they were before.

    Corners of the boundary of the surface stay in their places, but for those of faces with three of them; all may move
    where panels become planar only then, as where a rough boundary turns everywhere.

    Args:
        mesh: from :func:`torchfair.meshing.principal_quads`.
        surface: vertices and topology that it was made from.
        callback: see :func:`minimise_normal_variation`.

    Returns:
        The mesh with its vertices moved, and the job with its promises. The report of the mesh is that of the result,
        with the one before under ``before_planar``. Notes say where faces had to leave the surface farther than that,
        where edges turned away from principal directions by more than 1 degree in the mean, and how far corners of
        the boundary moved.

    Raises:
        ShapeError: if the surface is not one mesh.

    Example:
        >>> from torchfair.formfinding import planar_quads
        >>> from torchfair.meshing import principal_quads
        >>> from torchfair.shapes import Cylinder, irregular_triangles
        >>> tube = irregular_triangles(Cylinder(), 500)
        >>> mesh = principal_quads(tube.vertices, tube.topology, count=80)
        >>> made, job = planar_quads(mesh, (tube.vertices, tube.topology))
        >>> made.report["planarity_max"] < 1e-4, job.holds
        (True, True)
    """
    from ...meshing import measure_mesh_on  # here, because other jobs need nothing of meshing
    from ...meshing.nearest_directions import NearestDirections

    directions = NearestDirections(mesh.surface, mesh.report["spacing"])
    corners = corners_of_surface(mesh.vertices, surface, mesh.report["spacing"], PLANAR_QUADS.corner_angle)
    held = held_corners(mesh.topology, corners)

    def solved(settings: FairSettings, held: Sequence[int]) -> _Solved:
        job = minimise_normal_variation(
            mesh.vertices,
            mesh.topology,
            reference=surface,
            directions_at=directions,
            fixed=held,
            settings=settings,
            callback=callback,
        )
        return job, {**measure_mesh_on(job.vertices, mesh), "before_planar": mesh.report}

    def best(held: Sequence[int]) -> _Solved:
        job, report = first = solved(PLANAR_QUADS, held)
        again = None if job.stopped else _again(report, holds=job.holds, steps=job.steps)
        if again is None:
            return first
        settings, is_better = again
        other = solved(settings, held)
        return _one_of(first, other, taken=_is_as_good(other[0], job) and is_better(other[1], report))

    job, report = first = best(held)
    if held and PLANAR_PROMISE < report["planarity_max"] <= _HOPELESS and not job.stopped:
        freed = best([])
        job, report = _one_of(first, freed, taken=_is_planar(freed[1], report))
    solve = f"{job.steps} steps towards planar polygons: {_ending(job)}"
    moved = (job.vertices - mesh.vertices).norm(dim=1)[corners.to(mesh.vertices.device)] / mesh.report["spacing"]
    job = _in_counts(job, fixed_note(len(held)))
    said = [*mesh.notes, *job.notes, *_turned(report), *_moved(moved), solve]
    return replace(mesh, vertices=job.vertices, report=report, notes=said), job


def _again(report: Mapping[str, Any], *, holds: bool, steps: int) -> tuple[FairSettings, _IsBetter] | None:
    """The settings of a second solve after one of so many steps, and when it is better; None if that was enough."""
    turn, ratio = _turn(report), report["variation_over_curvature"]
    if report["planarity_max"] > _HOPELESS:
        return None
    if PLANAR_PROMISE < report["planarity_max"] <= _NEARLY:
        return _LITTLE_SOFTER, _is_planar
    if steps > _MOST_STEPS:
        return None
    if turn > _TURNED:
        return _STIFFER, _turns_less
    if holds and turn <= _LITTLE and ratio is not None and ratio > _LEAST:
        return _SOFTER, _has_less_energy
    return None


def _is_planar(one: Mapping[str, Any], _other: Mapping[str, Any]) -> bool:
    return bool(one["planarity_max"] <= PLANAR_PROMISE)


def _turns_less(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    return _turn(one) < _turn(other)


def _has_less_energy(one: Mapping[str, Any], other: Mapping[str, Any]) -> bool:
    """Whether E of one report is less, with edges that turn no farther than they may."""
    return _turn(one) <= _TURNED and one["normal_variation"] < other["normal_variation"]


def _is_as_good(one: JobResult[Level], other: JobResult[Level]) -> bool:
    """Whether a job keeps its promises if another does, and ends as near the surface and as planar or within limits.

    As near as vertices were at the start is near enough.
    """
    near = max(PLANAR_QUADS.distance_limit or 0.0, one.before["largest_distance_relative"])
    limits = {"largest_distance_relative": near, "largest_planarity": PLANAR_PROMISE}
    return one.holds >= other.holds and all(
        one.after[name] <= max(other.after[name], limit) for name, limit in limits.items()
    )


def _one_of(first: _Solved, other: _Solved, *, taken: bool) -> _Solved:
    """The other where it is taken; else the first, stopped if the other was."""
    if taken:
        return other
    job, report = first
    return (_stopped_like(other[0], job) if other[0].stopped else job), report


def _stopped_like(stopped: JobResult[Level], job: JobResult[Level]) -> JobResult[Level]:
    """A job that is the best found when the one after it was stopped, so that who asked for that is told."""
    *levels, last = job.levels
    end = replace(last.runs[-1], status=stopped.projection.status, message=stopped.message)
    return replace(job, levels=[*levels, replace(last, runs=[*last.runs[:-1], end])], stopped=True)


def _moved(shares: Tensor) -> list[str]:
    """Which corners of the boundary are no longer in their places (n,) spacings away, in words."""
    away = shares[shares > _STAYS]
    if not len(away):
        return []
    return [
        f"{len(away)} of {len(shares)} corners of the boundary moved, by up to {float(away.max()):.2g} mean edge "
        "lengths"
    ]


def _in_counts(job: JobResult[Level], of_corners: str) -> JobResult[Level]:
    """A job with what a mesh can be asked for in place of its settings, and without its note ``of_corners``."""
    *levels, last = job.levels
    promises = [replace(promise, remedy=_REMEDY) for promise in last.promises]
    known = {str(old): str(new) for old, new in zip(last.promises, promises, strict=True)}
    notes = [known.get(note) or _without_limit(note) for note in job.notes if note != of_corners]
    return replace(job, levels=[*levels, replace(last, promises=promises)], notes=notes)


def _ending(job: JobResult[Level]) -> str:
    """How the solve ended, without what settings of a solve could do about it."""
    status = job.projection.status
    words = {Status.MAX_ITERATIONS: "ended after as many as there may be", Status.STALLED: "not converged"}
    return job.message.replace(status.value, words.get(status, status.value), 1)


def _without_limit(note: str) -> str:
    said = note.removesuffix(KEEP_LIMIT)
    return note if said == note else f"{said}. Ask for more faces, which are more nearly planar before"


def _turn(report: Mapping[str, Any]) -> float:
    """Degrees in the mean by which planar faces have turned edges away; 0 where there are no directions."""
    before, after = report["before_planar"]["angle_mean_degrees"], report["angle_mean_degrees"]
    return 0.0 if before is None or after is None else float(after - before)


def _turned(report: Mapping[str, Any]) -> list[str]:
    """What became of the angle to principal directions, in words, if that is worth saying."""
    if _turn(report) <= _TURNED:
        return []
    before, after = report["before_planar"]["angle_mean_degrees"], report["angle_mean_degrees"]
    return [
        f"planar faces turn edges away from principal directions: {before:.2g} degrees in the mean before, {after:.2g} "
        "now. Ask for more faces, which are more nearly planar before"
    ]
