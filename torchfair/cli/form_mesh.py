"""Principal quads of the surface that ``torchfair form`` finds."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .arguments import positive_count
from .mesh import draw_singular, table
from .outputs import Outputs, Request, Writer, save_result

if TYPE_CHECKING:
    from ..formfinding import JobResult, Level
    from ..meshing import QuadMesh

_PICTURE = "mesh.png"


def add_mesh(parser: argparse.ArgumentParser) -> None:
    """The option to mesh the result."""
    parser.add_argument("--mesh", type=positive_count, metavar="N", help="also write about so many quads along the "
        "principal directions of the result, into NAME-quads beside OUTPUT, as 'torchfair mesh --quads N' "
        "does")  # fmt: skip


class FormOutputs(Outputs):
    """The surface, and with ``--mesh N`` quads along its principal directions.

    The surface is written before it is meshed, so that it is there whatever comes of that.

    Args:
        arguments, pictures: See the base class.
    """

    def __init__(self, arguments: argparse.Namespace, pictures: Mapping[str, Writer]) -> None:
        super().__init__(arguments, pictures)
        self._count: int | None = arguments.mesh
        self._made: QuadMesh | None = None
        if self._count is not None:
            self.beside = {self.mesh.with_name(f"{self.mesh.stem}-quads{self.mesh.suffix}"): self._save}
            if self.pictures:
                self.pictures[self.folder / _PICTURE] = self._draw

    def write_mesh(self, request: Request, result: Any) -> None:
        """Writes the surface, meshes it, and writes the quads; says why if there are none."""
        beside, self.beside = self.beside, {}
        super().write_mesh(request, result)
        if self._count is None:
            return
        reason = self._make(self._count, request, result)
        if reason:
            self.pictures.pop(self.folder / _PICTURE, None)
            request.report["principal_quads"] = {"not_reached": reason}
            old = "".join(f"; {path} is of an earlier run" for path in beside if path.exists())
            request.missed.append(f"principal quads (--mesh {self._count}): NOT REACHED; {reason}{old}")
        else:
            self.beside = beside
            self._write(beside, request, result)

    def lines(self) -> list[str]:
        """Measures of the quads."""
        return [] if self._made is None else ["", "principal quads", *table(self._made.report)]

    def _make(self, count: int, request: Request, result: JobResult[Level]) -> str:
        """Meshes the surface; why not, in words, or nothing."""
        from ..errors import TorchfairError
        from ..meshing import principal_quads
        from ..projection import Status

        if result.projection.status is Status.INTERRUPTED:
            return "interrupted before"
        try:
            self._made = made = principal_quads(result.vertices, result.topology, count=count)
        except TorchfairError as error:
            return str(error)
        except KeyboardInterrupt:
            request.interrupted = True
            return "interrupted"
        request.notes += [f"principal quads: {note}" for note in made.notes]
        request.report["principal_quads"] = {
            "measures": made.report,
            "singular_points": made.singular_points,
            "singular_indices": made.singular_indices,
            "notes": list(made.notes),
        }
        return ""

    def _save(self, path: Path, request: Request, result: Any, overwrite: bool) -> None:
        assert self._made is not None
        request.notes += save_result(path, self._made.vertices, self._made.topology, request.mesh, force=overwrite)

    def _draw(self, path: Path, request: Request, result: Any, overwrite: bool) -> None:
        draw_singular(path, request, self._made, overwrite)
