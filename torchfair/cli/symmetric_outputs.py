"""The files that ``torchfair symmetric`` writes."""

from __future__ import annotations

import argparse
import importlib.util
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from .errors import CommandError
from .outputs import Outputs

if TYPE_CHECKING:
    from ..formfinding import SymmetricResult, SymmetricSettings
    from ..io import PolygonMesh
    from ..principal import DevelopableStrips, PrincipalEdges

PICTURES = ("principal.png", "edges.png")


class SymmetricOutputs(Outputs):
    """Mesh with labels, report, pictures and strips.

    Args:
        arguments: Of the command.
        pictures: Names of the pictures.
    """

    def __init__(self, arguments: argparse.Namespace, pictures: Sequence[str]) -> None:
        super().__init__(Path(arguments.output), arguments.results, pictures)
        is_obj = self.mesh.suffix.lower() == ".obj"
        self.labels = None if is_obj else self.mesh.with_suffix(".edges.json")
        self.strips: list[Path] = []
        if arguments.strips is not None:
            kinds = ("obj", "svg", "dxf") if arguments.dxf else ("obj", "svg")
            self.strips = [self.folder / f"strips.{kind}" for kind in kinds]
        elif arguments.dxf:
            raise CommandError("--dxf: give the height of strips by --strips")
        if arguments.strips is not None and not arguments.strips + arguments.depth > 0.0:
            raise CommandError("--strips: a strip needs a height or a depth above 0")
        if not arguments.millimetres > 0.0:
            raise CommandError("--millimetres: expected a number above 0")
        if arguments.dxf and importlib.util.find_spec("ezdxf") is None:
            raise CommandError("--dxf needs ezdxf: pip install 'torchfair[dxf]'; SVG files do without")

    def paths(self) -> list[Path]:
        """All files, the mesh first."""
        labels = [] if self.labels is None else [self.labels]
        return [self.mesh, *labels, self.report, *self.pictures, *self.strips]

    def write(
        self,
        mesh: PolygonMesh,
        edges: PrincipalEdges,
        result: SymmetricResult,
        settings: SymmetricSettings,
        arguments: argparse.Namespace,
        notes: Sequence[str],
    ) -> list[str]:
        """Writes everything; what there is to say of the strips."""
        from ..io import save_edge_labels

        strips = self._unrolled(result, arguments)
        lines = [] if self.labels is not None else result.principal.polylines()
        extra = {
            "steps": sum(level.steps for level in result.levels),
            "levels": [
                {
                    "vertices": level.vertices.shape[0],
                    "before": level.before,
                    "after": level.after,
                    "steps": level.steps,
                    "seconds": sum(run.timings["total"] for run in level.runs),
                }
                for level in result.levels
            ],
            "labels": list(notes),
            "strips": _faults(strips),
        }
        self.write_mesh_and_report(result.topology, result, settings, arguments, extra, polylines=lines)
        if self.labels is not None:
            save_edge_labels(self.labels, result.topology, result.principal.mask, overwrite=arguments.force)
        if strips is not None:
            self._write_strips(strips, arguments)
        if self.pictures:
            self._draw(mesh, edges, result, arguments.force)
        if strips is None:
            return []
        return [
            f"{len(strips.names)} strips: planar to {float(strips.planarity.max()):.2g} edges, unrolled with lengths "
            f"true to {float(strips.isometry_errors.max()):.2g}"
        ]

    def _unrolled(self, result: SymmetricResult, arguments: argparse.Namespace) -> DevelopableStrips | None:
        from ..principal import developable_strips

        if not self.strips:
            return None
        level = result.levels[-1]
        return developable_strips(
            level.vertices,
            level.principal.polylines(),
            level.normals,
            arguments.strips,
            depth=arguments.depth,
        )

    def _write_strips(self, strips: DevelopableStrips, arguments: argparse.Namespace) -> None:
        from ..principal import save_strips_dxf, save_strips_obj, save_strips_svg

        solid, *flat = self.strips
        save_strips_obj(solid, strips, overwrite=arguments.force)
        for path, save in zip(flat, (save_strips_svg, save_strips_dxf), strict=False):
            save(path, strips, millimetres=arguments.millimetres, overwrite=arguments.force)

    def _draw(self, mesh: PolygonMesh, edges: PrincipalEdges, result: SymmetricResult, force: bool) -> None:
        from ..viewing import picture_edges, picture_principal_edges

        principal, energy = self.pictures
        picture_principal_edges(
            principal,
            {"start": (mesh.vertices, edges), "result": (result.vertices, result.principal)},
            overwrite=force,
        )
        named = {"start": mesh.vertices, "result": result.vertices}
        picture_edges(energy, named, [mesh.topology, result.topology], overwrite=force)


def _faults(strips: DevelopableStrips | None) -> dict[str, float] | None:
    if strips is None:
        return None
    return {
        "strips": len(strips.names),
        "quads": strips.topology.num_faces,
        "largest_planarity": float(strips.planarity.max()),
        "mean_planarity": float(strips.planarity.mean()),
        "largest_isometry_error": float(strips.isometry_errors.max()),
        "sheet_width": strips.sheet[0],
        "sheet_height": strips.sheet[1],
    }
