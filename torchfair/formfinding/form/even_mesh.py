"""Other triangles for a surface that was found: even ones, between the same boundary vertices."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from ...geometry import edge_lengths, face_areas
from ...topology import Topology
from .starting.counting import edge_length, with_so_many
from .starting.patch import Patch
from .starting.plans import ROWS
from .starting.spanning import either_way, onto


class EvenMesh(NamedTuple):
    """Even triangles on a surface.

    Attributes:
        vertices: (V', 3).
        topology: Their connectivity.
        numbers: (V,) of those before that have kept their places; -1 for others.
    """

    vertices: Tensor
    topology: Topology
    numbers: Tensor


def even_mesh(vertices: Tensor, topology: Topology, kept: Tensor, count: int) -> EvenMesh:
    """About ``count`` vertices on the same surface, edges beside the boundary as long as there where that is finer.

    Edges are split, collapsed and flipped and inner vertices evened out, so that no triangle needs to be thin that the
    boundary does not make so; folds of a few faces go, too, as vertices are put on the nearest place of the surface.

    Args:
        vertices: (V, 3) float64, any length unit.
        topology: Triangles.
        kept: (V,) bool, vertices that keep their places, as do those of the boundary.
        count: Wanted.

    Raises:
        MeshError: the faces that come of it are no mesh.
    """
    stays = ((kept | topology.is_boundary_vertex) & (topology.valences > 0)).numpy()
    faces = topology.corners.view(-1, 3).numpy()
    patch = Patch(vertices.numpy(), faces, np.where(stays, 0, -1), np.zeros(len(stays)), stays)
    sides = edge_lengths(vertices, topology)[topology.num_interior_edges :]
    size = edge_length(float(face_areas(vertices, topology).sum()), float(sides.sum()), count)
    middles = vertices[topology.boundary_edges].mean(1)
    sizes = (size, middles.numpy(), ROWS * sides.numpy())
    made = with_so_many(patch, [], count, sizes, either_way, onto(patch), keeps_rim=True)
    numbers = torch.full((len(stays),), -1)
    numbers[torch.from_numpy(stays)] = torch.from_numpy(np.flatnonzero(~made.inside))
    result = Topology.from_faces(torch.from_numpy(made.faces), len(made.points))
    return EvenMesh(torch.from_numpy(made.points), result, numbers)
