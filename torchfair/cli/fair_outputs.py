"""The files that ``torchfair fair`` writes."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from .errors import CommandError

if TYPE_CHECKING:
    from ..formfinding import FairResult, FairSettings
    from ..io import PolygonMesh

_MESH_FORMATS = (".obj", ".off", ".ply")


class Outputs:
    """Mesh, report and pictures; each is written whole or not at all.

    Args:
        mesh: The mesh file.
        folder: Where report and pictures go; by default the folder of the mesh.
        pictures: Whether there are pictures.
    """

    def __init__(self, mesh: Path, folder: str | None, *, pictures: bool) -> None:
        self.mesh = mesh
        self.folder = mesh.parent if folder is None else Path(folder)
        self.report = self.folder / "report.json"
        names = ("before_after.png", "edges.png", "gauss_images.png") if pictures else ()
        self.pictures = [self.folder / name for name in names]

    def paths(self) -> list[Path]:
        """All files, the mesh first."""
        return [self.mesh, self.report, *self.pictures]

    def check(self, *, force: bool) -> None:
        """Refuses unknown mesh formats and, without ``force``, files that exist."""
        if self.mesh.suffix.lower() not in _MESH_FORMATS:
            raise CommandError(f"cannot write '{self.mesh}': choose a name that ends in {', '.join(_MESH_FORMATS)}")
        existing = [str(path) for path in self.paths() if path.exists()]
        if existing and not force:
            raise CommandError(f"{', '.join(existing)} exists: choose another folder, or --force to replace")

    def make_folders(self) -> None:
        """Makes the folders of all files, so that a solve does not end with nowhere to write."""
        for folder in {self.mesh.parent, self.folder}:
            folder.mkdir(parents=True, exist_ok=True)

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
