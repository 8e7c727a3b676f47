"""The files that ``torchfair fair`` writes."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from .outputs import Outputs

if TYPE_CHECKING:
    from ..formfinding import FairSettings, JobResult, Level
    from ..io import PolygonMesh

PICTURES = ("before_after.png", "edges.png", "gauss_images.png")


class FairOutputs(Outputs):
    """What ``torchfair fair`` writes."""

    def write(
        self, mesh: PolygonMesh, result: JobResult[Level], settings: FairSettings, arguments: argparse.Namespace
    ) -> None:
        """Writes everything."""
        before, after = (energies["normal_variation"] for energies in (result.before, result.after))
        extra = {
            "reference": arguments.reference,
            "iterations": result.projection.iterations,
            "preparation": [[record.as_dict() for record in run.history] for run in result.preparation],
            "initial_residuals": result.projection.initial_residuals,
            "energy_change_percent": 100.0 * (after / max(before, 1e-300) - 1.0),
        }
        self.write_mesh_and_report(mesh.topology, result, settings, arguments, extra)
        if self.pictures:
            self._draw(mesh, result, arguments.force)

    def _draw(self, mesh: PolygonMesh, result: JobResult[Level], force: bool) -> None:
        from ..viewing import picture_before_after, picture_edges, picture_gauss_images

        before, after, topology = mesh.vertices, result.vertices, mesh.topology
        overview, edges, sphere = self.pictures
        picture_before_after(overview, before, after, topology, overwrite=force)
        picture_edges(edges, {"before": before, "after": after}, topology, overwrite=force)
        picture_gauss_images(sphere, before, after, topology, overwrite=force)
