"""Index tables for the fast evaluation of the normal variation, made once per topology."""

from __future__ import annotations

import sys
from dataclasses import dataclass

import torch
from torch import Tensor

from .._mesh_sums import MeshSums
from .._tables import cached_table
from ..topology import Topology
from ._normal_variation_memory import Scratch, shared_scratch

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
        sides: (n, k) corner where each side starts.
        topology: what the faces are from.
        sums: for the faces of each of several meshes; None if there is one mesh.
    """

    corner_count: int
    start: int
    stop: int
    corners: Tensor
    corners_short: Tensor
    neighbours: Tensor
    sides: Tensor
    topology: Topology
    sums: MeshSums | None

    @property
    def face_count(self) -> int:
        """Number n of faces."""
        return self.stop - self.start

    @property
    def side_count(self) -> int:
        """Number k * n of sides."""
        return self.corners.shape[0]

    @cached_table
    def edges(self) -> Tensor:
        """Edge at each side; 0 on the boundary, where no term is left to weigh."""
        edges = self.topology.corner_edges[self.sides]
        return _columns(torch.where(edges < self.topology.num_interior_edges, edges, 0)).int()

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
        vertex_meshes: (V,) mesh of each vertex, if meshes are joined.
        num_meshes: n.
        scratch: memory to work in.
    """

    blocks: tuple[Block, ...]
    face_count: int
    most_faces: int
    most_sides: int
    vertex_meshes: Tensor | None
    num_meshes: int
    scratch: Scratch

    @property
    def mesh_shape(self) -> tuple[int, ...]:
        """(n,) for n joined meshes, () for one mesh."""
        return () if self.vertex_meshes is None else (self.num_meshes,)


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
            vertex_meshes=topology.vertex_meshes if topology.is_joined else None,
            num_meshes=topology.num_meshes,
            scratch=shared_scratch(topology.corners.shape[0]) or Scratch(),
        )
        # The same place where functools.cached_property keeps its values.
        topology.__dict__[_CACHE] = tables
    return tables


def _build(topology: Topology) -> tuple[Block, ...]:
    limit = faces_per_block(topology.corners.is_cpu)
    neighbours = neighbours_of(topology)
    blocks = []
    begin = 0
    for size, (faces, corners) in topology.faces_by_size.items():
        sides = _sides(topology, faces, size)
        for start in range(0, faces.shape[0], limit):
            part = slice(start, start + limit)
            vertices = _columns(corners[part])
            block = Block(
                corner_count=size,
                start=begin + start,
                stop=begin + min(start + limit, faces.shape[0]),
                corners=vertices,
                corners_short=vertices.int(),
                neighbours=_columns(_take(neighbours, sides[part])),
                sides=sides[part],
                topology=topology,
                sums=_sums(topology, faces[part]),
            )
            blocks.append(block)
        begin += faces.shape[0]
    return tuple(blocks)


def neighbours_of(topology: Topology) -> Tensor:
    """Place of the face behind each side, (H,) with 32 bits."""
    twins = topology.twins
    own = torch.arange(twins.shape[0], device=topology.device)
    faces = topology.corner_faces.int().index_select(0, torch.where(twins < 0, own, twins))
    order = [faces for faces, _ in topology.faces_by_size.values()]
    if len(order) < 2:
        return faces
    places = torch.empty(topology.num_faces, dtype=torch.int32, device=topology.device)
    places[torch.cat(order)] = torch.arange(topology.num_faces, dtype=torch.int32, device=topology.device)
    return places[faces]


def _sides(topology: Topology, faces: Tensor, size: int) -> Tensor:
    """(n, size) corners of ``faces``, which are all that have so many."""
    if faces.shape[0] == topology.num_faces:
        return torch.arange(topology.corners.shape[0], device=topology.device).view(-1, size)
    return topology.face_offsets[faces, None] + torch.arange(size, device=topology.device)


def _take(values: Tensor, sides: Tensor) -> Tensor:
    """``values[sides]``; where these are all in order, as in meshes of one kind of faces, without copying."""
    return values.view(sides.shape) if sides.numel() == values.numel() else values[sides]


def _sums(topology: Topology, faces: Tensor) -> MeshSums | None:
    return MeshSums.of(topology.face_meshes[faces], topology.num_meshes) if topology.is_joined else None


def _columns(table: Tensor) -> Tensor:
    """(n, k) as a flat tensor, column after column."""
    return table.t().reshape(-1).contiguous()
