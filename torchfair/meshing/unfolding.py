"""Vertices of triangles that are turned over, moved between their neighbours."""

from __future__ import annotations

import torch
from torch import Tensor

from ..topology import Topology
from .components import Pieces, ReadSurface
from .turned_over import turned_over

_STEP = 0.25
_ROUNDS = 32
_GROWN = 8  # rounds, after which neighbours move, too


def unfolded(pieces: Pieces, surface: ReadSurface) -> Pieces:
    """Pieces in which corners of triangles that are turned over lie in the middle of their neighbours.

    Edges on rows that turn back around an umbilic pass on its far side where rows lie much closer than vertices on
    them, as on the ends of long ellipsoids. There are hardly any directions there, so that vertices may move: corners
    of triangles that are turned over go to the mean of the vertices around them, and back onto the surface, until
    there are none; after every eight rounds one more ring around them moves, too. Vertices on the boundary and on
    creases stay.

    Args:
        pieces: triangles on those of the surface.
        surface: that they were made from.

    Returns:
        The pieces as they were if as many are turned over in the end.
    """
    over = turned_over(pieces, surface)
    if not len(over):
        return pieces
    topology = Topology.from_faces(pieces.faces, len(pieces.positions))
    held = topology.is_boundary_vertex.clone()
    held[pieces.creases.edges.flatten()] = True
    best, fewest = pieces, len(over)
    for number in range(_ROUNDS):
        near = _around(topology, over, number // _GROWN) & ~held
        positions = torch.from_numpy(pieces.positions)
        means = positions[near] + _STEP * (_means(positions, topology) - positions)[near]
        positions = positions.index_copy(0, near.nonzero().squeeze(1), surface.reference.closest(means).positions)
        pieces = pieces.moved(positions.numpy())
        over = turned_over(pieces, surface)
        if len(over) < fewest:
            best, fewest = pieces, len(over)
        if not len(over):
            break
    return best


def _around(topology: Topology, faces: Tensor, rings: int) -> Tensor:
    """(V,) the corners of triangles and those of the triangles around, so many times."""
    found = torch.zeros(topology.num_vertices, dtype=torch.bool)
    found[topology.triangles[faces].flatten()] = True
    for _ in range(rings):
        found[topology.edges[found[topology.edges].any(1)].flatten()] = True
    return found


def _means(positions: Tensor, topology: Topology) -> Tensor:
    """(V, 3) of the vertices around each."""
    edges = torch.cat([topology.edges, topology.edges.flip(1)])
    sums = torch.zeros_like(positions).index_add_(0, edges[:, 0], positions[edges[:, 1]])
    return sums / topology.valences[:, None].clamp_min(1)
