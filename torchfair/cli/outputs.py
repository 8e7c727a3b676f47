"""The files that a job writes: a mesh, a report and pictures."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from .errors import CommandError

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
        existing = [str(path) for path in self.paths() if path.exists()]
        if existing and not force:
            raise CommandError(f"{', '.join(existing)} exists: choose another folder, or --force to replace")

    def make_folders(self) -> None:
        """Makes the folders of all files, so that a solve does not end with nowhere to write."""
        for folder in {self.mesh.parent, self.folder}:
            folder.mkdir(parents=True, exist_ok=True)
