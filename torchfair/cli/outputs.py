"""The files that a job writes: a mesh, a report and pictures."""

from __future__ import annotations

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import CommandError

if TYPE_CHECKING:
    from torch import Tensor

    from ..formfinding import FormResult, JobResult, SymmetricResult
    from ..topology import Topology

_MESH_FORMATS = (".obj", ".off", ".ply")


class Outputs:
    """Mesh, report and pictures; each is written whole or not at all.

    Args:
        mesh: The mesh file.
        folder: Where report and pictures go; by default the folder of the mesh.
        pictures: Names of the pictures.
    """

    def __init__(self, mesh: Path, folder: str | None, pictures: Sequence[str]) -> None:
        self.mesh = mesh
        self.folder = mesh.parent if folder is None else Path(folder)
        self.report = self.folder / "report.json"
        self.pictures = [self.folder / name for name in pictures]

    def paths(self) -> list[Path]:
        """All files, the mesh first."""
        return [self.mesh, self.report, *self.pictures]

    def check(self, *, force: bool) -> None:
        """Refuses unknown mesh formats and, without ``force``, files that exist."""
        if self.mesh.suffix.lower() not in _MESH_FORMATS:
            raise CommandError(f"cannot write '{self.mesh}': choose a name that ends in {', '.join(_MESH_FORMATS)}")
        refuse_existing(self.paths(), force=force)

    def make_folders(self) -> None:
        """Makes the folders of all files, so that a solve does not end with nowhere to write."""
        for folder in {self.mesh.parent, self.folder}:
            folder.mkdir(parents=True, exist_ok=True)

    def write_mesh_and_report(
        self,
        topology: Topology,
        result: JobResult[Any] | FormResult | SymmetricResult,
        settings: object,
        arguments: argparse.Namespace,
        extra: Mapping[str, Any],
        *,
        polylines: Sequence[Tensor] = (),
    ) -> None:
        """Writes the mesh, which is what must not be lost, then the report: what all jobs report, and ``extra``.

        Polylines become line elements of an OBJ file.
        """
        from ..io import save_mesh, write_report

        run = result.projection
        save_mesh(self.mesh, result.vertices, topology, overwrite=arguments.force, polylines=polylines)
        common = {
            "input": arguments.input,
            "output": str(self.mesh),
            "handles": [[float(word) for word in words] for words in arguments.handle],
            "status": run.status.name.lower(),
            "message": run.message,
            "converged": run.status.converged,
            "scaled_gradient": run.gradient,
            "recent_fall": run.recent_fall,
            "solver": run.solver,
            "notes": result.notes,
        }
        write_report(
            self.report,
            energies_before=result.before,
            energies_after=result.after,
            residuals=run.residuals,
            history=run.history,
            settings=settings,
            timings=run.timings,
            extra={**common, **extra},
            overwrite=arguments.force,
        )


def refuse_existing(paths: Sequence[Path], *, force: bool) -> None:
    """Refuses files that exist, unless they may be replaced."""
    existing = [str(path) for path in paths if path.exists()]
    if existing and not force:
        raise CommandError(f"{', '.join(existing)} exists: choose another folder, or --force to replace")
