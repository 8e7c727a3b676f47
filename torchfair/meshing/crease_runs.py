"""Creases that nearly follow the field become lines of the mesh."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..fields.frames import Bools, FaceFrames, Floats, Ints
from .boundary_runs import BoundaryRun, against_field
from .creases import Creases, SharpChain
from .cut_graph import CutGraph
from .seams import Seams

_MOST = 2.0  # times the angle: of a single edge


@dataclass(frozen=True, eq=False)
class CreaseLines:
    """What becomes of creases: lines of the mesh, or curves that cut its cells.

    Attributes:
        creases: of the surface.
        runs: of every chain its edges in one frame of the field; none of chains that cut cells.
        pinned: (V,) bool: corners that become points of the lattice.
    """

    creases: Creases
    runs: list[list[BoundaryRun]]
    pinned: Bools

    @property
    def on_lines(self) -> Ints:
        """Edges of the chains that become lines."""
        chains = [chain.edges for chain, runs in zip(self.creases.chains, self.runs, strict=True) if runs]
        return np.concatenate([*chains, []]).astype(np.int64)

    def coordinate(self, chain: int, otherwise: int) -> int:
        """The one that is constant along a chain."""
        return self.runs[chain][0].component if self.runs[chain] else otherwise


def crease_lines(
    frames: FaceFrames,
    graph: CutGraph,
    seams: Seams,
    creases: Creases,
    allowed: list[bool],
    angle: float,
    shortest: float | Floats,
    components: tuple[int, ...],
) -> CreaseLines:
    """Finds the chains that follow the field from end to end.

    Args:
        frames: of the triangles.
        graph: the cut.
        seams: its copies.
        creases: of the surface.
        allowed: which chains may become lines.
        angle: between a chain and the field in the mean, radians; edges may turn from it by twice as much.
        shortest: length of a chain that counts, also (F,) by the triangles on its left.
        components: coordinates whose lines run along or across the field; none where no chain is to follow it.
    """
    least = np.broadcast_to(np.asarray(shortest), len(frames.triangles))[frames.faces[:, 0]]
    runs = [
        _follows(frames, graph, seams, chain, angle, components)
        if may and components and (frames.lengths[chain.edges] / least[chain.edges]).sum() >= 1
        else []
        for chain, may in zip(creases.chains, allowed, strict=True)
    ]
    ends = [chain.vertices[[0, -1]] for chain, of in zip(creases.chains, runs, strict=True) if of]
    pinned = np.zeros(len(frames.points), bool)
    pinned[np.concatenate([*ends, []]).astype(np.int64)] = True
    pinned |= creases.degrees == 1
    return CreaseLines(creases, runs, pinned & creases.corners & ~frames.is_boundary)


def _follows(
    frames: FaceFrames, graph: CutGraph, seams: Seams, chain: SharpChain, angle: float, components: tuple[int, ...]
) -> list[BoundaryRun]:
    """The runs of a chain, none if it does not follow the field."""
    face, corner = frames.faces[chain.edges, 0], frames.corners[chain.edges, 0]
    quarter, off, length = against_field(frames, graph, 3 * face + corner)
    if off.max() > _MOST * angle or off @ length > angle * length.sum():
        return []
    forward = chain.forward(frames)
    quarter = np.where(forward, quarter, quarter + 2) % 4
    arrives = seams.copies[face, (corner + forward) % 3]
    leaves = seams.copies[face, (corner + ~forward) % 3]
    turn = np.rint(np.angle(seams.unit[leaves[1:]] / seams.unit[arrives[:-1]]) / (np.pi / 2)).astype(np.int64)
    goes_on = (quarter[1:] == (quarter[:-1] + turn) % 4) | graph.nodes[chain.vertices[1:-1]]
    if not goes_on.all():
        return []
    parts = np.split(np.arange(len(face)), np.flatnonzero(arrives[:-1] != leaves[1:]) + 1)
    runs = [BoundaryRun.along(3 * face[part] + corner[part], int(quarter[part[0]])) for part in parts]
    return runs if all(run.component in components for run in runs) else []
