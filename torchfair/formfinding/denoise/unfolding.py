"""Faces that noise has flipped, and inequalities that turn them back."""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.linalg import cross, vector_norm

from ...geometry import face_area_vectors
from ...projection import ElementTerm, OneSided
from ...topology import Topology
from .neighbourhoods import Neighbourhoods, smoothed_area_vectors

_RELIABLE = 0.2  # of the sum of areas around, the length of the sum of area vectors
_LEAST_SHARE = 0.1  # of the mean area around, in the direction of the smoothed normal
_LEAST_HEIGHT = 0.5  # of the noise, for faces thinner than that


@dataclass(frozen=True)
class Sides:
    """Which side of every face is the outer one, from what is around it.

    Attributes:
        normals: (F, 3) unit normals smoothed over two rings and more; zero where they are not reliable.
        areas: (F,) mean area of the faces around.
    """

    normals: Tensor
    areas: Tensor

    @classmethod
    def of(cls, vertices: Tensor, topology: Topology, near: Neighbourhoods) -> Sides:
        """Of a mesh (V, 3), which may be noisy."""
        vectors, areas = smoothed_area_vectors(vertices, topology, near)
        counts = near.sums(torch.bincount(topology.corners, minlength=topology.num_vertices).to(areas))
        gathered = torch.cat([vectors, areas[:, None], counts[:, None]], dim=1)[topology.corners]
        total = gathered.new_zeros(topology.num_faces, 5).index_add_(0, topology.corner_faces, gathered)
        length = vector_norm(total[:, :3], dim=1)
        reliable = length > _RELIABLE * total[:, 3]
        normals = torch.where(reliable[:, None], total[:, :3] / length.clamp_min(1e-300)[:, None], 0.0)
        return cls(normals, total[:, 3] / total[:, 4].clamp_min(1.0))

    def flipped(self, vertices: Tensor, topology: Topology) -> Tensor:
        """(F,) bool, faces that show their inner side; none where normals are not reliable."""
        seen = (face_area_vectors(vertices, topology) * self.normals).sum(1)
        return (seen <= 0.0) & (self.normals != 0.0).any(1)

    def unfolding_terms(
        self, vertices: Tensor, topology: Topology, noise: float, *, weight: float, block: str = "vertices"
    ) -> list[ElementTerm]:
        """Inequalities: seen along its smoothed normal, every face shows a tenth of the mean area around or more.

        Less is asked of slender faces: half the noise times their longest edge. Nothing where normals are not reliable.

        Args:
            vertices: (V, 3) noisy, with unit mean edge length.
            topology: Any polygon mesh.
            noise: Standard deviation, in mean edges.
            weight: Dimensionless.
            block: Name of the vertex block.
        """
        terms = []
        for numbers, corners in topology.faces_by_size.values():
            sides = vertices[corners].roll(-1, 1) - vertices[corners]
            slender = _LEAST_HEIGHT * noise * vector_norm(sides, dim=2).amax(1)
            least = torch.minimum(_LEAST_SHARE * self.areas[numbers], slender)
            known = (self.normals[numbers] != 0.0).any(1)
            data = (self.normals[numbers][known], least[known])
            terms.append(
                ElementTerm(
                    "unfolding",
                    missing_area,
                    [(block, corners[known])],
                    data=data,
                    weight=weight,
                    loss=OneSided(),
                    jacobian=missing_area_gradient,
                    batched=True,
                )
            )
        return terms if weight > 0.0 else []


def missing_area(x: Tensor, normal: Tensor, least: Tensor) -> Tensor:
    """(n,) by how much polygons ``x`` (n, k, 3), seen along ``normal`` (n, 3), show less area than ``least`` (n,)."""
    spokes = x[:, 1:] - x[:, :1]
    vector = 0.5 * cross(spokes[:, :-1], spokes[:, 1:]).sum(1)
    missing: Tensor = least - (vector * normal).sum(1)
    return missing


def missing_area_gradient(x: Tensor, normal: Tensor, least: Tensor) -> Tensor:
    """(n, 3k) derivatives of :func:`missing_area`: a corner adds area across the line through its neighbours."""
    across = x.roll(-1, 1) - x.roll(1, 1)
    gradient: Tensor = 0.5 * cross(normal[:, None].expand_as(x), across).flatten(1)
    return gradient
