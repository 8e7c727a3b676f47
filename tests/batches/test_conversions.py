"""Meshes of other libraries, by the libraries where they are installed, else by objects with their attributes."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import pytest
import torch
from helpers import DOUBLE, wavy_grid

from torchfair import MeshBatch, MeshError, NormalVariation, Topology, TorchfairError
from torchfair.conversions import (
    as_compas,
    as_kaolin,
    as_pytorch3d,
    as_torch_geometric,
    as_trimesh,
    from_compas,
    from_kaolin,
    from_pytorch3d,
    from_torch_geometric,
    from_trimesh,
)
from torchfair.shapes import icosphere

TRIANGLES, QUADS, SPHERE = wavy_grid(4, 3, triangles=True), wavy_grid(3, 5), icosphere(1)
BATCH = MeshBatch.of([TRIANGLES, SPHERE])


def equal(first: MeshBatch, second: MeshBatch) -> bool:
    return first.topology == second.topology and torch.equal(first.vertices, second.vertices)


class Meshes:
    """What ``pytorch3d.structures.Meshes`` documents: lists in, lists out."""

    def __init__(self, verts: list[torch.Tensor], faces: list[torch.Tensor]) -> None:
        self._verts, self._faces = verts, faces

    def verts_list(self) -> list[torch.Tensor]:
        return self._verts

    def faces_list(self) -> list[torch.Tensor]:
        return self._faces


class SurfaceMesh(SimpleNamespace):
    """What ``kaolin.rep.SurfaceMesh`` documents: attributes, as tensors or lists by its batching."""

    vertices: Any
    faces: Any


def test_pytorch3d_there_and_back() -> None:
    assert equal(from_pytorch3d(Meshes(**as_pytorch3d(BATCH))), BATCH)
    with pytest.raises(MeshError, match="triangle mesh is needed"):
        as_pytorch3d(MeshBatch.of([QUADS]))
    with pytest.raises(TorchfairError, match="int is not a mesh of PyTorch3D: it has no verts_list and no faces_list"):
        from_pytorch3d(3)
    bow_tie = Meshes(
        [TRIANGLES[0], torch.zeros(5, 3, dtype=DOUBLE)], [TRIANGLES[1].triangles, torch.tensor([[0, 1, 2], [0, 3, 4]])]
    )
    with pytest.raises(MeshError, match=r"mesh 1: .*more than one fan"):
        from_pytorch3d(bow_tie)
    assert len(from_pytorch3d(bow_tie, manifold="edges")) == 2


def test_pytorch3d_keeps_derivatives() -> None:
    variable = BATCH.vertices.clone().requires_grad_()
    again = from_pytorch3d(Meshes(**as_pytorch3d(BATCH.with_vertices(variable))))
    NormalVariation(again.topology, reduction="sum")(again.vertices).backward()
    assert variable.grad is not None
    assert (variable.grad != 0).any(1).all()


def test_kaolin_there_and_back() -> None:
    listed = SurfaceMesh(**as_kaolin(BATCH))
    assert equal(from_kaolin(listed), BATCH)
    one = SurfaceMesh(vertices=TRIANGLES[0], faces=TRIANGLES[1].triangles)
    assert equal(from_kaolin(one), MeshBatch.of([TRIANGLES]))
    fixed = SurfaceMesh(vertices=torch.stack([QUADS[0], 2 * QUADS[0]]), faces=QUADS[1].corners.view(-1, 4))
    assert equal(from_kaolin(fixed), MeshBatch.of([QUADS, (2 * QUADS[0], QUADS[1])]))
    hybrid = Topology.from_faces([[0, 1, 2], [0, 2, 3, 4]])
    with pytest.raises(MeshError, match="mesh 1 has faces of 2 sizes"):
        as_kaolin(MeshBatch.of([TRIANGLES, (torch.zeros(5, 3, dtype=DOUBLE), hybrid)]))


def test_torch_geometric_by_attributes() -> None:
    vertices, topology = TRIANGLES
    found = as_torch_geometric(vertices, topology)
    assert found["edge_index"].shape == (2, 2 * topology.num_edges)
    assert {tuple(e) for e in found["edge_index"].T.tolist()} == {
        tuple(e) for e in found["edge_index"].flip(0).T.tolist()
    }
    assert equal(from_torch_geometric(SimpleNamespace(**found)), MeshBatch.of([TRIANGLES]))
    assert "face" not in as_torch_geometric(*QUADS)
    with pytest.raises(TorchfairError, match="not a mesh of PyTorch Geometric"):
        from_torch_geometric(SimpleNamespace(pos=vertices, face=None))
    with pytest.raises(MeshError, match="takes one mesh"):
        as_torch_geometric(BATCH.vertices, BATCH.topology)


def test_torch_geometric_itself() -> None:
    data = pytest.importorskip("torch_geometric.data")
    meshes = [data.Data(**as_torch_geometric(*mesh)) for mesh in BATCH]
    assert equal(from_torch_geometric(data.Batch.from_data_list(meshes)), BATCH)
    assert equal(from_torch_geometric(meshes[1]), BATCH[1:])
    empty = data.Data(**as_torch_geometric(torch.zeros(2, 3, dtype=DOUBLE), Topology.from_faces([], 2)))
    three = data.Batch.from_data_list([meshes[0], empty, meshes[1]])
    assert from_torch_geometric(three).topology.mesh_sizes == [12, 2, 42]
    with pytest.raises(TorchfairError, match="not a mesh of PyTorch Geometric"):
        from_torch_geometric(data.Data(pos=torch.zeros(2, 3)))


def test_trimesh_itself() -> None:
    trimesh = pytest.importorskip("trimesh")
    vertices, topology = from_trimesh(trimesh.Trimesh(**as_trimesh(*TRIANGLES)))
    assert topology == TRIANGLES[1]
    assert torch.equal(vertices, TRIANGLES[0])
    box = from_trimesh(trimesh.creation.box())
    assert (box[1].num_vertices, box[1].num_faces) == (8, 12)
    with pytest.raises(TorchfairError, match="not a mesh of trimesh"):
        from_trimesh(object())
    with pytest.raises(MeshError, match="triangle mesh"):
        as_trimesh(*QUADS)
    changed = trimesh.Trimesh(**as_trimesh(*TRIANGLES))
    changed.vertices[0] += 1.0
    assert TRIANGLES[0][0, 0] == vertices[0, 0]


class Polyhedron:
    """What ``compas.datastructures.Mesh`` documents."""

    def __init__(self, vertices: list[list[float]], faces: list[list[int]]) -> None:
        self.both = vertices, faces

    def to_vertices_and_faces(self) -> tuple[list[list[float]], list[list[int]]]:
        return self.both


def test_compas_by_attributes() -> None:
    vertices, topology = from_compas(Polyhedron(**as_compas(*QUADS)))
    assert topology == QUADS[1]
    assert torch.equal(vertices, QUADS[0])
    with pytest.raises(TorchfairError, match="not a mesh of compas: it has no to_vertices_and_faces"):
        from_compas([])


def test_compas_itself() -> None:
    structures = pytest.importorskip("compas.datastructures")
    mesh = structures.Mesh.from_vertices_and_faces(**as_compas(*QUADS))
    vertices, topology = from_compas(mesh)
    assert topology == QUADS[1]
    assert torch.equal(vertices, QUADS[0])
    mesh.delete_face(0)
    mesh.remove_unused_vertices()
    assert from_compas(mesh)[1].num_faces == QUADS[1].num_faces - 1
    cube = from_compas(structures.Mesh.from_polyhedron(6))[1]
    assert (cube.num_faces, cube.num_edges, cube.num_interior_edges) == (6, 12, 12)
