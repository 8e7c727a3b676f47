"""A principal mesh whose polygons are made planar."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from torch import Tensor

    from ..meshing import QuadMesh
    from ..topology import Topology


def made_planar(mesh: QuadMesh, surface: tuple[Tensor, Topology]) -> tuple[QuadMesh, list[str]]:
    """The mesh with planar polygons near the surface, and what was not reached."""
    from ..formfinding import PLANAR_QUADS, planar_quads
    from ..progress import ProgressDisplay

    with ProgressDisplay(PLANAR_QUADS.projection.max_iterations) as display:
        made, job = planar_quads(mesh, surface, callback=display)
    return made, [str(promise) for promise in job.promises if not promise.holds]
