"""A pen for the drawings of the pages: rows of panels, each with its own coordinates and a caption below."""

from __future__ import annotations

import itertools
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

IMAGES = Path(__file__).resolve().parent / "images"

Point = tuple[float, float]

INK, FAINT = "#1b2230", "#8a92a0"
RED, BLUE, GREEN = "#c0392b", "#1f5fa8", "#2e7d4f"
LEFT, RIGHT, SPOT = "#e3eaf3", "#f4e7d3", "#f6d5d0"  # fills


class Panel:
    """One drawing of a row."""

    def __init__(self, axes: Axes) -> None:
        self.axes = axes

    def line(self, *points: Point, color: str = INK, width: float = 1.3, style: str = "-") -> None:
        x, y = zip(*points, strict=True)
        self.axes.plot(x, y, style, color=color, linewidth=width)

    def face(self, *points: Point, color: str = LEFT, edge: str = INK, width: float = 1.3) -> None:
        x, y = zip(*points, strict=True)
        self.axes.fill(x, y, facecolor=color, edgecolor=edge, linewidth=width, joinstyle="round")

    def dot(self, *points: Point, color: str = INK, size: float = 4.0) -> None:
        for x, y in points:
            self.axes.plot(x, y, "o", color=color, markersize=size, zorder=5)

    def text(self, at: Point, words: str, color: str = INK, size: float = 10.0) -> None:
        self.axes.text(*at, words, color=color, fontsize=size, ha="center", va="center", zorder=6)

    def arrow(self, start: Point, end: Point, color: str = BLUE, style: str = "-|>") -> None:
        look = {"arrowstyle": style, "color": color, "linewidth": 1.5, "shrinkA": 0, "shrinkB": 0}
        self.axes.annotate("", end, start, arrowprops=look)

    def arc(self, centre: Point, radius: float, start: float, stop: float, color: str = RED) -> None:
        """A circular arc between two directions in degrees."""
        self.line(*(polar(radius, turn, centre) for turn in np.linspace(start, stop, 60)), color=color, width=1.5)

    def fan(self, *turns: float) -> None:
        """Triangles around the origin between directions in degrees."""
        for start, stop in itertools.pairwise(turns):
            self.face((0, 0), polar(1, start), polar(1, stop))
        self.dot((0, 0))


def polar(radius: float, degrees: float, centre: Point = (0.0, 0.0)) -> Point:
    """The point at a distance and in a direction from ``centre``."""
    return (centre[0] + radius * math.cos(math.radians(degrees)), centre[1] + radius * math.sin(math.radians(degrees)))


def ring_of(*sizes_and_turns: float) -> list[Point]:
    """Points around the origin from their distances and directions in turn."""
    return [polar(size, turn) for size, turn in zip(sizes_and_turns[::2], sizes_and_turns[1::2], strict=True)]


def mean_of(points: list[Point]) -> Point:
    """Their centroid."""
    x, y = np.mean(points, axis=0).tolist()
    return x, y


def row(*parts: tuple[str, tuple[float, float, float, float]], inch: float = 0.62) -> tuple[Figure, list[Panel]]:
    """A row of panels from captions and extents (left, right, bottom, top); a unit is ``inch`` inches everywhere."""
    gap, caption = 0.25, 0.34
    widths = [inch * (right - left) for _, (left, right, _, _) in parts]
    height = inch * max(top - bottom for _, (_, _, bottom, top) in parts)
    page = (sum(widths) + gap * (len(parts) - 1), height + caption)
    figure, start, panels = Figure(figsize=page, facecolor="white"), 0.0, []
    for width, (words, extent) in zip(widths, parts, strict=True):
        axes = figure.add_axes((start / page[0], caption / page[1], width / page[0], height / page[1]))
        axes.set(xlim=extent[:2], ylim=extent[2:], aspect="equal")
        axes.axis("off")
        figure.text((start + width / 2) / page[0], 0.12 / page[1], words, ha="center", fontsize=8.5, color=INK)
        panels.append(Panel(axes))
        start += width + gap
    return figure, panels


def write_all(drawings: Sequence[Callable[[], Figure]]) -> None:
    """Writes drawings by their names beside the pages, or as PNG into the folder named on the command line."""
    for draw in drawings:
        path = Path(sys.argv[1], draw.__name__ + ".png") if len(sys.argv) > 1 else IMAGES / f"{draw.__name__}.svg"
        save(draw(), path)


def save(figure: Figure, path: Path) -> None:
    """Writes SVG with the same bytes every time, or PNG."""
    with mpl.rc_context({"svg.hashsalt": "torchfair", "svg.fonttype": "path", "mathtext.fontset": "cm"}):
        metadata = {"Date": None, "Creator": None} if path.suffix == ".svg" else {"Software": None}
        figure.savefig(path, metadata=metadata, dpi=110, bbox_inches="tight", pad_inches=0.06)
