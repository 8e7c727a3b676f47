"""How a command tells what came of several inputs."""

from __future__ import annotations

import argparse
import csv
import json
import sys
from collections.abc import Mapping, Sequence
from typing import Any


class Plain:
    """Each prints what it prints alone."""

    keeps_json = False

    def tell(self, arguments: argparse.Namespace, printed: str) -> None:
        """It is printed already."""

    def end(self) -> None:
        """Nothing more."""


class JsonLines:
    """One JSON object a line."""

    keeps_json = True

    def tell(self, arguments: argparse.Namespace, printed: str) -> None:
        """Prints the object of one input in a line."""
        print(json.dumps(json.loads(printed), sort_keys=True), flush=True)

    def end(self) -> None:
        """Nothing more."""


class Rows:
    """One row for each input, as a table or as CSV.

    Args:
        columns: Headings by key of the JSON object.
        as_csv: Whether to print CSV, with the keys as headings.
    """

    keeps_json = True

    def __init__(self, columns: Mapping[str, str], *, as_csv: bool) -> None:
        self._columns, self._as_csv = columns, as_csv
        self._rows: list[Mapping[str, Any]] = []

    def tell(self, arguments: argparse.Namespace, printed: str) -> None:
        """Takes note of one input; says on stderr what is to be known of it."""
        row = json.loads(printed)
        self._rows.append(row)
        for words in ("repairs", "notes", "curvature_doubts"):
            for line in row.get(words, ()):
                print(f"{arguments.input}: {line}", file=sys.stderr)

    def end(self) -> None:
        """Prints all."""
        if self._as_csv:
            writer = csv.writer(sys.stdout, lineterminator="\n")
            writer.writerow(["file", *self._columns])
            writer.writerows([row["file"], *(row.get(key) for key in self._columns)] for row in self._rows)
        elif self._rows:
            heads = ["", *self._columns.values()]
            cells = [[row["file"], *(_number(row.get(key)) for key in self._columns)] for row in self._rows]
            print("\n".join(_aligned([heads, *cells])))


def json_or_plain(arguments: argparse.Namespace) -> JsonLines | Plain:
    """JSON lines where JSON is asked for."""
    return JsonLines() if getattr(arguments, "json", False) else Plain()


def _number(value: float | int | None) -> str:
    if value is None:
        return "-"
    return str(value) if isinstance(value, int) else f"{value:.5g}"


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Cells as lines of text: the first column to the left, others to the right."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            [row[0].ljust(widths[0]), *(cell.rjust(width) for cell, width in zip(row[1:], widths[1:], strict=True))]
        )
        for row in rows
    ]
