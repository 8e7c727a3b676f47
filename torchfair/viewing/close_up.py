"""The surroundings of one place of a mesh, to be seen large."""

from __future__ import annotations

from typing import NamedTuple

import torch
from torch import Tensor

from ..energies import angle_variation_per_edge
from ..geometry import edge_lengths, face_centres, face_normals
from ..topology import Topology

_RADIUS = 4.5  # mean edges
_LEAST = 4  # times as many faces in the mesh as in a close-up, for it to show more than the whole


class Part(NamedTuple):
    """Some faces of a mesh, with the vertices of all.

    Attributes:
        vertices: (V, 3).
        topology: of these faces.
    """

    vertices: Tensor
    topology: Topology


class Place(NamedTuple):
    """Where to look at closely.

    Attributes:
        middle: (3,).
        normal: (3,) unit normal of the surface there.
        radius: Of what is shown.
    """

    middle: Tensor
    normal: Tensor
    radius: float


def worst_place(vertices: Tensor, topology: Topology) -> Place | None:
    """The edge with the largest l |a|; None if nothing bends."""
    values = angle_variation_per_edge(vertices, topology)
    if not values.numel() or not float(values.max()) > 0.0:
        return None
    worst = int(values.argmax())
    normal = face_normals(vertices, topology)[topology.interior_edge_faces[worst]].sum(0)
    length = torch.linalg.vector_norm(normal)
    if not length > 0.0:  # folded back onto itself
        return None
    radius = _RADIUS * float(edge_lengths(vertices, topology).mean())
    return Place(vertices[topology.interior_edges[worst]].mean(0), normal / length, radius)


def part_around(vertices: Tensor, topology: Topology, place: Place) -> Part | None:
    """The faces around a place that look to the same side; None where that is nearly all of the mesh, or nothing."""
    away = torch.linalg.vector_norm(face_centres(vertices, topology) - place.middle.to(vertices), dim=1)
    facing = face_normals(vertices, topology) @ place.normal.to(vertices) > 0.0
    faces = ((away <= place.radius) & facing).nonzero().squeeze(1)
    if not faces.numel() or _LEAST * faces.numel() > topology.num_faces:
        return None
    lists = topology.face_lists()
    return Part(vertices, Topology.from_faces([lists[face] for face in faces.tolist()], topology.num_vertices))
