"""What several commands read: meshes, and vertices that are pulled somewhere."""

from __future__ import annotations

import argparse
import math
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
    return {number_in_mesh(vertex, mesh, "--handle"): place for vertex, place in given}


def number_in_mesh(vertex: int, mesh: PolygonMesh, option: str) -> int:
    """The number in a mesh of a vertex of its file, which an option names."""
    if mesh.vertex_map is None:
        return vertex  # the job refuses those that do not exist
    if vertex >= len(mesh.vertex_map):
        last = len(mesh.vertex_map) - 1
        raise CommandError(f"{option}: vertices of the file are numbered 0 to {last}, got {vertex}")
    number = int(mesh.vertex_map[vertex])
    if number < 0:
        raise CommandError(f"{option}: vertex {vertex} is one that no face uses, and was dropped by --repair")
    return number


def add_fixed(parser: argparse.ArgumentParser) -> None:
    """The option to keep vertices where they are."""
    parser.add_argument("--fix", nargs="+", action="append", default=[], metavar="WORD", help="vertices of INPUT that "
        "stay: numbers (counted from 0), 'near X Y Z' for the nearest one, or 'box X Y Z X Y Z' for all between two "
        "opposite corners; repeatable")  # fmt: skip


def read_fixed(arguments: argparse.Namespace, mesh: PolygonMesh) -> list[int]:
    """Which vertices of a mesh ``--fix`` keeps; only those of faces are found by position."""
    found: set[int] = set()
    for words in arguments.fix:
        found |= _fixed_vertices(words, mesh)
    return sorted(found)


def _fixed_vertices(words: list[str], mesh: PolygonMesh) -> set[int]:
    kind, *rest = words
    try:
        if kind not in ("near", "box"):
            return {number_in_mesh(count(word), mesh, "--fix") for word in words}
        numbers = [float(word) for word in rest]
        if len(numbers) != (3 if kind == "near" else 6) or not all(map(math.isfinite, numbers)):
            raise ValueError
    except (argparse.ArgumentTypeError, ValueError):
        expected = "vertex numbers, 'near X Y Z' or 'box X Y Z X Y Z'"
        raise CommandError(f"--fix: expected {expected}, got '{' '.join(words)}'") from None
    places, used = mesh.vertices.tolist(), (mesh.topology.valences > 0).tolist()
    if kind == "near":
        distances = [math.dist(place, numbers) if on else math.inf for place, on in zip(places, used, strict=True)]
        return {distances.index(min(distances))}
    sides = [sorted(pair) for pair in zip(numbers[:3], numbers[3:], strict=True)]
    inside = {
        number
        for number, (place, on) in enumerate(zip(places, used, strict=True))
        if on and all(low <= x <= high for x, (low, high) in zip(place, sides, strict=True))
    }
    if not inside:
        raise CommandError(f"--fix box: no vertex of the mesh is between {numbers[:3]} and {numbers[3:]}")
    return inside


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
