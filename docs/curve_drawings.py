"""Draws the pictures of curves and closest points: ``python docs/curve_drawings.py``, as ``docs/drawings.py`` does."""

from __future__ import annotations

import math

import numpy as np
from drawing_tools import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    LEFT,
    RED,
    mean_of,
    polar,
    ring_of,
    row,
    write_all,
)
from matplotlib.figure import Figure


def polylines() -> Figure:
    """How edges continue each other at a vertex."""
    square = (-1.3, 1.3, -1.2, 1.2)
    figure, (even, odd, border, corner) = row(
        ("even valence: opposite edges", square),
        ("odd valence: all end", square),
        ("boundary: joined along it", (-1.4, 1.4, -0.9, 1.5)),
        ("corner: all end", (-0.9, 1.7, -0.7, 1.7)),
    )
    for k, color in enumerate((RED, BLUE, GREEN)):
        even.line(polar(1.1, 60 * k + 10), polar(1.1, 60 * k + 190), color=color, width=2.6)
    for k in range(5):
        odd.line((0, 0), polar(1.1, 72 * k + 18), color=FAINT, width=2.2)
    for turn in (50, 95, 140):
        border.line((0, 0.0), polar(1.1, turn), color=FAINT, width=2.2)
    border.line((-1.3, 0), (1.3, 0), color=RED, width=2.6)
    corner.face((0, 0), (1.2, 0), (1.2, 1.2), (0, 1.2), edge=LEFT)
    for turn in (0, 90):
        corner.line((0, 0), polar(1.4, turn), color=FAINT, width=2.2)
    for panel in (even, odd, border, corner):
        panel.dot((0, 0), size=6)
    return figure


def boundary() -> Figure:
    """Pieces of a boundary loop, and the angle that decides where they end."""
    figure, (pieces, turning) = row(
        ("one loop, four corners, four pieces", (-2.1, 2.1, -1.5, 1.3)),
        (r"turning angle $\tau$", (-1.6, 1.9, -1.1, 1.5)),
    )
    low = [(x, -0.9 + 0.12 * math.sin(2 * x)) for x in np.linspace(-1.8, 1.8, 9)]
    high = [(x, 0.75 + 0.3 * math.cos(0.9 * x)) for x in np.linspace(1.8, -1.8, 9)]
    pieces.face(*low, *high, edge=LEFT)
    for piece, color in ((low, RED), ([low[-1], high[0]], GREEN), (high, BLUE), ([high[-1], low[0]], FAINT)):
        pieces.line(*piece, color=color, width=2.6)
        pieces.dot(*piece[1:-1], color=color)
    pieces.dot(low[0], low[-1], high[0], high[-1], size=8)
    pieces.arrow((-0.5, -1.3), (0.6, -1.3), color=RED)
    pieces.text((0, 0), "surface on the left", size=9)
    turning.line((0, 0), (1.5, 0.21), color=FAINT, style=":")
    turning.line((-1.4, -0.2), (0, 0), (0.8, 1.1), width=2.6)
    for start, end in (((-1.4, -0.2), (-0.6, -0.086)), ((0, 0), (0.5, 0.69))):
        turning.arrow(start, end, color=INK)
    turning.arc((0, 0), 0.85, 8, 54)
    turning.dot((0, 0), size=6)
    turning.text((1.0, 0.55), r"$\tau$", color=RED)
    return figure


def closest() -> Figure:
    """The closest point on a mesh, in section, and how a polygon is filled."""
    figure, (section, fan) = row(
        ("closest point, in section", (-2.0, 2.1, -0.9, 1.6)),
        ("a polygon as a fan around its mean $m$", (-1.7, 1.7, -1.2, 1.2)),
    )
    section.line((-1.8, -0.5), (-0.5, 0.1), (0.9, 0.0), (1.9, -0.7), width=2.6)
    point, foot = (0.3, 1.15), (0.221, 0.0485)
    section.line((-1.4, 0.164), (1.7, -0.057), color=BLUE, style=":")
    section.line(point, foot, color=RED, style="--")
    section.arrow(foot, (0.26, 0.6))
    section.dot(point, foot, color=RED, size=5)
    for at, word in (((0.3, 1.38), "query point"), ((0.2, -0.2), "position")):
        section.text(at, word, size=8)
    section.text((-0.2, 0.5), "normal", color=BLUE, size=8)
    section.text((0.78, 0.8), "distance", color=RED, size=8)
    ring = ring_of(1.1, 0, 1.0, 75, 1.05, 140, 1.0, 215, 1.0, 290)
    mean = mean_of(ring)
    fan.face(*ring)
    for corner in ring:
        fan.line(mean, corner, color=BLUE)
    fan.dot(mean, color=BLUE, size=5)
    fan.text((mean[0] + 0.3, mean[1] + 0.22), "$m$", color=BLUE)
    return figure


if __name__ == "__main__":
    write_all([polylines, boundary, closest])
