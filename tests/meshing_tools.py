"""Surfaces for tests of fields and meshing."""

from __future__ import annotations

import random

import numpy as np
import torch
from torch import Tensor

from torchfair import Topology
from torchfair.fields import FaceFrames, direction_field, directions_of, matchings, merge_singularities, vertex_charges
from torchfair.meshing.boundary_runs import find_runs
from torchfair.meshing.cut_graph import CutGraph, cut_open
from torchfair.meshing.integers import split_integers
from torchfair.meshing.seamless_map import MapProblem
from torchfair.meshing.seams import find_seams
from torchfair.shapes import Surface, irregular_triangles

Mesh = tuple[Tensor, Topology]


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


def cut(vertices: Tensor, topology: Topology, smoothing: float = 0.05) -> tuple[FaceFrames, CutGraph]:
    """A mesh cut open with its field of crosses."""
    frames = FaceFrames.of(vertices, topology)
    directions = directions_of(frames)
    angles = direction_field(frames, directions, smoothing, 4)
    matched = matchings(frames, angles)
    angles, matched = merge_singularities(frames, angles, matched, directions, smoothing, 0.2)
    return frames, cut_open(frames, angles, matched, vertex_charges(frames, angles, matched))


def problem_of(frames: FaceFrames, graph: CutGraph, spacing: float, align: bool = False) -> tuple[MapProblem, list]:
    """The problem of a map with squares, and its boundary runs."""
    seams = find_seams(frames, graph)
    runs = find_runs(frames, graph, np.radians(12), 1.5 * spacing) if align else []
    count = len(frames.triangles)
    split = split_integers(frames, graph, seams, runs)
    density, stiff = np.full((count, 2), 1 / spacing), np.full(count, 30.0)
    return MapProblem(frames, graph, seams, split, np.eye(2), density, stiff), runs


def shuffled(vertices: Tensor, topology: Topology, seed: int) -> Mesh:
    """The same with other numbers of vertices and faces, and faces that start at other corners."""
    chance = random.Random(seed)
    order = chance.sample(range(len(vertices)), len(vertices))
    number = {old: new for new, old in enumerate(order)}
    faces = []
    for _, corners in topology.faces_by_size.values():
        for face in corners.tolist():
            first = chance.randrange(len(face))
            faces.append([number[vertex] for vertex in face[first:] + face[:first]])
    chance.shuffle(faces)
    return vertices[torch.tensor(order)], Topology.from_faces(faces, len(vertices))
