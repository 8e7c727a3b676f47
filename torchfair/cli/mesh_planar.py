"""A principal mesh whose polygons are made planar."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

    from ..meshing import QuadMesh
    from ..topology import Topology

_DISTANCE = 0.03  # mean edges from the surface


def made_planar(mesh: QuadMesh, surface: tuple[Tensor, Topology]) -> tuple[QuadMesh, list[str]]:
    """The mesh with planar polygons near the surface, and what was not reached.

    Its report is that of the mesh before, under ``before_planar``, and that of the result.
    """
    from ..formfinding import FairSettings, minimise_normal_variation
    from ..progress import ProgressDisplay

    settings = FairSettings(planar="quads", distance_limit=_DISTANCE, directions="keep")
    with ProgressDisplay(settings.projection.max_iterations) as display:
        result = minimise_normal_variation(
            mesh.vertices, mesh.topology, reference=surface, settings=settings, callback=display
        )
    from ..meshing import measure_mesh_on

    report = {**measure_mesh_on(result.vertices, mesh, surface), "before_planar": mesh.report}
    missed = [str(promise) for promise in result.promises if not promise.holds]
    notes = [*mesh.notes, *result.notes]
    return replace(mesh, vertices=result.vertices, report=report, notes=notes), missed
