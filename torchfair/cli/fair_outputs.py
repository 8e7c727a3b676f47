"""The files that ``torchfair fair`` writes."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from .outputs import Outputs

if TYPE_CHECKING:
    from ..formfinding import FairResult, FairSettings
    from ..io import PolygonMesh

PICTURES = ("before_after.png", "edges.png", "gauss_images.png")


class FairOutputs(Outputs):
    """What ``torchfair fair`` writes."""

    def write(
        self, mesh: PolygonMesh, result: FairResult, settings: FairSettings, arguments: argparse.Namespace
    ) -> None:
        """Writes everything, the mesh first: it is what must not be lost."""
        from ..io import save_mesh
        from .report import write_report

        save_mesh(self.mesh, result.vertices, mesh.topology, overwrite=arguments.force)
        write_report(
            self.report,
            energies_before=result.before,
            energies_after=result.after,
            residuals=result.projection.residuals,
            history=result.projection.history,
            settings=settings,
            timings=result.projection.timings,
            extra={
                "input": str(arguments.input),
                "output": str(self.mesh),
                "reference": arguments.reference,
                "handles": [[float(word) for word in words] for words in arguments.handle],
                "status": result.projection.status.name.lower(),
                "message": result.projection.message,
                "converged": result.projection.status.converged,
                "iterations": result.projection.iterations,
                "solver": result.projection.solver,
                "notes": result.notes,
                "preparation": [[record.as_dict() for record in run.history] for run in result.preparation],
                "initial_residuals": result.projection.initial_residuals,
                "energy_change_percent": 100.0
                * (result.after["normal_variation"] / max(result.before["normal_variation"], 1e-300) - 1.0),
            },
            overwrite=arguments.force,
        )
        if self.pictures:
            self._draw(mesh, result, arguments.force)

    def _draw(self, mesh: PolygonMesh, result: FairResult, force: bool) -> None:
        from ..viewing import picture_before_after, picture_edges, picture_gauss_images

        before, after, topology = mesh.vertices, result.vertices, mesh.topology
        overview, edges, sphere = self.pictures
        picture_before_after(overview, before, after, topology, overwrite=force)
        picture_edges(edges, {"before": before, "after": after}, topology, overwrite=force)
        picture_gauss_images(sphere, before, after, topology, overwrite=force)
