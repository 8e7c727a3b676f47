"""Meshes and comparisons for the tests of quantities and energies."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import torch
from helpers import DOUBLE, cube, tetrahedron, wavy_grid
from scipy.spatial import ConvexHull
from torch import Tensor

from torchfair import Topology

Mesh = tuple[Tensor, Topology]


def icosphere(level: int) -> Mesh:
    """Icosahedron split ``level`` times, inscribed in the unit sphere, faces outward."""
    golden = (1 + math.sqrt(5)) / 2
    rows = [(-1, golden, 0), (1, golden, 0), (-1, -golden, 0), (1, -golden, 0)]
    points = np.array(rows + [r[-1:] + r[:-1] for r in rows] + [r[-2:] + r[:-2] for r in rows], float)
    faces = outward_hull(points)
    points = points / np.linalg.norm(points, axis=1, keepdims=True)
    for _ in range(level):
        sides = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
        pairs, number = np.unique(sides, axis=0, return_inverse=True)
        middle = points[pairs].sum(1)
        a, b, c = faces.T
        ab, bc, ca = (number.reshape(-1, 3) + len(points)).T
        points = np.concatenate([points, middle / np.linalg.norm(middle, axis=1, keepdims=True)])
        faces = np.concatenate([np.stack(f, 1) for f in [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]])
    return torch.from_numpy(points), Topology.from_faces(faces)


def outward_hull(points: np.ndarray) -> np.ndarray:
    """Triangles of the convex hull of ``points``, outward."""
    hull = ConvexHull(points)
    faces = hull.simplices.copy()
    a, b, c = points[faces].transpose(1, 0, 2)
    inward = np.einsum("ij,ij->i", np.cross(b - a, c - a), hull.equations[:, :3]) < 0
    faces[inward] = faces[inward][:, ::-1]
    return faces.astype(np.int64)


def random_polytope(seed: int, count: int = 14) -> Mesh:
    """Convex hull of points on a random ellipsoid, as triangles."""
    random = np.random.default_rng(seed)
    points = random.normal(size=(count, 3))
    points = points / np.linalg.norm(points, axis=1, keepdims=True) * random.uniform(0.5, 2, 3)
    return torch.from_numpy(points), Topology.from_faces(outward_hull(points))


def capped_prism(sides: int, radius: float = 1.0, height: float = 3.0) -> Mesh:
    """Prism over a regular polygon: quads and two polygons, outward."""
    angle = 2 * math.pi * np.arange(sides) / sides
    ring = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=1)
    points = np.concatenate([np.c_[ring, np.zeros(sides)], np.c_[ring, np.full(sides, height)]])
    following = np.roll(np.arange(sides), -1)
    lateral = np.stack([np.arange(sides), following, following + sides, np.arange(sides) + sides], axis=1)
    faces = [*lateral.tolist(), list(range(sides))[::-1], list(range(sides, 2 * sides))]
    return torch.from_numpy(points), Topology.from_faces(faces)


def torus(rows: int = 8, columns: int = 6, big: float = 3.0, small: float = 1.0) -> Mesh:
    """Principal quad mesh of a torus, outward."""
    u, v = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    index = lambda i, j: (i % rows) * columns + j % columns  # noqa: E731
    faces = np.stack([index(u, v), index(u + 1, v), index(u + 1, v + 1), index(u, v + 1)], -1).reshape(-1, 4)
    a, b = 2 * math.pi * u / rows, 2 * math.pi * v / columns
    distance = big + small * np.cos(b)
    points = np.stack([distance * np.cos(a), distance * np.sin(a), small * np.sin(b)], axis=-1).reshape(-1, 3)
    return torch.from_numpy(points), Topology.from_faces(faces)


def mixed_grid(seed: int = 0) -> Mesh:
    """Perturbed grid of triangles, quads that are not planar and one hexagon, with boundary."""
    vertices, topology = wavy_grid(5, 5, seed=seed)
    quads = topology.face_lists()
    a, b, c, d = quads[0]
    hexagon = [6, 11, 12, 13, 8, 7]  # quads 5 and 6 in one
    return vertices, Topology.from_faces([[a, b, c], [a, c, d], hexagon, *quads[1:5], *quads[7:]])


def flat_pair() -> Mesh:
    """Two triangles of height 1 over their common edge (0, 1) of length 2, exactly flat, normals +z."""
    points = [[0.0, 0, 0], [2, 0, 0], [1, 1, 0], [1, -1, 0]]
    return torch.tensor(points, dtype=DOUBLE), Topology.from_faces([[0, 1, 2], [1, 0, 3]])


def flat_squares() -> Mesh:
    """Two unit squares with the common edge (0, 1) along x, exactly flat, normals +z."""
    points = [[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, -1, 0], [1, -1, 0]]
    return torch.tensor(points, dtype=DOUBLE), Topology.from_faces([[0, 1, 2, 3], [1, 0, 4, 5]])


def with_isolated(mesh: Mesh) -> Mesh:
    """The mesh with a vertex that no face uses, at the end."""
    vertices, topology = mesh
    more = torch.cat([vertices, torch.tensor([[0.3, 0.4, 0.5]], dtype=vertices.dtype)])
    return more, Topology.from_faces(topology.face_lists(), num_vertices=topology.num_vertices + 1)


def collinear_face() -> Mesh:
    """A bent pair of triangles and a third one beside them whose three corners lie on a line."""
    points = [[0.0, 0, 0], [2, 0, 0], [1, 1, 0.5], [1, -1, 0], [3, -1, 0]]
    points[4] = [0.0, -2, 0]  # on the line through vertices 1 and 3
    return torch.tensor(points, dtype=DOUBLE), Topology.from_faces([[0, 1, 2], [1, 0, 3], [1, 3, 4]])


def coincident_corners() -> Mesh:
    """A wavy triangle grid with two neighbouring vertices in one place."""
    vertices, topology = wavy_grid(4, 4, triangles=True)
    vertices = vertices.clone()
    vertices[5] = vertices[6]
    return vertices, topology


def collapsed() -> Mesh:
    """All vertices in one place."""
    vertices, topology = mixed_grid()
    return torch.ones_like(vertices), topology


GENERIC: dict[str, Callable[[], Mesh]] = {
    "triangles": lambda: wavy_grid(4, 4, triangles=True),
    "quads": lambda: wavy_grid(4, 3),
    "mixed": mixed_grid,
    "closed": tetrahedron,
}

DEGENERATE: dict[str, Callable[[], Mesh]] = {
    "flat triangles": flat_pair,
    "flat squares": flat_squares,
    "flat faces of a split cube": lambda: split_faces(cube()),
    "isolated vertex": lambda: with_isolated(mixed_grid()),
    "collinear face": collinear_face,
    "coincident corners": coincident_corners,
    "collapsed": collapsed,
    "single face": lambda: (tetrahedron()[0][:3], Topology.from_faces([[0, 1, 2]])),
    "no faces": lambda: (tetrahedron()[0], Topology.from_faces([], num_vertices=4)),
}


def split_faces(mesh: Mesh, seed: int = 0) -> Mesh:
    """The mesh with every face cut into a fan of triangles from one of its corners, chosen at random."""
    vertices, topology = mesh
    random = np.random.default_rng(seed)
    triangles = []
    for face in topology.face_lists():
        turn = int(random.integers(len(face)))
        face = face[turn:] + face[:turn]
        triangles += [[face[0], face[k], face[k + 1]] for k in range(1, len(face) - 1)]
    return vertices, Topology.from_faces(triangles, num_vertices=topology.num_vertices)


def edge_table(topology: Topology, values: Tensor) -> dict[tuple[int, int], Tensor]:
    """Values (N, ...) of the first N edges by their sorted vertex numbers."""
    pairs = topology.edges[: values.shape[0]].sort(1).values.tolist()
    return {(v, w): value for (v, w), value in zip(pairs, values, strict=True)}
