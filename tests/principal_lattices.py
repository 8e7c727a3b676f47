"""Valence-6 meshes with and without singular vertices, and lattices with their principal edges."""

from __future__ import annotations

import numpy as np
import torch

from torchfair import Topology
from torchfair.shapes import Catenoid, Enneper, ShapeMesh, Torus, principal_triangles


def cone(sectors: int, rings: int, *, apex: bool = True) -> Topology:
    """A lattice cone whose apex, vertex 0, has valence ``sectors``; without apex, the hole around it."""

    def number(ring: int, place: int) -> int:
        return 1 + sectors * ring * (ring - 1) // 2 + place % (sectors * ring) if ring else 0

    faces = []
    for ring in range(0 if apex else 1, rings):
        for s in range(sectors):
            inner, outer = s * ring, s * (ring + 1)
            for j in range(ring + 1):
                faces.append([number(ring, inner + j), number(ring + 1, outer + j), number(ring + 1, outer + j + 1)])
            for j in range(ring):
                faces.append([number(ring, inner + j), number(ring + 1, outer + j + 1), number(ring, inner + j + 1)])
    shift = 0 if apex else 1
    return Topology.from_faces((np.array(faces) - shift).tolist())


def twisted_torus(rows: int, columns: int, shift: int) -> Topology:
    """A valence-6 torus; going round through all rows arrives ``shift`` columns further on."""

    def number(i: int, j: int) -> int:
        return i % rows * columns + (j + i // rows * shift) % columns

    faces = []
    for i in range(rows):
        for j in range(columns):
            a, b, c, d = number(i, j), number(i + 1, j), number(i + 1, j + 1), number(i, j + 1)
            faces += [[a, b, c], [a, c, d]]
    return Topology.from_faces(faces)


def relabelled(topology: Topology, seed: int) -> tuple[Topology, torch.Tensor]:
    """The same mesh with other vertex and face numbers and first corners, and the new number of each vertex."""
    rng = np.random.default_rng(seed)
    new = rng.permutation(topology.num_vertices)
    faces = new[topology.triangles.numpy()][rng.permutation(topology.num_faces)]
    turn = (np.arange(3) + rng.integers(0, 3, (len(faces), 1))) % 3
    return Topology.from_faces(np.take_along_axis(faces, turn, 1), topology.num_vertices), torch.from_numpy(new)


def shelf() -> dict[str, tuple[ShapeMesh, str]]:
    """Lattices on surfaces of three kinds, with either end and in both directions."""
    meshes = {}
    for surface in (Torus(), Catenoid(), Enneper()):
        for along in ("u", "v"):
            for ends in ("straight", "zigzag"):
                mesh = principal_triangles(surface, 6, 8, along=along, ends=ends)
                meshes[f"{type(surface).__name__} {along} {ends}"] = (mesh, along)
    return meshes


LATTICES = shelf()
