"""Sharp edges of a surface, as curves between their corners."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass

import numpy as np
from torch import Tensor

from ..fields import Pull
from ..fields.direction_field import WEAK, side_angles
from ..fields.frames import Bools, FaceFrames, Ints
from ..geometry import dihedral_angles
from ..topology import Topology

_FEW = 8  # loose ends
_LOOSE = 0.1  # of them for a sharp edge: more are a sign of noise


@dataclass(frozen=True, eq=False)
class CreaseChain:
    """Sharp edges one after the other.

    Attributes:
        vertices: (n,) in order; of a closed chain the first once more at its end.
        edges: (n - 1,) numbers of the interior edges between them.
    """

    vertices: Ints
    edges: Ints

    @property
    def is_closed(self) -> bool:
        """Whether it comes back to where it starts."""
        return bool(self.vertices[0] == self.vertices[-1])

    def forward(self, frames: FaceFrames) -> Bools:
        """(n - 1,) whether an edge starts where the chain comes to it."""
        return np.asarray(frames.edges[self.edges, 0] == self.vertices[:-1])


@dataclass(frozen=True, eq=False)
class Creases:
    """The sharp edges of a surface.

    Attributes:
        edges: (I,) bool.
        degrees: (V,) sharp edges at vertices.
        corners: (V,) bool: where chains end, meet, reach the boundary or turn sharply.
        chains: the edges between corners, and loops without corners.
    """

    edges: Bools
    degrees: Ints
    corners: Bools
    chains: list[CreaseChain]


def sharp_edges(vertices: Tensor, topology: Topology, angle: float) -> Bools:
    """(I,) which interior edges bend by more than an angle; none where they are a sign of noise, with many loose ends.

    Args:
        vertices: (V, 3).
        topology: triangles.
        angle: radians; 0 for none.
    """
    if not angle:
        return np.zeros(topology.num_interior_edges, bool)
    sharp = (dihedral_angles(vertices, topology).abs() > angle).numpy()
    degrees = np.bincount(topology.interior_edges.numpy()[sharp].ravel(), minlength=topology.num_vertices)
    loose = int(((degrees == 1) & ~topology.is_boundary_vertex.numpy()).sum())
    return np.zeros_like(sharp) if loose > max(_FEW, _LOOSE * sharp.sum()) else np.asarray(sharp)


def find_creases(frames: FaceFrames, sharp: Bools, corner_angle: float, shortest: float) -> Creases:
    """Chains of sharp edges; those that end inside the surface and are shorter than a length are left out.

    Args:
        frames: of the triangles.
        sharp: (I,) bool.
        corner_angle: chains that turn by more have a corner there, radians.
        shortest: length.
    """
    while True:
        found = _chains(frames, sharp, corner_angle)
        loose = (found.degrees == 1) & ~frames.is_boundary
        short = [chain for chain in found.chains if loose[chain.vertices[[0, -1]]].any()]
        short = [chain for chain in short if frames.lengths[chain.edges].sum() < shortest]
        if not short:
            return found
        sharp = sharp.copy()
        sharp[np.concatenate([chain.edges for chain in short])] = False


def crease_pull(frames: FaceFrames, creases: Creases) -> tuple[Pull, Ints]:
    """Directions of creases in the faces on both sides, with small weights, and the numbers of their chains."""
    edges = np.concatenate([chain.edges for chain in creases.chains])
    chains = np.repeat(np.arange(len(creases.chains)), [len(chain.edges) for chain in creases.chains])
    corners = (3 * frames.faces[edges] + frames.corners[edges]).ravel()
    pull = Pull(corners // 3, side_angles(frames, corners), np.full(len(corners), WEAK))
    return pull, np.repeat(chains, 2)


def _chains(frames: FaceFrames, sharp: Bools, corner_angle: float) -> Creases:
    around: dict[int, list[int]] = defaultdict(list)
    for edge in np.flatnonzero(sharp).tolist():
        for vertex in frames.edges[edge].tolist():
            around[vertex].append(edge)
    degrees, corners = np.zeros(len(frames.points), np.int64), np.zeros(len(frames.points), bool)
    for vertex, edges in around.items():
        degrees[vertex] = len(edges)
        corners[vertex] = len(edges) != 2 or frames.is_boundary[vertex] or _turn(frames, vertex, edges) > corner_angle
    chains: list[CreaseChain] = []
    done: set[int] = set()
    starts = [(vertex, edge) for vertex, edges in around.items() if corners[vertex] for edge in edges]
    for vertex, edge in starts + [(int(frames.edges[edge, 0]), edge) for edge in np.flatnonzero(sharp).tolist()]:
        if edge not in done:
            chains.append(_walk(frames, around, corners, vertex, edge))
            done.update(chains[-1].edges.tolist())
    return Creases(sharp, degrees, corners, chains)


def _turn(frames: FaceFrames, vertex: int, edges: list[int]) -> float:
    """Angle by which a chain turns at a vertex."""
    before, after = (frames.points[frames.edges[edge].sum() - vertex] - frames.points[vertex] for edge in edges)
    return float(np.arctan2(np.linalg.norm(np.cross(before, after)), -before @ after))


def _walk(frames: FaceFrames, around: dict[int, list[int]], corners: Bools, vertex: int, edge: int) -> CreaseChain:
    vertices, edges = [vertex], [edge]
    while True:
        vertices.append(int(frames.edges[edges[-1]].sum()) - vertices[-1])
        if corners[vertices[-1]] or vertices[-1] == vertex:
            return CreaseChain(np.array(vertices), np.array(edges))
        first, second = around[vertices[-1]]
        edges.append(second if first == edges[-1] else first)
