"""Index tables for the fast evaluation of the normal variation, made once per topology."""

from __future__ import annotations

import sys
from dataclasses import dataclass

import torch
from torch import Tensor

from ..topology import Topology
from ._normal_variation_memory import Scratch

FACES_PER_THREAD = 65536
"""Faces that each thread of a CPU handles at once: few enough for its cache, enough to be worth waking it."""

_CACHE = "_normal_variation_tables"


@dataclass(frozen=True)
class Block:
    """Up to :func:`faces_per_block` faces with k corners each.

    *Places* number the faces as the blocks hold them: sorted by number of corners. Index tables are
    ``(k * n,)``: first the first corner of all n faces, then the second, and so on. Side j of a face runs
    from corner j to corner j+1. The 32-bit tables make gathering faster.

    Attributes:
        corner_count: k.
        start: place of the first face.
        stop: place behind the last face.
        corners: vertex at each corner.
        corners_short: the same with 32 bits.
        neighbours: place of the face behind each side, the face itself on the boundary.
        edges: edge at each side; 0 on the boundary, where no term is left to weigh.
    """

    corner_count: int
    start: int
    stop: int
    corners: Tensor
    corners_short: Tensor
    neighbours: Tensor
    edges: Tensor

    @property
    def face_count(self) -> int:
        """Number n of faces."""
        return self.stop - self.start

    @property
    def side_count(self) -> int:
        """Number k * n of sides."""
        return self.corners.shape[0]

    def take(self, values: Tensor) -> Tensor:
        """The block's part of face values (..., F) in the order of places."""
        return values[..., self.start : self.stop]


def faces_per_block(on_cpu: bool) -> int:
    """Faces to handle at once; all of them on other devices."""
    return FACES_PER_THREAD * torch.get_num_threads() if on_cpu else sys.maxsize


@dataclass(frozen=True)
class Tables:
    """What the evaluation needs of a topology.

    Attributes:
        blocks: the faces.
        face_count: F.
        most_faces: faces of the largest block.
        most_sides: sides of the block with most.
        scratch: memory to work in.
    """

    blocks: tuple[Block, ...]
    face_count: int
    most_faces: int
    most_sides: int
    scratch: Scratch


@torch.inference_mode(False)
def tables_of(topology: Topology) -> Tables:
    """The tables of a topology, remembered by it."""
    tables: Tables | None = topology.__dict__.get(_CACHE)
    if tables is None:
        blocks = _build(topology)
        tables = Tables(
            blocks=blocks,
            face_count=topology.num_faces,
            most_faces=max((block.face_count for block in blocks), default=0),
            most_sides=max((block.side_count for block in blocks), default=0),
            scratch=Scratch(),
        )
        # The same place where functools.cached_property keeps its values.
        topology.__dict__[_CACHE] = tables
    return tables


def _build(topology: Topology) -> tuple[Block, ...]:
    limit = faces_per_block(topology.corners.is_cpu)
    places, neighbours = _neighbours(topology)
    edges = torch.where(topology.corner_edges < topology.num_interior_edges, topology.corner_edges, 0)
    blocks = []
    for size, (faces, corners) in topology.faces_by_size.items():
        first_place = int(places[faces[0]])
        sides = topology.face_offsets[faces, None] + torch.arange(size, device=topology.device)
        for start in range(0, faces.shape[0], limit):
            part = slice(start, start + limit)
            vertices = _columns(corners[part])
            block = Block(
                corner_count=size,
                start=first_place + start,
                stop=first_place + min(start + limit, faces.shape[0]),
                corners=vertices,
                corners_short=vertices.int(),
                neighbours=_columns(neighbours[sides[part]]).int(),
                edges=_columns(edges[sides[part]]).int(),
            )
            blocks.append(block)
    return tuple(blocks)


def _neighbours(topology: Topology) -> tuple[Tensor, Tensor]:
    """Place of every face (F,), and place of the face behind each side (H,)."""
    places = torch.empty(topology.num_faces, dtype=torch.int64, device=topology.device)
    order = [faces for faces, _ in topology.faces_by_size.values()]
    if order:
        places[torch.cat(order)] = torch.arange(topology.num_faces, device=topology.device)
    own = topology.corner_faces
    interior = topology.corner_edges < topology.num_interior_edges
    behind = own.clone()
    # Of the two faces beside an edge, the other one.
    behind[interior] = topology.interior_edge_faces.sum(1)[topology.corner_edges[interior]] - own[interior]
    return places, places[behind]


def _columns(table: Tensor) -> Tensor:
    """(n, k) as a flat tensor, column after column."""
    return table.t().reshape(-1).contiguous()
