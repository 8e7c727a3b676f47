"""What several commands read: meshes, and vertices that are pulled somewhere."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING

from .arguments import count
from .errors import CommandError

if TYPE_CHECKING:
    from torch import Tensor

    from ..io import PolygonMesh
    from ..topology import Topology


def read_input(name: str, repair: bool = False) -> PolygonMesh:
    """A mesh file, or a built-in example ``example:NAME``."""
    from ..io import PolygonMesh, load_mesh

    if not name.startswith("example:"):
        return load_mesh(name, repair=repair)
    from ..shapes import EXAMPLES, builtin_mesh

    example = name.removeprefix("example:")
    if example not in EXAMPLES:
        raise CommandError(f"there is no example '{example}': choose {', '.join(sorted(EXAMPLES))}")
    return PolygonMesh(*builtin_mesh(example))


def add_repair(parser: argparse.ArgumentParser) -> None:
    """The option to repair what is read."""
    parser.add_argument(
        "--repair", action="store_true", help="orient faces consistently and drop unused vertices first"
    )


def add_reference(parser: argparse.ArgumentParser, words: str) -> None:
    """The option of a surface to stay close to."""
    parser.add_argument("--reference", metavar="FILE", help=words)


def read_reference(arguments: argparse.Namespace) -> tuple[Tensor, Topology] | None:
    """The surface of ``--reference``."""
    if arguments.reference is None:
        return None
    mesh = read_input(arguments.reference, getattr(arguments, "repair", False))
    return mesh.vertices, mesh.topology


def add_handles(parser: argparse.ArgumentParser) -> None:
    """The option to pull vertices."""
    parser.add_argument("--handle", nargs=4, action="append", default=[], metavar=("VERTEX", "X", "Y", "Z"),
        help="pull a vertex of INPUT (counted from 0) to a place; repeatable")  # fmt: skip


def read_handles(arguments: argparse.Namespace) -> dict[int, list[float]]:
    """Where ``--handle`` pulls vertices."""
    return dict(_vertex_target(*words) for words in arguments.handle)


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
