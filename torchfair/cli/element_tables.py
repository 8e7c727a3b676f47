"""Tables of single panels and edges as CSV files: ``--panels`` and ``--edges``."""

from __future__ import annotations

import argparse
import csv
import io
from collections.abc import Callable, Iterable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .errors import CommandError

if TYPE_CHECKING:
    from torch import Tensor

    from .._names import Names
    from ..topology import Topology

_PANELS = ("corners", "x", "y", "z", "area", "planarity", "longest_edge", "largest_kink_degrees", "class")
_EDGES = ("x", "y", "z", "length", "dihedral_angle_degrees", "angle_variation", "class")


def add_tables(parser: argparse.ArgumentParser, of: str) -> None:
    """The options for both."""
    add = parser.add_argument
    add("--panels", metavar="FILE.csv", help=f"table of the panels of {of}, a row for each: number, centre, area, "
        "planarity, longest edge, largest kink, class")  # fmt: skip
    add("--edges", metavar="FILE.csv", help=f"table of the edges of {of}: ends, middle, length, angle, l |a|, class")


def tables_of(arguments: argparse.Namespace) -> dict[Path, Callable[[Tensor, Topology, Names], str]]:
    """Texts of the tables that are asked for, by their paths."""
    asked = ((arguments.panels, panel_table), (arguments.edges, edge_table))
    return {Path(file): text for file, text in asked if file is not None}


def refuse_one_table(arguments: argparse.Namespace) -> None:
    """Refuses one file for the tables of several inputs."""
    for option in ("panels", "edges"):
        if getattr(arguments, option, None) is not None:
            raise CommandError(f"--{option} names one file: give one input, or leave it out for several")


def table_writers(arguments: argparse.Namespace) -> dict[Path, Callable[[Path, Any, Any, bool], object]]:
    """Writers of the tables of a result, whose file is OUTPUT."""
    return {path: partial(_write, text, arguments.output) for path, text in tables_of(arguments).items()}


def _write(
    text: Callable[[Tensor, Topology, Names], str], mesh: str, path: Path, request: Any, result: Any, overwrite: bool
) -> None:
    from .._names import Names
    from ..io import numbers_from

    write_table(path, text(result.vertices, result.topology, Names(numbers_from(mesh))), overwrite=overwrite)


def write_table(path: Path, text: str, *, overwrite: bool) -> None:
    """Writes a table, whole or not at all."""
    from ..io import atomic_write_text

    path.parent.mkdir(parents=True, exist_ok=True)
    atomic_write_text(path, text, overwrite=overwrite)


def panel_table(vertices: Tensor, topology: Topology, names: Names) -> str:
    """One row for each face."""
    from ..measuring import panel_measures

    rows = (
        (
            _number(names.face(row.face)),
            len(row.vertices),
            *row.position,
            *_picked(asdict(row), _PANELS[4:-1]),
            row.kind,
        )
        for row in panel_measures(vertices, topology)
    )
    return _csv(("panel", *_PANELS), rows)


def edge_table(vertices: Tensor, topology: Topology, names: Names) -> str:
    """One row for each edge, interior ones first."""
    from ..measuring import edge_measures

    rows = (
        (*map(names.vertex, row.vertices), *row.position, *_picked(asdict(row), _EDGES[3:-1]), row.kind)
        for row in edge_measures(vertices, topology)
    )
    return _csv(("from", "to", *_EDGES), rows)


def _number(name: str) -> str:
    return name.partition(" ")[0]  # without the line of the file


def _picked(row: dict[str, Any], names: Iterable[str]) -> list[Any]:
    return ["" if row[name] is None else row[name] for name in names]


def _csv(heading: Iterable[str], rows: Iterable[Iterable[Any]]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(heading)
    writer.writerows(rows)
    return text.getvalue()
