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
        """Writes everything."""
        extra = {
            "curves": arguments.curve,
            "through": arguments.through,
            "iterations": sum(run.iterations for run in result.stages),
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
        }
        self.write_mesh_and_report(result.topology, result, settings, arguments, extra)
        if self.pictures:
            self._draw(mesh, result, arguments.force)

    def _draw(self, mesh: PolygonMesh, result: FormResult, force: bool) -> None:
        from ..viewing import picture_curvature, picture_edges

        curvature, edges = self.pictures
        meshes = [("start", mesh.vertices, mesh.topology), ("result", result.vertices, result.topology)]
        picture_curvature(curvature, meshes, overwrite=force)
        named = {name: vertices for name, vertices, _ in meshes}
        picture_edges(edges, named, [topology for *_, topology in meshes], overwrite=force)
