"""Draws the figures of the pages on edges, faces and curvature.

``python docs/drawings.py`` writes docs/images/*.svg, the same bytes every time; with a folder as argument PNG files
there instead, to look at.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable

import numpy as np
from drawing_tools import (
    BLUE,
    FAINT,
    GREEN,
    INK,
    RED,
    RIGHT,
    SPOT,
    Panel,
    mean_of,
    polar,
    ring_of,
    row,
    write_all,
)
from matplotlib.figure import Figure

# ---- edges ---------------------------------------------------------------------------------------------


def edge() -> Figure:
    """The two faces of an edge, the sign of its dihedral angle, and what it is in the Gauss image."""
    side = (-1.5, 1.5, -1.25, 1.45)
    figure, (above, convex, concave, gauss) = row(
        ("the edge $e=(v,w)$ from above", (-1.6, 1.6, -1.35, 1.35)),
        (r"convex, $\alpha>0$, seen along $e$", side),
        (r"concave, $\alpha<0$, seen along $e$", side),
        ("the Gauss image", (-1.3, 1.3, -1.0, 1.5)),
    )
    v, w, a, b = (0.0, -1.0), (0.0, 1.0), (-1.2, 0.1), (1.2, -0.1)
    above.face(v, w, a)
    above.face(w, v, b, color=RIGHT)
    above.line(v, w, color=RED, width=2)
    above.arrow(v, (0.0, 0.62), color=RED)
    for at, word in (((0, -1.22), "$v$"), ((0, 1.2), "$w$"), ((-1.4, 0.1), "$a$"), ((1.4, -0.1), "$b$")):
        above.text(at, word)
    above.text((-0.45, 0.02), "$f$\nleft", size=9)
    above.text((0.5, 0.0), "$f'$\nright", size=9)
    _section(convex, -0.45)
    _section(concave, 0.45)
    gauss.arc((0, 0), 1.0, 15, 165, color=FAINT)
    left, right = polar(1.0, 122), polar(1.0, 58)
    gauss.arc((0, 0), 1.0, 58, 122)
    gauss.line(left, right, color=GREEN, width=2)
    for end, turn, word in ((left, 127, "$n$"), (right, 53, "$n'$")):
        gauss.arrow((0, 0), end)
        gauss.text(polar(1.2, turn), word, color=BLUE)
    gauss.text((0, 1.22), r"$|\alpha|$", color=RED)
    gauss.text((0, 0.64), r"$\ell^*$", color=GREEN)
    return figure


def _section(panel: Panel, end: float) -> None:
    panel.line((-1.3, end), (0, 0), (1.3, end), width=2.6)
    panel.dot((0, 0), color=RED, size=6)
    slope = math.degrees(math.atan2(-end, 1.3))
    for side, normal, face in ((-1, "$n$", "$f$"), (1, "$n'$", "$f'$")):
        foot = (0.75 * side, 0.75 / 1.3 * end)
        panel.arrow(foot, polar(0.85, 90 - side * slope, foot))
        panel.text(polar(1.05, 90 - side * slope, foot), normal, color=BLUE)
        panel.text((1.05 * side, end - 0.28), face)


def meaning() -> Figure:
    """The area that an edge stands for, and the kink of its term where it is flat."""
    figure, (area, kink, opening) = row(
        (r"an edge stands for the area $\ell\,|\delta x|$", (-1.7, 1.7, -1.2, 1.2)),
        ("its term while a flat edge bends", (-2.0, 2.1, -0.6, 1.6)),
        (r"velocities $\dot v$ that bend it", (-1.4, 1.4, -1.2, 1.0)),
    )
    area.face((-1.5, -1), (0, -0.8), (0, 0.8), (-1.5, 1.0))
    area.face((0, -0.8), (1.5, -1), (1.5, 1.0), (0, 0.8), color=RIGHT)
    area.face((-0.75, 0), (0, -0.8), (0.75, 0), (0, 0.8), color=SPOT, edge=RED, width=0.8)
    area.line((0, -0.8), (0, 0.8), color=RED, width=2)
    area.arrow((-0.75, 0), (0.75, 0), color=INK)
    area.dot((-0.75, 0), (0.75, 0))
    area.text((0.14, 0.42), r"$\ell$", color=RED)
    for at, word in (((-1.0, 0), "$c_f$"), ((1.05, 0), "$c_{f'}$"), ((0.3, -0.18), r"$\delta x$")):
        area.text(at, word)
    kink.arrow((-1.9, 0), (1.95, 0), color=FAINT, style="->")
    kink.text((1.85, -0.25), "time", color=FAINT, size=8)
    kink.line((-1.6, 1.28), (0, 0), (1.6, 1.28), color=RED, width=2.2)
    kink.dot((0, 0))
    kink.text((0, 1.1), r"$\ell\,\ell^*$", color=RED)
    kink.text((0, -0.35), "subgradient 0", size=8)
    kink.text((1.45, 0.55), "one-sided\nderivative", color=RED, size=8)
    opening.line((-1.2, 0), (1.2, 0), color=FAINT, style="--")
    opening.line((-1.2, -0.5), (0, 0), (1.2, -0.5), width=2.6)
    for side in (-1, 1):
        foot = (0.65 * side, -0.27)
        opening.arrow(foot, polar(0.75, 90 - side * 22.6, foot))
        opening.arrow((1.2 * side, 0.0), (1.2 * side, -0.48), color=GREEN)
        opening.text((1.2 * side, -0.75), r"$\dot v$", color=GREEN)
    opening.dot((0, 0), color=RED, size=6)
    return figure


# ---- faces and vertices --------------------------------------------------------------------------------


def faces() -> Figure:
    """Area vector, corner angle, planarity, and a face without area."""
    figure, (vector, warped, needle) = row(
        (r"area vector $A_f$, corner angle $\beta$", (-1.6, 1.7, -1.25, 1.55)),
        ("planarity: distance $d$ of the diagonals", (-1.7, 1.7, -1.0, 1.3)),
        ("a face without area (red): no normal", (-1.7, 1.7, -1.2, 1.25)),
    )
    corners = [(-1.2, -0.5), (0.3, -0.9), (1.3, 0.0), (0.4, 0.7), (-0.9, 0.55)]
    vector.face(*corners)
    for number, (x, y) in enumerate(corners):
        vector.text((1.17 * x + 0.02, 1.22 * y), f"$v_{number}$", size=9)
    vector.arrow((0, 0), (0.12, 1.4))
    vector.text((0.45, 1.38), "$A_f$", color=BLUE)
    vector.arc(corners[1], 0.42, 42, 165)
    vector.text((0.22, -0.3), r"$\beta$", color=RED)
    quad = [(-1.35, -0.5), (0.9, -0.6), (1.35, 0.5), (-0.9, 0.95)]
    warped.face(*quad)
    warped.line(quad[0], quad[2], color=BLUE, width=1.8)
    warped.line(quad[1], quad[3], color=GREEN, width=1.8)
    warped.line((0, 0), (0, 0.175), color=RED, width=2.4)
    warped.text((0.16, 0.24), "$d$", color=RED)
    for number, (x, y) in enumerate(quad):
        warped.text((1.14 * x, 1.3 * y), f"$p_{number}$", size=9)
    needle.face((-1.4, 0.07), (1.4, 0.07), (0, 1.1))
    needle.face((-1.4, -0.07), (1.4, -0.07), (0, -1.05), color=RIGHT)
    needle.line((-1.4, 0.0), (1.4, 0.0), color=RED, width=2.6)
    needle.dot((-1.4, 0), (0.2, 0), (1.4, 0), color=RED)
    for foot, word in (((-0.1, 0.3), "$n$"), ((-0.1, -0.75), "$n'$")):
        needle.arrow(foot, (foot[0] + 0.25, foot[1] + 0.5))
        needle.text((foot[0] - 0.2, foot[1] + 0.25), word, color=BLUE)
    return figure


def defects() -> Figure:
    """Stars unfolded into the plane."""
    square = (-1.3, 1.4, -1.2, 1.2)
    figure, (cone, saddle, border) = row(
        (r"cone: $\delta=2\pi-\sum\beta>0$", square),
        (r"saddle: $\delta<0$", square),
        (r"boundary: it turns by $\delta=\pi-\sum\beta$", (-1.5, 1.5, -0.9, 1.5)),
    )
    cone.fan(30, 85, 145, 205, 265, 330)
    cone.arc((0, 0), 0.62, -30, 30)
    cone.text((0.82, 0), r"$\delta$", color=RED)
    saddle.fan(-15, 55, 120, 190, 250, 315)
    saddle.face((0, 0), polar(1, -45), polar(1, 25), color=SPOT + "b0", edge=RED)
    saddle.dot((0, 0))
    saddle.arc((0, 0), 0.66, -15, 25)
    saddle.text((1.12, 0.09), r"$|\delta|$", color=RED)
    border.fan(0, 50, 95, 140)
    border.line((-1.3, 0), (0, 0), color=FAINT, style=":")
    border.line(polar(1, 140), (0, 0), (1, 0), width=2.8)
    border.arc((0, 0), 0.6, 140, 180)
    border.text((-0.82, 0.28), r"$\delta$", color=RED)
    return figure


def stencils() -> Figure:
    """Mean curvature, umbrella vector, second difference and the shape operator of a tube."""
    figure, (cotangents, umbrella, lag, tube) = row(
        ("angles of the cotangent formula", (-1.35, 1.35, -1.3, 1.3)),
        ("umbrella vector $u_v$", (-1.3, 1.4, -1.2, 1.3)),
        ("second difference $d$", (-1.6, 1.6, -1.2, 1.2)),
        ("shape operator $W'$ of a tube", (-1.7, 1.9, -1.1, 1.3)),
    )
    v, w, top, low = (-1.0, 0.0), (1.0, 0.1), (-0.1, 1.1), (0.15, -1.1)
    cotangents.face(v, w, top)
    cotangents.face(v, low, w, color=RIGHT)
    cotangents.line(v, w, color=RED, width=2)
    cotangents.arc(top, 0.35, 231, 318, color=INK)
    cotangents.arc(low, 0.35, 54, 137, color=INK)
    for at, word in (((-1.2, 0), "v"), ((1.22, 0.1), "w"), ((-0.08, 0.52), r"\beta"), ((0.1, -0.55), r"\beta'")):
        cotangents.text(at, f"${word}$")
    ring, here = ring_of(1.1, 10, 0.9, 70, 1.0, 130, 0.85, 190, 0.95, 245, 1.1, 305), (-0.35, 0.28)
    mean = mean_of(ring)
    umbrella.face(*ring, width=0.8)
    for neighbour in ring:
        umbrella.line(here, neighbour, width=1.0)
    umbrella.arrow(here, mean, color=RED)
    umbrella.dot(here)
    umbrella.dot(mean, color=RED)
    umbrella.text((-0.58, 0.32), "$v$")
    umbrella.text((0.32, -0.08), "$u_v$", color=RED)
    left, here, right = (-1.3, -0.5), (-0.1, 0.6), (1.3, -0.3)
    lag.line(left, right, color=FAINT, style=":")
    lag.line(left, here, right, width=2)
    lag.arrow(here, (0.0, -0.4), color=RED)
    lag.dot(left, here, right)
    lag.text((0.35, -0.08), "$d/2$", color=RED)
    for at, word in (((-1.25, -0.78), "previous"), ((-0.1, 0.85), "vertex"), ((1.25, -0.6), "next")):
        lag.text(at, word, size=8)
    _tube(tube)
    return figure


def _tube(panel: Panel) -> None:
    arc = [(1.25 * math.sin(0.5 * k), 0.7 * math.cos(0.5 * k) - 0.4) for k in (-2, -1, 0, 1, 2)]
    low, high = [(x - 0.25, y - 0.45) for x, y in arc], [(x + 0.35, y + 0.55) for x, y in arc]
    for k in range(4):
        panel.face(low[k], low[k + 1], high[k + 1], high[k])
    panel.arrow((0.05, 0.35), (0.35, 0.83), color=RED)
    panel.arrow((0.05, 0.35), (0.75, 0.24), color=GREEN)
    panel.text((0.1, 1.1), "eigenvector of $W'$", color=RED, size=8)
    panel.text((1.5, -0.35), "direction of\nbending", color=GREEN, size=8)


def curvature() -> Figure:
    """Two ways to see curvature, balanced normals, and an incomplete star."""
    side = (-2.0, 2.0, -0.8, 1.5)
    figure, (jumps, change, balanced, border) = row(
        ("normal cycle: face normals jump", side),
        ("corrected: vertex normals change", side),
        (r"balanced: $(u_v+u_w)\cdot(w-v)=0$", side),
        ("a star on the boundary lacks a half", (-1.5, 1.5, -1.2, 1.2)),
    )
    profile = [polar(1.9, turn, (0.0, -1.6)) for turn in (128, 104, 76, 52)]
    for panel in (jumps, change):
        panel.line(*profile, width=2.6)
        panel.dot(*profile)
    for start, stop in itertools.pairwise(profile):
        middle = mean_of([start, stop])
        turn = math.degrees(math.atan2(middle[1] + 1.6, middle[0]))
        jumps.arrow(middle, polar(0.75, turn, middle))
    for turn, point in zip((128, 104, 76, 52), profile, strict=True):
        change.arrow(point, polar(0.75, turn, point), color=RED)
    v, w = (-0.9, -0.1), (0.9, -0.1)
    balanced.line(*(polar(1.5, turn, (0.0, -1.3)) for turn in np.linspace(127, 53, 40)), color=FAINT, style=":")
    balanced.line(v, w, width=2.6)
    balanced.dot(v, w)
    for point, turn, word, at in ((v, 127, "v", (-1.15, -0.3)), (w, 53, "w", (1.15, -0.3))):
        balanced.arrow(point, polar(0.8, turn, point), color=RED)
        balanced.text(at, f"${word}$")
        balanced.text(polar(1.0, turn, point), f"$u_{word}$", color=RED)
    balanced.arc(v, 0.4, 0, 127, color=INK)
    balanced.arc(w, 0.4, 53, 180, color=INK)
    ring = ring_of(1.1, 0, 1.1, 60, 1.1, 120, 1.1, 180)
    for start, stop in itertools.pairwise(ring):
        border.face((0, 0), start, stop)
    border.line(ring[0], (0, 0), ring[-1], color=FAINT, width=2.6)
    for end in ring[1:3]:
        border.line((0, 0), end, color=RED, width=2.6)
    border.dot((0, 0), size=6)
    for end in (ring[0], ring[-1]):
        border.line(end, polar(1.1, 300 if end[0] > 0 else 240), color=FAINT, style=":")
    border.text((0, -0.5), "no faces,\nno angles", color=FAINT, size=8)
    return figure


DRAWINGS: list[Callable[[], Figure]] = [
    edge,
    meaning,
    faces,
    defects,
    stencils,
    curvature,
]


if __name__ == "__main__":
    write_all(DRAWINGS)
