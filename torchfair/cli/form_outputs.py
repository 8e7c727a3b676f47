"""The files that ``torchfair form`` writes."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from .outputs import Outputs

if TYPE_CHECKING:
    from ..formfinding import FormResult, FormSettings
    from ..io import PolygonMesh

PICTURES = ("curvature.png", "edges.png")


class FormOutputs(Outputs):
    """What ``torchfair form`` writes."""

    def write(
        self, mesh: PolygonMesh, result: FormResult, settings: FormSettings, arguments: argparse.Namespace
    ) -> None:
        """Writes everything, the mesh first: it is what must not be lost."""
        from ..io import save_mesh
        from .report import write_report

        save_mesh(self.mesh, result.vertices, result.topology, overwrite=arguments.force)
        write_report(
            self.report,
            energies_before=result.before,
            energies_after=result.after,
            residuals=result.projection.residuals,
            history=result.projection.history,
            settings=settings,
            timings=result.projection.timings,
            extra={
                "input": arguments.input,
                "curves": arguments.curve,
                "output": str(self.mesh),
                "handles": [[float(word) for word in words] for words in arguments.handle],
                "through": arguments.through,
                "status": result.projection.status.name.lower(),
                "message": result.message,
                "converged": result.projection.status.converged,
                "iterations": sum(run.iterations for run in result.stages),
                "solver": result.projection.solver,
                "notes": result.notes,
                "levels": arguments.levels,
                "stages": [
                    {
                        "level": level,
                        "status": run.status.name.lower(),
                        "timings": run.timings,
                        "history": [record.as_dict() for record in run.history],
                    }
                    for level, run in zip(result.levels, result.stages, strict=True)
                ],
            },
            overwrite=arguments.force,
        )
        if self.pictures:
            self._draw(mesh, result, arguments.force)

    def _draw(self, mesh: PolygonMesh, result: FormResult, force: bool) -> None:
        from ..viewing import picture_curvature, picture_edges

        curvature, edges = self.pictures
        meshes = [("start", mesh.vertices, mesh.topology), ("result", result.vertices, result.topology)]
        picture_curvature(curvature, meshes, overwrite=force)
        named = {name: vertices for name, vertices, _ in meshes}
        picture_edges(edges, named, [topology for *_, topology in meshes], overwrite=force)
