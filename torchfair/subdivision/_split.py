"""The faces of a mesh cut into smaller ones: connectivity only."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from .._connectivity import first_few
from ..errors import MeshError
from ..topology import Topology
from ._arrays import Ints, MeshArrays

Mask = npt.NDArray[np.bool_]


class Split(NamedTuple):
    """The fine mesh and the tables of :class:`Refinement`, on the device of the coarse mesh."""

    topology: Topology
    face_parents: Tensor
    vertex_origins: Tensor
    edge_parents: Tensor
    edge_parallels: Tensor


def split_faces(topology: Topology, centred: Mask) -> Split:
    r"""Cuts triangles into four and the faces in ``centred`` into one quad for each corner.

    The child at a corner starts with the vertex of the corner, then the middle of the edge that leaves it::

            v                      v --- e' -- .
            | \                    |     |     |
            e - e'                 e --- c --- .        e leaves the corner v, e' arrives, c is the middle
            | \ | \                |     |     |
            . - .- .               . --- . --- .

    Children are numbered face after face; the one in the middle of a triangle comes last.

    Args:
        topology: the coarse mesh.
        centred: (F,) faces with a vertex in their middle; all but triangles must be among them.

    Raises:
        MeshError: if two triangles with the same three vertices are to be cut into four.
    """
    mesh = MeshArrays(topology)
    _check_pillows(topology, mesh, centred)
    corners, offsets, children = _child_faces(mesh, centred)
    fine = Topology.from_packed_faces(corners, offsets, mesh.num_vertices + mesh.num_edges + int(centred.sum()))
    parents = np.empty_like(children)
    parents[children] = np.concatenate([mesh.corner_faces, np.flatnonzero(~centred)])
    edge_parents, parallels = _edge_tables(mesh, centred, fine.corner_edges.numpy(), offsets, children)
    tables = (parents, _vertex_origins(mesh, centred), edge_parents, parallels)
    device = topology.device
    fine = fine if device.type == "cpu" else fine.to(device)
    return Split(fine, *(torch.from_numpy(np.asarray(table, np.int64)).to(device) for table in tables))


def _child_faces(mesh: MeshArrays, centred: Mask) -> tuple[Ints, Ints, Ints]:
    """Packed faces ``(corners, offsets)`` and the numbers of the children: of all corners, then of the middles."""
    quartered = np.flatnonzero(~centred)
    middles_before = np.concatenate([[0], np.cumsum(~centred)])
    at_corners = np.arange(mesh.corners.size) + middles_before[mesh.corner_faces]
    in_middles = mesh.face_offsets[quartered + 1] + middles_before[quartered]
    children = np.concatenate([at_corners, in_middles])

    is_quad = centred[mesh.corner_faces]
    sizes = np.full(children.size, 3)
    sizes[at_corners] += is_quad
    offsets = np.concatenate([[0], np.cumsum(sizes)])
    leaving = mesh.num_vertices + mesh.corner_edges
    arriving = leaving[mesh.previous]
    middle = mesh.num_vertices + mesh.num_edges + np.cumsum(centred) - 1
    corners = np.empty(offsets[-1], np.int64)
    first = offsets[at_corners]
    corners[first] = mesh.corners
    corners[first + 1] = leaving
    corners[first[is_quad] + 2] = middle[mesh.corner_faces[is_quad]]
    corners[first + 2 + is_quad] = arriving
    sides = mesh.face_offsets[quartered, None] + np.arange(3)
    corners[offsets[in_middles, None] + np.arange(3)] = leaving[sides]
    return corners, offsets, children


def _vertex_origins(mesh: MeshArrays, centred: Mask) -> Ints:
    """(V', 2) kind and number; the kinds are the values of ``Origin``."""
    numbers = [np.arange(mesh.num_vertices), np.arange(mesh.num_edges), np.flatnonzero(centred)]
    kinds = np.repeat(np.arange(3), [part.size for part in numbers])
    return np.stack([kinds, np.concatenate(numbers)], axis=1)


def _edge_tables(mesh: MeshArrays, centred: Mask, fine_edges: Ints, offsets: Ints, children: Ints) -> tuple[Ints, Ints]:
    """Parents (E',) and parallels (E', 2) of the fine edges, read off the children at the corners.

    Args:
        mesh: the coarse mesh.
        centred: (F,) faces with a vertex in their middle.
        fine_edges: (H',) edge that leaves each fine corner.
        offsets: (F'+1,) first corner of each fine face.
        children: numbers of the children, those at the corners first.
    """
    edges, following = mesh.corner_edges, mesh.corner_edges[mesh.next]
    preceding = mesh.corner_edges[mesh.previous]
    first = offsets[children[: edges.size]]
    last = first + 2 + centred[mesh.corner_faces]
    count = int(fine_edges.max(initial=-1)) + 1
    parents = np.full(count, -1)
    parents[fine_edges[first]] = edges
    parents[fine_edges[last]] = preceding
    # The edge from the middle of a side into the face: in a triangle cut into four it is parallel to the following
    # side, in a quad it lies between the sides before and after.
    parallels = np.stack([parents, parents], axis=1)
    is_quad = centred[mesh.corner_faces]
    known = ~is_quad | (mesh.face_sizes[mesh.corner_faces] == 4)
    sides = np.stack([np.where(is_quad, preceding, following), following], axis=1)
    parallels[fine_edges[first + 1][known]] = sides[known]
    return parents, parallels


def _check_pillows(topology: Topology, mesh: MeshArrays, centred: Mask) -> None:
    quarters = np.bincount(mesh.corners[~centred[mesh.corner_faces]], minlength=mesh.num_vertices)
    shared = (mesh.valences == 2) & ~mesh.on_boundary & (quarters == 2)
    if shared.any():
        numbers = np.flatnonzero(shared)
        raise MeshError(
            f"triangles with the same three vertices cannot be cut into four: the middles of their sides would have "
            f"four faces beside one edge. It happens around vertices {first_few(numbers, numbers.size)}. "
            "Use catmull_clark, or remove these triangles."
        )
