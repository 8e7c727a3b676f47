"""Pictures that several job commands draw of what they were given and what came of it."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from .request import Request, Writer

if TYPE_CHECKING:
    from ..formfinding import JobResult, Level


def draw_before_after(path: Path, request: Request, result: JobResult[Level], overwrite: bool) -> None:
    """Both, shaded and as mirrors; the result may be a refinement."""
    from ..viewing import picture_before_after

    both = request.mesh.topology, result.topology
    picture_before_after(path, request.mesh.vertices, result.vertices, both, view=request.view, overwrite=overwrite)


def edges_of(before: str, after: str) -> Writer:
    """Draws edges of both, which are called so, by how much they bend; the result may be another mesh."""

    def draw(path: Path, request: Request, result: JobResult[Level], overwrite: bool) -> None:
        from ..viewing import picture_edges

        meshes = {before: request.mesh.vertices, after: result.vertices}
        picture_edges(path, meshes, [request.mesh.topology, result.topology], view=request.view, overwrite=overwrite)

    return draw
