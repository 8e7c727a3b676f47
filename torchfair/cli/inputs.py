"""What several commands read: meshes, and vertices that are pulled somewhere."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ..progress import phase
from .arguments import count
from .chosen_vertices import NUMBERS, ChosenVertices
from .errors import CommandError
from .reading import add_repair as add_repair
from .reading import read_options, said_of

if TYPE_CHECKING:
    from torch import Tensor

    from ..io import PolygonMesh
    from ..topology import Topology


_SURE = 1e-9  # of the sum of the sizes of its parts, that a volume differs from zero


def read_input(name: str, arguments: argparse.Namespace | None = None) -> PolygonMesh:
    """A mesh file, read with the options of :func:`add_repair`; or a built-in example ``example:NAME``."""
    from ..io import PolygonMesh, load_mesh

    if not name.startswith("example:"):
        with phase(f"reading {Path(name).name}"):
            mesh = load_mesh(name, **({} if arguments is None else read_options(arguments)))
        return replace(mesh, notes=(*mesh.notes, *_inside_out(mesh)))
    from ..shapes import builtin_mesh

    return PolygonMesh(*builtin_mesh(name.removeprefix("example:")))


def _inside_out(mesh: PolygonMesh) -> list[str]:
    """Says so where a closed mesh has its faces turned inwards."""
    from ..geometry import face_area_vectors, face_centres

    topology = mesh.topology
    if topology.num_edges > topology.num_interior_edges:
        return []
    vertices = mesh.vertices - mesh.vertices.mean(0)
    volumes = (face_area_vectors(vertices, topology) * face_centres(vertices, topology)).sum(1) / 3.0
    if float(volumes.sum()) >= -_SURE * float(volumes.abs().sum()):
        return []
    return ["the mesh is inside out: its faces are turned inwards, so that convex edges count as concave"]


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
    parser.add_argument("--handle", action="append", default=[], metavar="VERTEX X Y Z", help="pull a vertex of INPUT "
        f"to a place: its number ({NUMBERS}), or the place where it is, as in --handle near X Y Z to X Y Z; "
        "repeatable")  # fmt: skip


def read_handles(arguments: argparse.Namespace, chosen: ChosenVertices) -> dict[int, list[float]]:
    """Where ``--handle`` pulls vertices of a mesh."""
    found: dict[int, list[float]] = {}
    for words in arguments.handle:
        vertex, place = chosen.handle("--handle", words)
        if vertex in found:
            names = chosen.names_of(vertex)
            raise CommandError(f"--handle: {names} pulled to two places: leave one out")
        found[vertex] = place
    return found


def add_fixed(parser: argparse.ArgumentParser) -> None:
    """The option to keep vertices where they are."""
    parser.add_argument("--fix", action="append", default=[], metavar="VERTEX ...", help=f"vertices of INPUT that "
        f"stay: {NUMBERS}, 'near X Y Z' for the one there, or 'box X Y Z X Y Z' for all between two opposite corners; "
        "several, and repeatable")  # fmt: skip


def read_fixed(arguments: argparse.Namespace, chosen: ChosenVertices) -> list[int]:
    """Which vertices of a mesh ``--fix`` keeps; only those of faces are found by position."""
    return sorted({vertex for words in arguments.fix for vertex in chosen.of("--fix", words)})


def add_levels(parser: argparse.ArgumentParser) -> None:
    """The option to refine."""
    parser.add_argument("--levels", type=count, default=0, metavar="N", help="refine the result and improve it, so "
        "many times (default 0)")  # fmt: skip
