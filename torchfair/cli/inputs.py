"""What several commands read: meshes, and vertices that are pulled somewhere."""

from __future__ import annotations

import argparse
import sys
from typing import TYPE_CHECKING

from .arguments import count
from .errors import CommandError
from .reading import add_repair as add_repair
from .reading import read_options, said_of

if TYPE_CHECKING:
    from torch import Tensor

    from ..io import PolygonMesh
    from ..topology import Topology


def read_input(name: str, arguments: argparse.Namespace | None = None) -> PolygonMesh:
    """A mesh file, read with the options of :func:`add_repair`; or a built-in example ``example:NAME``."""
    from ..io import PolygonMesh, load_mesh

    if not name.startswith("example:"):
        return load_mesh(name, **({} if arguments is None else read_options(arguments)))
    from ..shapes import EXAMPLES, builtin_mesh

    example = name.removeprefix("example:")
    if example not in EXAMPLES:
        raise CommandError(f"there is no example '{example}': choose {', '.join(sorted(EXAMPLES))}")
    return PolygonMesh(*builtin_mesh(example))


def add_reference(parser: argparse.ArgumentParser, words: str) -> None:
    """The option of a surface to stay close to."""
    parser.add_argument("--reference", metavar="FILE", help=words)


def read_reference(arguments: argparse.Namespace) -> tuple[Tensor, Topology] | None:
    """The surface of ``--reference``; says what is to be known of it."""
    if arguments.reference is None:
        return None
    mesh = read_input(arguments.reference, arguments)
    for line in said_of(mesh, arguments.reference):
        print(line, file=sys.stderr)
    return mesh.vertices, mesh.topology


def add_handles(parser: argparse.ArgumentParser) -> None:
    """The option to pull vertices."""
    parser.add_argument("--handle", nargs=4, action="append", default=[], metavar=("VERTEX", "X", "Y", "Z"),
        help="pull a vertex of INPUT (counted from 0) to a place; repeatable")  # fmt: skip


def read_handles(arguments: argparse.Namespace, mesh: PolygonMesh) -> dict[int, list[float]]:
    """Where ``--handle`` pulls vertices of a mesh, which are counted as in its file."""
    given = [_vertex_target(*words) for words in arguments.handle]
    return {_in_mesh(vertex, mesh): place for vertex, place in given}


def _in_mesh(vertex: int, mesh: PolygonMesh) -> int:
    """The number in a mesh of a vertex of its file."""
    if mesh.vertex_map is None or vertex >= len(mesh.vertex_map):
        return vertex
    number = int(mesh.vertex_map[vertex])
    if number < 0:
        raise CommandError(f"--handle: vertex {vertex} is one that no face uses, and was dropped by --repair")
    return number


def add_levels(parser: argparse.ArgumentParser) -> None:
    """The option to refine."""
    parser.add_argument("--levels", type=count, default=0, metavar="N", help="refine the result and improve it, so "
        "many times (default 0)")  # fmt: skip


def _vertex_target(vertex: str, *place: str) -> tuple[int, list[float]]:
    """A vertex number and where it is pulled to."""
    try:
        return count(vertex), [float(word) for word in place]
    except (argparse.ArgumentTypeError, ValueError):
        words = " ".join((vertex, *place))
        raise CommandError(f"--handle: expected a vertex number and three coordinates, got '{words}'") from None
