"""Principal quads made planar: the end of the chain from a design surface to panels (paper section 6, Fig. 17)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from torch import Tensor

from ...projection import Callback, Status
from ...settings.fair_settings import FairSettings
from ...topology import Topology
from ..job import JobResult, Level
from .recipe import minimise_normal_variation

if TYPE_CHECKING:
    from ...meshing import QuadMesh

    _Solved = tuple[JobResult[Level], dict[str, Any]]

PLANAR_QUADS = FairSettings(
    planar="quads",
    distance_limit=0.03,
    directions="keep",
    direction_weight=300.0,
    energy_weight=10.0,
    largest_area=1.5,
)
"""Planar polygons at most 3 % of a mean edge from the surface, with edges that keep their directions.

Panels grow by half at most: since edges of the boundary have no E, panels there would grow threefold.
"""

_TURNED = 1.0  # degrees in the mean, beyond which edges turn too far
_GENTLER = replace(PLANAR_QUADS, energy_weight=1.0)
_STOPPED = (Status.INTERRUPTED, Status.CALLBACK)


def planar_quads(
    mesh: QuadMesh, surface: tuple[Tensor, Topology], *, callback: Callback | None = None
) -> tuple[QuadMesh, JobResult[Level]]:
    """A principal mesh with planar polygons near the surface that it was made from.

    Lowers E under ``PLANAR_QUADS``; what `torchfair mesh --planar` does. Where that turns edges away from principal
    directions by more than 1 degree in the mean, it is done once more with E counting a tenth, from the same start, and
    what turns them less is taken.

    Args:
        mesh: from :func:`torchfair.meshing.principal_quads`.
        surface: vertices and topology that it was made from.
        callback: see :func:`minimise_normal_variation`.

    Returns:
        The mesh with its vertices moved, and the job with its promises. The report of the mesh is that of the result,
        with the one before under ``before_planar``. Notes say where faces had to leave the surface farther than that,
        and where edges turned away from principal directions by more than 1 degree in the mean.

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

    def solved(settings: FairSettings) -> _Solved:
        job = minimise_normal_variation(
            mesh.vertices, mesh.topology, reference=surface, settings=settings, callback=callback
        )
        return job, {**measure_mesh_on(job.vertices, mesh), "before_planar": mesh.report}

    job, report = solved(PLANAR_QUADS)
    if _turn(report) > _TURNED and job.projection.status not in _STOPPED:
        other = solved(_GENTLER)
        if other[0].holds >= job.holds and _is_as_near(other[0], job) and _turn(other[1]) < _turn(report):
            job, report = other
    solve = f"{job.steps} steps towards planar polygons: {job.message}"
    said = [*mesh.notes, *job.notes, *_turned(report), solve]
    return replace(mesh, vertices=job.vertices, report=report, notes=said), job


def _is_as_near(one: JobResult[Level], other: JobResult[Level]) -> bool:
    """Whether a job ends as near the surface as another one, or within the limit."""
    near, far = (float(job.after["largest_distance_relative"]) for job in (one, other))
    return near <= max(far, PLANAR_QUADS.distance_limit or 0.0)


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
