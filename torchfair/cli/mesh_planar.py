"""A principal mesh whose polygons are made planar."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

from .._interrupts import deferred_interrupts

if TYPE_CHECKING:
    from ..io import PolygonMesh
    from ..meshing import QuadMesh
    from ..projection import Status

_DISTANCE = 0.03  # mean edges from the surface


class PlanarMesh(NamedTuple):
    """What became of a mesh that was to be made planar.

    Attributes:
        mesh: with the report of the mesh before, under ``before_planar``, beside its own.
        missed: what was not reached, in words.
        status: how the solve ended.
    """

    mesh: QuadMesh
    missed: list[str]
    status: Status


def made_planar(mesh: QuadMesh, surface: PolygonMesh) -> PlanarMesh:
    """The mesh with planar polygons near the surface. Ctrl-C ends the solve, not the command: the best mesh is kept."""
    with deferred_interrupts():
        from ..formfinding import FairSettings, minimise_normal_variation
        from ..meshing import measure_mesh_on
        from ..progress import ProgressDisplay

        settings = FairSettings(planar="quads", distance_limit=_DISTANCE, directions="keep")
        reference = surface.vertices, surface.topology
        with ProgressDisplay(settings.projection.max_iterations) as display:
            result = minimise_normal_variation(
                mesh.vertices, mesh.topology, reference=reference, settings=settings, callback=display
            )
        report = {**measure_mesh_on(result.vertices, mesh), "before_planar": mesh.report}
        missed = [str(promise) for promise in result.promises if not promise.holds]
        solve = f"{result.steps} steps towards planar polygons: {result.message}"
        notes = [*mesh.notes, *result.notes, solve]
        planar = replace(mesh, vertices=result.vertices, report=report, notes=notes)
        return PlanarMesh(planar, missed, result.projection.status)
