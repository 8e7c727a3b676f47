"""Subdivision by the book, one vertex after the other, in Python loops over dictionaries."""

from __future__ import annotations

import math

import numpy as np
import torch
from helpers import grid_faces, split_quads
from torch import Tensor

from torchfair import Topology

Points = np.ndarray


class Book:
    """Faces, edges and neighbours of a mesh found from its face lists alone."""

    def __init__(self, vertices: Tensor, topology: Topology, corners: Tensor | None, rule: str) -> None:
        self.points = vertices.numpy()
        self.faces = topology.face_lists()
        self.rule = rule
        self.fixed = {v for v in range(len(self.points)) if corners is not None and bool(corners[v])}
        self.edge_faces: dict[tuple[int, int], list[int]] = {}
        self.after: dict[int, int] = {}  # along the boundary
        self.before: dict[int, int] = {}
        directed = {(f[i - 1], f[i]) for f in self.faces for i in range(len(f))}
        for number, face in enumerate(self.faces):
            for i in range(len(face)):
                v, w = sorted((face[i - 1], face[i]))
                self.edge_faces.setdefault((v, w), []).append(number)
                if (face[i], face[i - 1]) not in directed:
                    self.after[face[i - 1]], self.before[face[i]] = face[i], face[i - 1]

    def centroid(self, face: int) -> Points:
        return sum(self.points[v] for v in self.faces[face]) / len(self.faces[face])

    def faces_at(self, v: int) -> list[int]:
        return [number for number, face in enumerate(self.faces) if v in face]

    def neighbours(self, v: int) -> list[int]:
        return [a + b - v for a, b in self.edge_faces if v in (a, b)]

    def boundary_vertex(self, v: int) -> Points:
        if self.rule != "curve" or v in self.fixed:
            return self.points[v]
        return (self.points[self.before[v]] + 6 * self.points[v] + self.points[self.after[v]]) / 8

    def boundary_edge(self, a: int, b: int) -> Points:
        """By Lagrange interpolation through the vertices at hand."""
        run = [(0, a), (1, b)]
        if self.rule == "interpolate" and a not in self.fixed:
            run.append((-1, self.before[a]))
        if self.rule == "interpolate" and b not in self.fixed:
            run.append((2, self.after[b]))
        weights = [math.prod((0.5 - s) / (t - s) for s, _ in run if s != t) for t, _ in run]
        return sum(weight * self.points[v] for weight, (_, v) in zip(weights, run, strict=True))

    def is_centred(self, face: int, scheme: str) -> bool:
        return scheme == "catmull_clark" or (scheme == "hybrid" and len(self.faces[face]) > 3)

    def inner_edge(self, v: int, w: int, scheme: str) -> Points:
        halves = []
        for face in self.edge_faces[min(v, w), max(v, w)]:
            ends = self.points[v] + self.points[w]
            if self.is_centred(face, scheme):
                halves.append(ends / 8 + self.centroid(face) / 4)
            else:
                (opposite,) = set(self.faces[face]) - {v, w}
                halves.append(3 * ends / 16 + self.points[opposite] / 8)
        return halves[0] + halves[1]

    def inner_vertex(self, v: int, scheme: str) -> Points:
        here, around, faces = self.points[v], self.neighbours(v), self.faces_at(v)
        n = len(around)
        centred = [face for face in faces if self.is_centred(face, scheme)]
        if not centred:
            keep = (3 / 8 + math.cos(2 * math.pi / n) / 4) ** 2 + 3 / 8
            return keep * here + (1 - keep) * sum(self.points[w] for w in around) / n
        if len(centred) == n:
            mean_centroid = sum(self.centroid(face) for face in faces) / n
            mean_middle = sum((here + self.points[w]) / 2 for w in around) / n
            return (mean_centroid + 2 * mean_middle + (n - 3) * here) / n
        weighted = [(1.0, here)]
        weighted += [(0.5, (here + self.points[w]) / 2) for w in around]
        weighted += [(0.25, self.centroid(face)) for face in centred]
        return sum(weight * x for weight, x in weighted) / sum(weight for weight, _ in weighted)


def reference_positions(
    vertices: Tensor, topology: Topology, scheme: str, rule: str = "curve", corners: Tensor | None = None
) -> Points:
    """Fine vertices: old ones, then edges in the order of ``topology.edges``, then faces with a vertex."""
    book = Book(vertices, topology, corners, rule)
    rows = []
    for v in range(len(book.points)):
        if v in book.fixed or not book.neighbours(v):
            rows.append(book.points[v])
        elif v in book.after:
            rows.append(book.boundary_vertex(v))
        else:
            rows.append(book.inner_vertex(v, scheme))
    for v, w in topology.edges.tolist():
        if len(book.edge_faces[min(v, w), max(v, w)]) == 1:
            rows.append(book.boundary_edge(v, w))
        else:
            rows.append(book.inner_edge(v, w, scheme))
    rows += [book.centroid(face) for face in range(len(book.faces)) if book.is_centred(face, scheme)]
    return np.array(rows)


def reference_faces(topology: Topology, scheme: str) -> list[set[tuple[int, ...]]]:
    """Children of every face, each turned so that it starts with its smallest vertex."""
    number = {}
    for e, (v, w) in enumerate(topology.edges.tolist()):
        number[v, w] = number[w, v] = topology.num_vertices + e
    middle = topology.num_vertices + topology.num_edges
    result = []
    for face in topology.face_lists():
        leaving = [number[face[i], face[(i + 1) % len(face)]] for i in range(len(face))]
        if scheme == "catmull_clark" or len(face) > 3:
            children = [(v, leaving[i], middle, leaving[i - 1]) for i, v in enumerate(face)]
            middle += 1
        else:
            children = [(v, leaving[i], leaving[i - 1]) for i, v in enumerate(face)] + [tuple(leaving)]
        result.append({turned(child) for child in children})
    return result


def turned(face: tuple[int, ...]) -> tuple[int, ...]:
    start = face.index(min(face))
    return (*face[start:], *face[:start])


def lattice(rows: int, columns: int, *, triangles: bool) -> tuple[Tensor, Topology]:
    """A flat sheared regular lattice."""
    faces = grid_faces(rows, columns)
    i, j = np.meshgrid(np.arange(rows), np.arange(columns), indexing="ij")
    points = np.stack([i + 0.3 * j, 0.8 * j, 0 * i], axis=-1).reshape(-1, 3)
    return torch.from_numpy(points), Topology.from_faces(split_quads(faces) if triangles else faces)


def lattice_corners(topology: Topology, columns: int) -> Tensor:
    mask = torch.zeros(topology.num_vertices, dtype=torch.bool)
    mask[[0, columns - 1, -columns, -1]] = True
    return mask
