"""Lattices to start principal-symmetric design from, and handles that pull them."""

from __future__ import annotations

import torch

from torchfair.formfinding.symmetric.measures import condition_residuals
from torchfair.geometry import vertex_normals
from torchfair.principal import PrincipalEdges, principal_edges_of_lattice
from torchfair.shapes import Catenoid, Enneper, Torus, principal_triangles

STARTS = {
    "torus": lambda: principal_triangles(Torus(2.0, 1.0), 10, 14),
    "catenoid": lambda: principal_triangles(Catenoid(), 8, 16, along="v", ends="zigzag"),
    "enneper": lambda: principal_triangles(Enneper(0.8), 10, 10, ends="zigzag"),
}


def start(name: str) -> tuple[torch.Tensor, PrincipalEdges]:
    mesh = STARTS[name]()
    return mesh.vertices, principal_edges_of_lattice(mesh, "v" if name == "catenoid" else "u").check()


def pulled(vertices: torch.Tensor, edges: PrincipalEdges, share: float) -> dict[int, list[float]]:
    """One star pulled along its normal by a share of the size, the vertex farthest from it kept."""
    stars = edges.stars().vertices
    vertex = int(stars[len(stars) // 3])
    size = float((vertices.amax(0) - vertices.amin(0)).max())
    far = int((vertices - vertices[vertex]).norm(dim=1).argmax())
    place = vertices[vertex] + share * size * vertex_normals(vertices, edges.topology)[vertex]
    return {vertex: place.tolist(), far: vertices[far].tolist()}


def largest(vertices: torch.Tensor, edges: PrincipalEdges) -> float:
    return max(float(part.max()) for part in condition_residuals(vertices, edges, edges.stars()).values())
