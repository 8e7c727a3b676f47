"""Principal quads made planar: the end of the chain from a design surface to panels (paper section 6, Fig. 17)."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

from torch import Tensor

from ...projection import Callback
from ...settings.fair_settings import FairSettings
from ...topology import Topology
from ..job import JobResult, Level
from .recipe import minimise_normal_variation

if TYPE_CHECKING:
    from ...meshing import QuadMesh

PLANAR_QUADS = FairSettings(planar="quads", distance_limit=0.03, directions="keep")
"""Planar polygons at most 3 % of a mean edge from the surface, with edges that keep their directions."""


def planar_quads(
    mesh: QuadMesh, surface: tuple[Tensor, Topology], *, callback: Callback | None = None
) -> tuple[QuadMesh, JobResult[Level]]:
    """A principal mesh with planar polygons near the surface that it was made from.

    Lowers E under ``PLANAR_QUADS``; what `torchfair mesh --planar` does.

    Args:
        mesh: from :func:`torchfair.meshing.principal_quads`.
        surface: vertices and topology that it was made from.
        callback: see :func:`minimise_normal_variation`.

    Returns:
        The mesh with its vertices moved, and the job with its promises. The report of the mesh is that of the result,
        with the one before under ``before_planar``.

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

    job = minimise_normal_variation(
        mesh.vertices, mesh.topology, reference=surface, settings=PLANAR_QUADS, callback=callback
    )
    report = {**measure_mesh_on(job.vertices, mesh), "before_planar": mesh.report}
    solve = f"{job.steps} steps towards planar polygons: {job.message}"
    return replace(mesh, vertices=job.vertices, report=report, notes=[*mesh.notes, *job.notes, solve]), job
