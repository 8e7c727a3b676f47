"""Prescribed tangent planes along the boundary."""

from __future__ import annotations

import torch
from torch import Tensor
from torch.linalg import cross, vector_norm

from ..projection import ElementTerm
from ..topology import Topology


def tilt(x: Tensor, first: Tensor, second: Tensor) -> Tensor:
    """Components of the unit normal of an open star along two directions: sines of the angles it tilts by.

    ``x[0]`` is the vertex, ``x[1:]`` its ring; the normal is that of the sum of its area vectors.
    """
    spokes = x[1:] - x[0]
    area = cross(spokes[:-1], spokes[1:]).sum(0)
    normal = area / vector_norm(area)
    return torch.stack([torch.dot(normal, first), torch.dot(normal, second)])


def tangent_plane_terms(
    topology: Topology, vertices: Tensor, normals: Tensor, *, weight: float, block: str = "vertices"
) -> list[ElementTerm]:
    """Turns the stars of boundary ``vertices`` (n,) until their normals are ``normals`` (n, 3), unit vectors.

    The residual is an angle in radians (its sine); opposite normals are not told apart, so the start must be
    on the right side.

    Args:
        topology: Triangle mesh.
        vertices: Numbers of boundary vertices.
        normals: Unit normals of the prescribed planes.
        weight: Dimensionless.
        block: Name of the vertex block.
    """
    first, second = tangent_frames(normals)
    terms = []
    valences = topology.valences[vertices]
    for valence in torch.unique(valences[valences > 1]).tolist():
        chosen = torch.nonzero(valences == valence).squeeze(1)
        places = topology.ring_offsets[vertices[chosen], None] + torch.arange(valence)
        stencil = torch.cat([vertices[chosen, None], topology.ring_vertices[places]], dim=1)
        data = (first[chosen], second[chosen])
        terms.append(ElementTerm("tangent planes", tilt, [(block, stencil)], data=data, weight=weight))
    return terms


def tangent_frames(normals: Tensor) -> tuple[Tensor, Tensor]:
    """Two unit vectors (n, 3) orthogonal to unit ``normals`` and to each other."""
    smallest = normals.abs().argmin(1)
    helper = torch.eye(3, dtype=normals.dtype)[smallest]
    first = cross(normals, helper)
    first = first / vector_norm(first, dim=1, keepdim=True)
    return first, cross(normals, first)
