"""A principal mesh whose polygons are made planar."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from ..io import PolygonMesh
    from ..meshing import QuadMesh
    from ..projection import Status


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


def made_planar(mesh: QuadMesh, surface: PolygonMesh, *, quiet: bool) -> PlanarMesh:
    """The mesh with planar polygons near the surface; to be called where Ctrl-C waits, which ends the solve."""
    from ..formfinding import PLANAR_QUADS, planar_quads
    from ..progress import ProgressDisplay

    with ProgressDisplay(PLANAR_QUADS.projection.max_iterations) as display:
        made, job = planar_quads(mesh, (surface.vertices, surface.topology), callback=None if quiet else display)
    missed = [str(promise) for promise in job.promises if not promise.holds]
    return PlanarMesh(made, missed, job.projection.status)
