"""How mesh files are read: options to weld and repair, what is said of a mesh, errors in the numbers of its file."""

from __future__ import annotations

import argparse
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any, TypeVar

from .._reading_words import UNREAD, cells_of, distance_of
from ..errors import MeshError

if TYPE_CHECKING:
    from ..io import PolygonMesh

WELD = "--weld"
_DEFAULT = "auto"
T = TypeVar("T")


def add_repair(parser: argparse.ArgumentParser) -> None:
    """The options to weld and repair what is read, and to sample surfaces."""
    add = parser.add_argument
    add("--repair", action="store_true", help="first drop repeated corners, double faces, faces without area and "
        "unused vertices, join T-junctions, split vertices that fans share, and orient faces consistently")  # fmt: skip
    add(WELD, nargs="?", type=_tolerance, const=True, default=False, metavar="TOLERANCE", help="make edges of the "
        "boundary at the same place one edge; TOLERANCE is a distance (default: 1e-6 of the extent, or rounding to "
        "single precision)")  # fmt: skip
    add("--split-edges", action="store_true", help="repair, and split edges of more than two faces into pairs of faces")
    words = "sample surfaces of 3DM files, too, by grids of N by M cells (default of M: N)"
    add("--surfaces", type=_cells, metavar="N[,M]", help=words)


def read_options(arguments: argparse.Namespace) -> dict[str, Any]:
    """What :func:`add_repair` has added, as arguments of :func:`~torchfair.io.load_mesh`."""
    return {name: getattr(arguments, name, default) for name, default in UNREAD.items()}


def _tolerance(text: str) -> float | bool:
    """A distance; the word auto for the default."""
    return True if text == _DEFAULT else _refused(distance_of, text)


def _cells(text: str) -> int | tuple[int, int]:
    return _refused(cells_of, text)


def _refused(of: Callable[[str], T], text: str) -> T:
    """What a text says; argparse would hide why it is refused."""
    try:
        return of(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def with_default_tolerance(words: Sequence[str]) -> list[str]:
    """Arguments in which ``--weld`` without a number has its default, so that it takes no file name for one."""
    result = []
    for word, following in zip(words, [*words, ""][1:], strict=True):
        result.append(f"{WELD}={_DEFAULT}" if word == WELD and not _is_number(following) else word)
    return result


def _is_number(word: str) -> bool:
    try:
        float(word)
    except ValueError:
        return word == _DEFAULT
    return True


def said_of(mesh: PolygonMesh, name: str | None = None) -> list[str]:
    """What is said of a mesh that was read, line by line; with the name of a file where it is not INPUT."""
    of = "" if name is None else f"{name}: "
    return [*(f"{of}repaired: {sentence}" for sentence in mesh.repairs), *(f"{of}note: {note}" for note in mesh.notes)]


def read_report(mesh: PolygonMesh) -> dict[str, Any]:
    """The same for a report, with where vertices of the file have gone."""
    return {"repairs": mesh.repairs, "input_notes": mesh.notes, "vertex_map": mesh.vertex_map}


@contextmanager
def in_numbers_of(mesh: PolygonMesh, file: str | None) -> Iterator[None]:
    """Errors name vertices and faces as the file of the mesh does, and the file, if there is one."""
    from .._names import PlacedError

    try:
        yield
    except PlacedError as error:
        told = error.sentence.told(mesh.names)
        raise MeshError(told if file is None else f"{file}: {told}") from None
