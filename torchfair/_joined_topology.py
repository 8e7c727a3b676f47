"""Index tensors of several topologies side by side, and apart again."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Sequence
from typing import TypeVar

import torch
from torch import Tensor

from ._topology_tables import MeshTables
from .errors import MeshError

Tensors = dict[str, Tensor]
Kind = TypeVar("Kind", bound=MeshTables)


def checked_parts(parts: Iterable[Kind], kind: type[Kind]) -> list[Kind]:
    """A list of topologies on one device; MeshError for anything else."""
    result = list(parts) if isinstance(parts, Iterable) else [parts]
    for number, part in enumerate(result):
        if not isinstance(part, kind):
            raise MeshError(f"topologies to join: number {number} is no Topology but {type(part).__name__}")
    devices = {str(part.device): number for number, part in reversed(list(enumerate(result)))}
    if len(devices) > 1:
        places = ", ".join(f"number {number} on {device}" for device, number in sorted(devices.items()))
        raise MeshError(f"topologies to join are on several devices: {places}. Move them to one with .to(device).")
    return result


def joined_tensors(parts: Sequence[MeshTables]) -> Tensors:
    """The index tensors of all parts side by side: those that building from all faces would give."""
    device = parts[0].device if parts else torch.device("cpu")
    vertices, faces = [p.num_vertices for p in parts], [p.num_faces for p in parts]
    corners = [p.corners.shape[0] for p in parts]
    inner = [p.num_interior_edges for p in parts]
    outer = [p.num_edges - p.num_interior_edges for p in parts]

    def shift(by: Sequence[int], counts: Sequence[int]) -> Tensor:
        """``by[i]`` for each of the elements of part i."""
        amounts, repeats = (torch.tensor(list(numbers), dtype=torch.int64) for numbers in (by, counts))
        return torch.repeat_interleave(amounts, repeats).to(device)

    def together(tensors: Iterable[Tensor], *shape: int) -> Tensor:
        return torch.cat([torch.zeros(0, *shape, dtype=torch.int64, device=device), *tensors])

    edges = together(p.corner_edges for p in parts)
    behind = [sum(inner) + before - own for before, own in zip(_starts(outer), inner, strict=True)]
    is_inner = edges < shift(inner, corners)
    ends = together([*(p.interior_edges for p in parts), *(p.boundary_edges for p in parts)], 2)
    first = torch.zeros(1, dtype=torch.int64, device=device)
    meshes = [p.num_meshes for p in parts]
    stops = together(part_stops(p) for p in parts) + shift(_starts(vertices), meshes)
    return {
        "corners": together(p.corners for p in parts) + shift(_starts(vertices), corners),
        "face_offsets": torch.cat(
            [first, together(p.face_offsets[1:] for p in parts) + shift(_starts(corners), faces)]
        ),
        "corner_faces": together(p.corner_faces for p in parts) + shift(_starts(faces), corners),
        "corner_edges": edges + torch.where(is_inner, shift(_starts(inner), corners), shift(behind, corners)),
        "edges": ends + shift(_starts(vertices) * 2, inner + outer)[:, None],
        "interior_edge_faces": together((p.interior_edge_faces for p in parts), 2)
        + shift(_starts(faces), inner)[:, None],
        "mesh_offsets": torch.cat([first, stops]),
    }


def part_stops(topology: MeshTables) -> Tensor:
    """One more than the last vertex of each of its meshes."""
    if topology.mesh_offsets is not None:
        return topology.mesh_offsets[1:]
    return torch.full((1,), topology.num_vertices, dtype=torch.int64, device=topology.device)


def split_tensors(topology: MeshTables) -> list[tuple[int, Tensors]]:
    """Number of vertices and index tensors of each mesh of a joined topology."""
    assert topology.mesh_offsets is not None
    count = topology.num_meshes
    meshes = topology.vertex_meshes
    vertices = topology.mesh_offsets.tolist()
    faces = _ranges(topology.face_meshes, count)
    inner = _ranges(meshes[topology.interior_edges[:, 0]], count)
    outer = _ranges(meshes[topology.boundary_edges[:, 0]], count)
    corners = topology.face_offsets[torch.tensor(faces, device=topology.device)].tolist()
    return [
        (v[1] - v[0], _one_mesh(topology, v[0], f, h, i, o))
        for v, f, h, i, o in zip(*map(itertools.pairwise, (vertices, faces, corners, inner, outer)), strict=True)
    ]


Range = tuple[int, int]


def _one_mesh(topology: MeshTables, first: int, faces: Range, corners: Range, inner: Range, outer: Range) -> Tensors:
    interior = topology.num_interior_edges
    edges = topology.corner_edges[slice(*corners)]
    behind = interior + outer[0] - (inner[1] - inner[0])
    ends = torch.cat([topology.interior_edges[slice(*inner)], topology.boundary_edges[slice(*outer)]])
    return {
        "corners": topology.corners[slice(*corners)] - first,
        "face_offsets": topology.face_offsets[faces[0] : faces[1] + 1] - corners[0],
        "corner_faces": topology.corner_faces[slice(*corners)] - faces[0],
        "corner_edges": edges - torch.where(edges < interior, inner[0], behind),
        "edges": ends - first,
        "interior_edge_faces": topology.interior_edge_faces[slice(*inner)] - faces[0],
    }


def _ranges(meshes: Tensor, count: int) -> list[int]:
    """Where the elements of each mesh start, and where the last ones end."""
    counts: list[int] = torch.bincount(meshes, minlength=count).tolist()
    return [*_starts(counts), sum(counts)]


def _starts(counts: Sequence[int]) -> list[int]:
    """How many come before each."""
    return [0, *itertools.accumulate(counts)][: len(counts)]
