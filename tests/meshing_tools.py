"""Surfaces for tests of fields and meshing."""

from __future__ import annotations

import numpy as np
import torch
from torch import Tensor

from torchfair import Topology
from torchfair.shapes import Surface, irregular_triangles


def irregular(surface: Surface, count: int = 700, seed: int = 0) -> tuple[Tensor, Topology]:
    mesh = irregular_triangles(surface, count, seed)
    return mesh.vertices, mesh.topology


class Graph(Surface):
    """The graph of a function of x and y over a square of side 2."""

    domain = ((-1.0, 1.0), (-1.0, 1.0))

    def _position(self, u: Tensor, v: Tensor) -> Tensor:
        return torch.stack([u, v, self.height(u, v)], dim=-1)

    def height(self, u: Tensor, v: Tensor) -> Tensor:
        raise NotImplementedError


class MonkeySaddle(Graph):
    def height(self, u: Tensor, v: Tensor) -> Tensor:
        return (u**3 - 3 * u * v**2) / 4


class Flat(Graph):
    def height(self, u: Tensor, v: Tensor) -> Tensor:
        return 0 * u


def ellipsoid(subdivisions: int = 4) -> tuple[Tensor, Topology]:
    """Of three different axes, from an icosphere turned so that no symmetry is shared."""
    from torchfair.shapes import icosphere

    sphere = icosphere(subdivisions)
    turn = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))[0]
    return sphere.vertices @ torch.from_numpy(turn) * torch.tensor([1.0, 0.8, 0.55]), sphere.topology


def punched(vertices: Tensor, topology: Topology, *centres: int) -> tuple[Tensor, Topology]:
    """Without the faces around vertices."""
    keep = ~torch.isin(topology.triangles, torch.tensor(centres)).any(1)
    numbers, corners = torch.unique(topology.triangles[keep], return_inverse=True)
    return vertices[numbers], Topology.from_faces(corners, len(numbers))


def side_by_side(*meshes: tuple[Tensor, Topology]) -> tuple[Tensor, Topology]:
    """One mesh of several components, apart along x."""
    offset, vertices, faces = 0, [], []
    for number, (points, topology) in enumerate(meshes):
        vertices.append(points + torch.tensor([10.0 * number, 0, 0]))
        faces.append(topology.triangles + offset)
        offset += topology.num_vertices
    return torch.cat(vertices), Topology.from_faces(torch.cat(faces))


def nearest(vertices: Tensor, *places: tuple[float, float]) -> list[int]:
    """Numbers of the vertices nearest to points of the plane z = 0."""
    return [int((vertices[:, :2] - torch.tensor(place)).norm(dim=1).argmin()) for place in places]
