"""Sharp edges of a surface, as curves between their corners."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from .._graph import edge_numbers
from ..creases import crease_chains, crease_corners, crease_edges
from ..fields import Pull
from ..fields.direction_field import WEAK, side_angles
from ..fields.frames import Bools, FaceFrames, Floats, Ints
from ..topology import Topology

_FEW = 8  # loose ends
_LOOSE = 0.1  # of them for a sharp edge: more are a sign of noise


@dataclass(frozen=True, eq=False)
class SharpChain:
    """Sharp edges one after the other.

    Attributes:
        vertices: (n,) in order; of a closed chain the first once more at its end.
        edges: (n - 1,) numbers of the interior edges between them.
        closed: whether it has no corner.
    """

    vertices: Ints
    edges: Ints

    closed: bool

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
    chains: list[SharpChain]

    def away_from(self, points: Floats, places: Floats, distance: float) -> list[bool]:
        """Which chains keep a distance from all places (n, 3); of vertices at points (V, 3)."""
        gaps = [np.linalg.norm(points[chain.vertices][:, None] - places, axis=2) for chain in self.chains]
        return [bool((gap > distance).all()) for gap in gaps]


def sharp_edges(vertices: Tensor, topology: Topology, angle: float) -> Bools:
    """(I,) which interior edges bend by more than an angle; none where they are a sign of noise, with many loose ends.

    Args:
        vertices: (V, 3).
        topology: triangles.
        angle: radians; 0 for none.
    """
    sharp = np.zeros(topology.num_interior_edges, bool)
    sharp[crease_edges(vertices, topology, angle).numpy()] = True
    degrees = _degrees(topology.interior_edges.numpy()[sharp], topology.num_vertices)
    loose = int(((degrees == 1) & ~topology.is_boundary_vertex.numpy()).sum())
    return np.zeros_like(sharp) if loose > max(_FEW, _LOOSE * sharp.sum()) else sharp


def _degrees(edges: Ints, num_vertices: int) -> Ints:
    return np.bincount(edges.ravel(), minlength=num_vertices)


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
    edges, topology = torch.from_numpy(np.flatnonzero(sharp)), frames.topology
    corners = crease_corners(torch.from_numpy(frames.points), topology, edges, corner_angle)
    found = crease_chains(topology, edges, corners)
    walks = [torch.cat([chain.vertices, chain.vertices[:1]]) if chain.closed else chain.vertices for chain in found]
    pairs = [torch.stack([walk[:-1], walk[1:]], 1) for walk in walks]
    numbers = torch.split(edge_numbers(topology, torch.cat([*pairs, edges.new_zeros(0, 2)])), [len(of) for of in pairs])
    chains = [
        SharpChain(walk.numpy(), of.numpy(), chain.closed)
        for walk, of, chain in zip(walks, numbers, found, strict=True)
    ]
    return Creases(sharp, _degrees(frames.edges[sharp], len(frames.points)), corners.numpy(), chains)
