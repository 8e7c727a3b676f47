"""Faces of a new mesh that are turned over."""

from __future__ import annotations

import math

import torch
from torch import Tensor

from ..geometry import dihedral_angles, face_centres, face_normals
from ..topology import Topology
from .components import Pieces, ReadSurface

_FOLDED = math.radians(120.0)  # between faces that share an edge


def turned_over(pieces: Pieces, surface: ReadSurface) -> Tensor:
    """Numbers of faces whose normals are opposite to those of the surface beside their centres.

    Opposite are normals at more than a right angle both to the triangle of the surface that is nearest and to its
    smooth normals, so that a face across a sharp edge is none. Where a face is folded by more than 120 degrees against
    one beside it, off creases, one of the two is enough: at the tip of a slender body smooth normals differ from those
    of triangles by as much.

    Args:
        pieces: a mesh, of faces with an area.
        surface: that it was made from.
    """
    positions = torch.from_numpy(pieces.positions)
    topology = Topology.from_faces(pieces.faces, len(positions))
    closest = surface.reference.closest(face_centres(positions, topology))
    normals = face_normals(positions, topology)
    ahead = torch.stack([(normals * of).sum(1) for of in (closest.normals, closest.smooth_normals)])
    folded = _folded(positions, topology, pieces.creases.edges)
    return (torch.where(folded, ahead.amin(0), ahead.amax(0)) < 0).nonzero().squeeze(1)


def told(pieces: Pieces, over: Tensor, kind: str, instead: str) -> str:
    """A note on faces of a kind that are turned over, and what to ask for instead."""
    place = ", ".join(f"{of:.4g}" for of in pieces.positions[pieces.faces[int(over[0])]].mean(0))
    return f"{counted(len(over), kind)} turned over, one at ({place}): ask for more or fewer, or for {instead}"


def counted(number: int, kind: str = "triangle") -> str:
    """So many are."""
    return f"one {kind} is" if number == 1 else f"{number} {kind}s are"


def _folded(positions: Tensor, topology: Topology, creases: Tensor) -> Tensor:
    """(F,) whether a face is folded against one beside it, but for edges along creases (C, 2)."""
    sharp = dihedral_angles(positions, topology)[: topology.num_interior_edges].abs() > _FOLDED
    edges = sharp.nonzero().squeeze(1)
    if len(edges) and len(creases):
        ends = topology.interior_edges[edges].sort(1).values
        edges = edges[~(ends[:, None] == creases.sort(1).values).all(-1).any(1)]
    found = torch.zeros(topology.num_faces, dtype=torch.bool)
    found[topology.interior_edge_faces[edges].flatten()] = True
    return found
