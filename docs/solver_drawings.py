"""Draws the pictures of the pages on constraints and on the solver: ``python docs/solver_drawings.py``.

They are constraints.svg, reweighting.svg and inequality.svg in docs/images; with a folder as argument PNG files go
there.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from drawing_tools import BLUE, FAINT, GREEN, INK, RED, mean_of, polar, ring_of, row, write_all
from matplotlib.figure import Figure


def constraints() -> Figure:
    """Residuals of four constraints, each on one element."""
    figure, (planar, near, gliding, sphere) = row(
        ("planarity: distance of the diagonals", (-1.6, 1.6, -1.2, 1.3)),
        ("closeness: distance from the plane", (-1.7, 1.7, -1.2, 1.3)),
        ("gliding: off the tangent of the curve", (-1.7, 1.7, -1.2, 1.3)),
        ("cospherical: off the sphere", (-1.4, 1.4, -1.2, 1.3)),
    )
    a, b, c, d = (-1.3, -0.7), (0.9, -0.9), (1.3, 0.55), (-0.7, 0.9)
    planar.face(a, b, c, d)
    planar.line(a, c, color=BLUE)
    planar.line(b, d, color=GREEN)
    planar.line((0.02, 0.06), (0.17, 0.36), color=RED, width=2.6)
    planar.text((0.42, 0.2), "$r$", color=RED)
    x = np.linspace(-1.6, 1.6, 40)
    near.line(*zip(x, 0.1 - 0.25 * x**2, strict=True), width=2.6)
    foot, point = (0.5, 0.0375), (0.78, 1.15)
    near.line((foot[0] - 1.1, foot[1] + 0.275), (foot[0] + 1.1, foot[1] - 0.275), color=BLUE, style=":")
    top = (foot[0] + 0.27, foot[1] + 1.08)
    near.line(foot, top, color=RED, width=2.0)
    near.dot(foot, point, size=6)
    near.text((0.35, 0.6), "$r$", color=RED)
    near.text((0.3, -0.25), "foot", size=8)
    near.text((-1.1, 0.5), "tangent plane", color=BLUE, size=8)
    gliding.line(*zip(x, 0.3 * np.sin(2 * x) - 0.2, strict=True), width=2.6)
    foot = (0.0, -0.2)
    gliding.line((-1.2, -0.92), (1.2, 0.52), color=BLUE, style=":")
    gliding.line(foot, (-0.42, 0.5), color=RED, width=2.0)
    gliding.dot(foot, (-0.42, 0.5), size=6)
    gliding.text((-0.02, 0.3), "$r$", color=RED)
    gliding.arrow((0.55, 0.45), (1.15, 0.81), color=FAINT)
    gliding.text((0.75, 0.95), "free", color=FAINT, size=8)
    ring = ring_of(*(part for turn in range(0, 360, 6) for part in (1.0, turn)))
    sphere.line(*ring, ring[0], color=BLUE, style=":")
    star = [polar(1.0, 25), polar(1.0, 100), polar(1.0, 170), polar(1.24, 240), polar(1.0, 310)]
    for spot in star:
        sphere.line(mean_of(star), spot, color=FAINT)
    sphere.line(polar(1.0, 240), polar(1.24, 240), color=RED, width=2.6)
    sphere.dot(*star, size=6)
    sphere.dot(mean_of(star), color=FAINT)
    sphere.text((-0.42, -1.08), "$r$", color=RED)
    return figure


def reweighting() -> Figure:
    """The smoothed absolute value and the parabola that stands for it in one step."""
    figure, (loss, steps) = row(
        ("reweighting: the parabola lies above", (-2.0, 2.0, -0.5, 2.4)),
        ("merit along a step", (-0.4, 3.3, -0.5, 2.4)),
    )
    x = np.linspace(-1.9, 1.9, 120)
    smoothing, last = 0.25, 1.2
    value = np.hypot(last, smoothing)
    loss.line((-2, 0), (2, 0), color=FAINT)
    loss.line(*zip(x, np.hypot(x, smoothing) - smoothing, strict=True), width=2.6)
    parabola = (x**2 - last**2) / (2 * value) + value - smoothing
    loss.line(*zip(x, parabola, strict=True), color=BLUE, style="--")
    loss.dot((last, value - smoothing), color=RED, size=6)
    loss.text((1.5, 0.45), "last state", color=RED, size=8)
    loss.text((-1.35, 1.95), "loss", size=8)
    loss.text((0.0, 0.75), "model", color=BLUE, size=8)
    t = np.linspace(0, 2.62, 120)
    merit = 1.9 - 1.5 * t + 0.62 * t**2 + 0.12 * np.sin(5 * t)
    steps.line((-0.3, 0), (3.3, 0), color=FAINT)
    steps.line(*zip(t, merit, strict=True), width=2.6)
    steps.line(*zip(t, 1.9 - 0.9 * t + 0.28 * t**2, strict=True), color=BLUE, style="--")
    steps.line((0, 1.9), (3.1, 1.9), color=FAINT, style=":")
    for at, color in ((0.0, INK), (1.3, GREEN), (2.55, RED)):
        steps.dot((at, 1.9 - 1.5 * at + 0.62 * at**2 + 0.12 * math.sin(5 * at)), color=color, size=7)
    steps.text((1.3, 0.55), "taken", color=GREEN, size=8)
    steps.text((1.95, 2.15), "rejected", color=RED, size=8)
    steps.text((2.45, 0.95), "model", color=BLUE, size=8)
    return figure


def inequality() -> Figure:
    """A step that sees only broken inequalities breaks another one; one that knows all stops there."""
    figure, (blind, seeing) = row(
        ("a step that sees what is broken only", (-1.7, 1.9, -1.2, 1.3)),
        ("a step that knows all inequalities", (-1.7, 1.9, -1.2, 1.3)),
    )
    for panel, end, color in ((blind, (1.45, 0.25), RED), (seeing, (0.8, 0.03), GREEN)):
        panel.face((-1.0, -1.1), (0.8, -1.1), (0.8, 1.1), (-1.0, 1.1), edge=FAINT)
        panel.line((0.8, -1.1), (0.8, 1.1), color=INK, width=2.0)
        panel.line((-1.0, -1.1), (-1.0, 1.1), color=INK, width=2.0)
        panel.dot((-1.45, -0.75), size=6)
        panel.text((-1.4, -1.0), "start", size=8)
        panel.text((-0.1, 0.85), "allowed", color=FAINT, size=8)
        panel.arrow((-1.45, -0.75), end, color=color)
        panel.dot(end, color=color, size=6)
    return figure


DRAWINGS: list[Callable[[], Figure]] = [constraints, reweighting, inequality]


if __name__ == "__main__":
    write_all(DRAWINGS)
