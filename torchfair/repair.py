"""Repair of face lists: consistent orientation and no unused vertices, nothing else."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor

from ._connectivity import HalfEdges, Ints, build_half_edges, first_few, pack_faces, pair_half_edges
from ._graph import connected_in_two_colours
from .errors import MeshError, ShapeError
from .topology import Topology

Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class RepairedMesh:
    """Result of :func:`repair_mesh`.

    Attributes:
        vertices: (*batch, V', 3) the vertices that are used, in their old order.
        topology: connectivity of the repaired mesh; faces keep their numbers.
        kept_vertices: (V',) old number of each vertex.
        flipped_faces: numbers of the faces that were turned over.
        messages: what was done, one sentence each; empty if nothing had to be done.
    """

    vertices: Tensor
    topology: Topology
    kept_vertices: Tensor
    flipped_faces: Tensor
    messages: list[str]

    @property
    def faces(self) -> list[list[int]]:
        """Faces as lists of new vertex numbers; a flipped face keeps its first corner."""
        return self.topology.face_lists()


def repair_mesh(vertices: Tensor, faces: object) -> RepairedMesh:
    """Orients faces consistently and drops vertices that no face uses.

    In each connected component (faces joined along edges) the orientation of the majority is kept, that of
    the lowest face if both are equally frequent, so that as few faces as possible are turned over. Inside
    and outside of closed surfaces are not looked at. Positions are not looked at either: vertices at the same
    place stay apart.

    Args:
        vertices: (*batch, V, 3) positions; gradients pass through.
        faces: as for :meth:`Topology.from_faces`.

    Raises:
        ShapeError: if ``vertices`` does not end in (V, 3).
        MeshError: if the surface is one-sided (a Moebius strip), a face occurs twice, or for the faults that
            only the user can mend: non-manifold edges and vertices, repeated corners, vertex numbers out of
            range, faces of fewer than three corners.
    """
    return repair_packed(vertices, *pack_faces(faces))


def repair_packed(vertices: Tensor, corners: Ints, offsets: Ints) -> RepairedMesh:
    """:func:`repair_mesh` for packed faces."""
    if vertices.ndim < 2 or vertices.shape[-1] != 3:
        raise ShapeError("vertices", "a tensor (*batch, V, 3)", tuple(vertices.shape))
    half = build_half_edges(corners, offsets, vertices.shape[-2])
    flipped = _faces_to_flip(half)
    used = np.zeros(half.num_vertices, bool)
    used[corners] = True
    kept = np.flatnonzero(used)
    topology = Topology.from_packed_faces((np.cumsum(used) - 1)[_flip(half, flipped)], offsets, kept.size)
    kept_vertices = torch.from_numpy(kept).to(vertices.device)
    return RepairedMesh(
        vertices=vertices[..., kept_vertices, :],
        topology=topology.to(vertices.device),
        kept_vertices=kept_vertices,
        flipped_faces=torch.from_numpy(np.flatnonzero(flipped)).to(vertices.device),
        messages=_describe(flipped, kept, half.num_vertices),
    )


def _faces_to_flip(half: HalfEdges) -> Bools:
    """(F,) the smallest set of faces that must turn over."""
    first, second, _ = pair_half_edges(half)
    clash = half.corners[first] == half.corners[second]
    pairs = half.faces[first], half.faces[second]
    num_faces = half.offsets.size - 1
    if not clash.any():
        return np.zeros(num_faces, bool)
    _check_twice(half, pairs[0][clash], pairs[1][clash])
    labels = connected_in_two_colours(np.stack(pairs, 1), clash, num_faces)  # as they are, and turned over
    _check_one_sided(labels)
    low = labels.min(axis=0)
    side = labels[0] == low
    _, lowest_face, component, sizes = np.unique(low, return_index=True, return_inverse=True, return_counts=True)
    on_side = np.bincount(component, weights=side)
    kept_side = np.where(2 * on_side == sizes, side[lowest_face], 2 * on_side > sizes)
    flipped: Bools = side != kept_side[component]
    return flipped


def _check_one_sided(labels: Ints) -> None:
    stuck = np.flatnonzero(labels[0] == labels[1])
    if stuck.size:
        raise MeshError(
            f"one-sided surface (such as a Moebius strip): {stuck.size} connected face(s) cannot be oriented "
            f"consistently: faces {first_few(stuck, stuck.size)}. Cut the surface open or remove faces."
        )


def _check_twice(half: HalfEdges, left: Ints, right: Ints) -> None:
    """Refuses pairs of faces that share all their edges in the same direction."""
    num_faces = half.offsets.size - 1
    keys, counts = np.unique(np.minimum(left, right) * num_faces + np.maximum(left, right), return_counts=True)
    a, b = keys // num_faces, keys % num_faces
    sizes = np.diff(half.offsets)
    twice = np.flatnonzero((counts == sizes[a]) & (counts == sizes[b]))
    if twice.size:
        named = (f"{a[i]} and {b[i]}" for i in twice)
        raise MeshError(
            f"{twice.size} face(s) occur twice: faces {first_few(named, twice.size)}. Remove one of each pair."
        )


def _flip(half: HalfEdges, flipped: Bools) -> Ints:
    """Corners with the ``flipped`` faces turned over; every face keeps its first corner."""
    turn = flipped[half.faces]
    first = half.offsets[half.faces]
    local = np.arange(half.corners.size) - first
    sizes = np.diff(half.offsets)[half.faces]
    return half.corners[np.where(turn, first + (sizes - local) % sizes, first + local)]


def _describe(flipped: Bools, kept: Ints, num_vertices: int) -> list[str]:
    messages = []
    turned = np.flatnonzero(flipped)
    if turned.size:
        messages.append(
            f"turned over {turned.size} of {flipped.size} faces so that neighbours agree: "
            f"faces {first_few(turned, turned.size)}."
        )
    if kept.size < num_vertices:
        unused = np.setdiff1d(np.arange(num_vertices), kept, assume_unique=True)
        messages.append(
            f"dropped {unused.size} unused vertex(es) and renumbered the others: "
            f"vertices {first_few(unused, unused.size)}."
        )
    return messages
