"""Principal quads of the surface that ``torchfair form`` finds."""

from __future__ import annotations

import argparse
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .arguments import positive_count
from .mesh import draw_singular, table
from .outputs import Outputs
from .request import Request, Writer
from .result_files import save_result

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
            self.late = {f"-quads{self.names.suffix}": self._save}
            if self.pictures:
                self.pictures[_PICTURE] = self._draw

    def more(self, request: Request, result: Any) -> bool:
        """Meshes the surface; says why if there are no quads."""
        if self._count is None:
            return False
        reason = self._make(self._count, request, result)
        if reason:
            self.pictures.pop(_PICTURE, None)
            late, self.late = self.late, {}
            request.report["principal_quads"] = {"not_reached": reason}
            old = [path for path in map(self.names.beside, late) if path.exists()]
            words = "".join(f"; {path} is of an earlier run" for path in old)
            request.missed.append(f"principal quads (--mesh {self._count}): NOT REACHED; {reason}{words}")
        return True

    def lines(self) -> list[str]:
        """Measures of the quads."""
        return [] if self._made is None else ["", "principal quads", *table(self._made.report)]

    def _make(self, count: int, request: Request, result: JobResult[Level]) -> str:
        """Meshes the surface; why not, in words, or nothing."""
        from ..errors import TorchfairError
        from ..meshing import principal_quads
        from ..projection import Status

        if request.interrupted or result.projection.status is Status.INTERRUPTED:
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
