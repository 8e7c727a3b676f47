"""Whether a mesh has the topology of the surface that it was made from, and its creases."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
import torch

from .._graph import count_components, edge_numbers
from ..errors import MeshError
from ..fields.frames import Floats, Ints
from ..topology import Topology
from .creases import Creases
from .polygon_sides import sharpest_angle

_SHARPEST = math.radians(0.5)  # corner of a face


class Shape(NamedTuple):
    """What does not change when a surface is meshed anew."""

    euler_number: int
    boundary_loops: int
    components: int


def shape_of(topology: Topology) -> Shape:
    """Euler number, number of boundary loops and of components; isolated vertices are not counted."""
    used = int((topology.valences > 0).sum())
    euler_number = used - topology.num_edges + topology.num_faces
    return Shape(euler_number, topology.loop_offsets.shape[0] - 1, count_components(topology))


def verified_topology(faces: list[list[int]], num_vertices: int, wanted: Shape) -> Topology:
    """The topology of faces that are an oriented manifold of the shape wanted.

    Raises:
        MeshError: if they are none, with what is wrong.
    """
    if not faces:
        raise MeshError("no face is left")
    topology = Topology.from_faces(faces, num_vertices)
    found = shape_of(topology)
    wrong = [
        f"{name.replace('_', ' ')} {getattr(found, name)} instead of {getattr(wanted, name)}"
        for name in Shape._fields
        if getattr(found, name) != getattr(wanted, name)
    ]
    if wrong:
        raise MeshError("the mesh would have " + ", ".join(wrong))
    return topology


def verify_corners(positions: Floats, faces: list[list[int]]) -> None:
    """Checks that no face (of vertices at (V, 3)) has a corner without an angle, as where two sides lie on each other.

    Raises:
        MeshError: if one has.
    """
    by_size = [np.array([face for face in faces if len(face) == size]) for size in sorted({*map(len, faces)})]
    sharpest = min(sharpest_angle(positions[of]) for of in by_size)
    if not sharpest >= _SHARPEST:
        raise MeshError(f"a face would have a corner of {math.degrees(sharpest):.2g} degrees")


def verify_creases(topology: Topology, edges: Ints, creases: Creases) -> None:
    """Checks that edges (C, 2) make the same curves as creases do.

    Raises:
        MeshError: if they are no edges of a mesh, or make other ones.
    """
    if (edge_numbers(topology, torch.from_numpy(edges)) < 0).any():
        raise MeshError("a crease would not be an edge of the mesh")
    used, degrees = np.unique(edges, return_counts=True)
    wanted = creases.degrees[creases.corners]
    more = sum(not chain.closed for chain in creases.chains) - len(wanted)
    same = np.array_equal(np.sort(degrees[degrees != 2]), np.sort(wanted[wanted != 2]))
    if not same or len(edges) - len(used) != more:
        raise MeshError("creases would not end and meet as they do on the surface")
