"""What is up in pictures, from where one looks, and whether vertices have their numbers beside them."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ..io import PolygonMesh
    from ..viewing import ViewDirection

_Y_UP = (".glb", ".gltf")  # by their definition; other formats do not say
LABELS = "labels.png"


def add_views(parser: argparse.ArgumentParser, *, label: bool = True, view: str = "from where") -> None:
    """The options of pictures; ``view`` says what ``--view`` changes."""
    add = parser.add_argument
    add("--up", choices=("x", "y", "z"), help="what is up in pictures (default: y of GLB and glTF files, else the axis "
        "nearest to the average normal, or z)")  # fmt: skip
    add("--view", type=_view, metavar="VIEW", help=f"{view}: front, top, iso, or AZ,EL in degrees (azimuth from the "
        "front, anticlockwise from above; elevation); default: the usual ones")  # fmt: skip
    if label:
        add("--label", action="store_true", help=f"also write {LABELS}: the mesh with numbers of vertices as in the "
            "file, of all if they are few, else of the worst places")  # fmt: skip


def _view(text: str) -> tuple[float, float]:
    from ..viewing.chosen_view import parse_view

    try:
        return parse_view(text)
    except ValueError as error:
        raise argparse.ArgumentTypeError(str(error)) from None


def view_of(arguments: argparse.Namespace, mesh: PolygonMesh) -> ViewDirection | None:
    """The view that is asked for; None for the usual one."""
    up, angles, file = arguments.up, arguments.view, getattr(arguments, "input", None)
    if up is None and file is not None and Path(file).suffix.lower() in _Y_UP:
        up = "y"
    if up is None and angles is None:
        return None
    from ..viewing.chosen_view import chosen_view

    return chosen_view(mesh.vertices, mesh.topology, up, angles)
