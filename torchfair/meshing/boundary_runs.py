"""Stretches of the boundary that nearly follow the field become lines of the mesh."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..fields.frames import Bools, FaceFrames, Floats, Ints
from ..fields.matchings import QUARTER
from .cut_graph import CutGraph


class BoundaryRun(NamedTuple):
    """Boundary edges, or sharp ones, along which one coordinate is the same whole number.

    Attributes:
        component: 0 if the first coordinate is constant, 1 if the second.
        corners: face and corner of the starts and ends of the edges.
    """

    component: int
    corners: list[tuple[int, int]]

    @classmethod
    def along(cls, corners: Ints, quarter: int) -> BoundaryRun:
        """Of edges that start at corners ``3 f + k``, along one direction of the field, 0 to 3."""
        ends = [(int(corner) // 3, (int(corner) % 3 + shift) % 3) for corner in corners for shift in (0, 1)]
        return cls(1 - quarter % 2, ends)  # along the first axis, 0 or 2, the second coordinate is constant


def find_runs(
    frames: FaceFrames, graph: CutGraph, angle: float, shortest: float | Floats, components: tuple[int, ...] = (0, 1)
) -> list[BoundaryRun]:
    """Longest stretches of the boundary that follow the field, cut where the mesh is cut.

    Args:
        frames: of the triangles.
        graph: the cut.
        angle: largest angle between an edge and the field, radians.
        shortest: length of a stretch that counts, also (F,) by the triangles that it runs along.
        components: coordinates whose lines run along or across the field.
    """
    topology = frames.topology
    outer = frames.outer_corners
    corner_from = np.full(topology.num_vertices, -1)
    corner_from[topology.corners.numpy()[outer]] = outer
    turned = _turned_around(frames, graph)
    runs: list[BoundaryRun] = []
    least = np.broadcast_to(np.asarray(shortest), len(frames.triangles))
    for loop in topology.boundary_loops():
        corners = corner_from[loop.numpy()]
        quarter, off, length = against_field(frames, graph, corners)
        goes_on = (
            (quarter == (np.roll(quarter, 1) - turned[loop.numpy()]) % 4) & (off <= angle) & np.roll(off <= angle, 1)
        )
        for stretch in _stretches(off <= angle, goes_on):
            if (length[stretch] / least[corners[stretch] // 3]).sum() >= 1:
                runs += _cut_where_frames_turn(corners[stretch], quarter[stretch])
    return [run for run in runs if run.component in components]


def _turned_around(frames: FaceFrames, graph: CutGraph) -> Ints:
    """(V,) quarter turns from the last face around a boundary vertex, clockwise to the first."""
    size = len(frames.points)
    start, end = frames.edges.T
    quarters = graph.quarters.astype(float)
    turned = np.bincount(start, quarters, size) - np.bincount(end, quarters, size)
    return np.asarray(np.rint(turned), np.int64)


def against_field(frames: FaceFrames, graph: CutGraph, corners: Ints) -> tuple[Ints, Floats, Floats]:
    """Of boundary edges that start at corners: nearest direction of the field (0 to 3), angle to it, length."""
    sides = frames.sides(corners)
    against = np.angle(sides) - graph.angles[corners // 3]
    nearest = np.rint(against / QUARTER)
    return nearest.astype(np.int64) % 4, np.abs(against - nearest * QUARTER), np.abs(sides)


def _stretches(follows: Bools, goes_on: Bools) -> list[Ints]:
    """Numbers along a loop of edges that follow the field and go on from each other, in order."""
    count = len(follows)
    if goes_on.all():
        return [np.arange(count)]
    first = int(np.flatnonzero(~goes_on)[0])
    order = (first + np.arange(count)) % count
    pieces = np.split(order, np.flatnonzero(~goes_on[order])[1:])
    return [piece for piece in pieces if follows[piece[0]]]


def _cut_where_frames_turn(corners: Ints, quarter: Ints) -> list[BoundaryRun]:
    """One run for every part in one frame; parts share the vertex between them, so that they stay one line."""
    parts = np.split(np.arange(len(corners)), np.flatnonzero(np.diff(quarter)) + 1)
    return [BoundaryRun.along(corners[part], int(quarter[part[0]])) for part in parts]
