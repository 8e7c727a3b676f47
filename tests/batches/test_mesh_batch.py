"""Batches of meshes: what they hold, what loaders make of samples, padding, moving."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import torch
from helpers import DOUBLE, wavy_grid
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor
from torch.utils.data import DataLoader, Dataset

import torchfair
from torchfair import MeshBatch, MeshError, NormalVariation, ShapeError, Topology, collate
from torchfair.batches import mesh_from_lists
from torchfair.shapes import icosphere

TRIANGLES, QUADS = wavy_grid(4, 3, triangles=True), wavy_grid(3, 5)
BATCH = MeshBatch.of([TRIANGLES, QUADS, icosphere(1)])


def equal(first: MeshBatch, second: MeshBatch) -> bool:
    return first.topology == second.topology and torch.equal(first.vertices, second.vertices)


def test_it_is_a_sequence_of_its_meshes() -> None:
    assert len(BATCH) == 3
    assert torch.equal(torch.cat([vertices for vertices, _ in BATCH]), BATCH.vertices)
    vertices, topology = BATCH[1]
    assert topology == QUADS[1]
    assert torch.equal(vertices, QUADS[0])
    assert equal(BATCH[:2], MeshBatch.of([TRIANGLES, QUADS]))
    assert BATCH[-1][1] == icosphere(1).topology
    assert len(MeshBatch.of([])) == 0
    assert list(MeshBatch.of([])) == []
    assert "3 meshes" in repr(BATCH)


def test_leading_dimensions_are_states_of_all_meshes() -> None:
    states = MeshBatch.of([(torch.stack([v, 2 * v]), t) for v, t in (TRIANGLES, QUADS)])
    energies = NormalVariation(states.topology)(states.vertices)
    assert energies.shape == (2, 2)
    torch.testing.assert_close(energies[1], 2 * energies[0])
    torch.testing.assert_close(energies[0, 1], NormalVariation(QUADS[1])(QUADS[0]))
    assert states[0][0].shape == (2, 12, 3)


def test_derivatives_pass_through() -> None:
    variables = [v.clone().requires_grad_() for v, _ in (TRIANGLES, QUADS)]
    batch = MeshBatch.of(list(zip(variables, (TRIANGLES[1], QUADS[1]), strict=True)))
    NormalVariation(batch.topology, reduction="sum")(batch.vertices).backward()
    for variable, (vertices, topology) in zip(variables, (TRIANGLES, QUADS), strict=True):
        alone = vertices.clone().requires_grad_()
        NormalVariation(topology)(alone).backward()
        torch.testing.assert_close(variable.grad, alone.grad)
    assert torch.equal(batch.with_vertices(2 * batch.vertices).vertices, 2 * batch.vertices)


def test_what_does_not_go_together_is_named() -> None:
    with pytest.raises(ShapeError, match=r"vertices of mesh 1.*\(\*batch, 15, 3\)"):
        MeshBatch.of([TRIANGLES, (TRIANGLES[0], QUADS[1])])
    with pytest.raises(ShapeError, match=r"vertices of mesh 1.*float64, as those of mesh 0.*float32"):
        MeshBatch.of([TRIANGLES, (QUADS[0].float(), QUADS[1])])
    with pytest.raises(ShapeError, match=r"vertices of mesh 1.*leading dimensions"):
        MeshBatch.of([TRIANGLES, (QUADS[0][None], QUADS[1])])
    with pytest.raises(MeshError, match="mesh 0 is neither a pair"):
        MeshBatch.of([QUADS[0]])  # type: ignore[list-item]
    with pytest.raises(MeshError, match="takes a joined topology"):
        MeshBatch(*QUADS)
    with pytest.raises(MeshError, match=r"mesh 1: .*more than one fan: vertices 0"):
        mesh_from_lists([QUADS[0], torch.zeros(5, 3)], [QUADS[1].face_lists(), [[0, 1, 2], [0, 3, 4]]])


# ---- padding ---------------------------------------------------------------------------------------------


def test_padding_and_back() -> None:
    vertices, faces = BATCH.padded()
    assert vertices.shape == (3, 42, 3)
    assert faces.shape == (3, 80, 4)
    assert (vertices[0, 12:] == 0).all()
    assert faces[0, 0].tolist() == [*TRIANGLES[1].triangles[0].tolist(), -1]
    assert (faces[1, QUADS[1].num_faces :] == -1).all()
    assert equal(MeshBatch.from_padded(vertices, faces, BATCH.topology.mesh_sizes), BATCH)
    every = MeshBatch.from_padded(vertices, faces)  # what is padding is not known: isolated vertices
    torch.testing.assert_close(
        NormalVariation(every.topology)(every.vertices), NormalVariation(BATCH.topology)(BATCH.vertices)
    )
    assert [part.shape for part in MeshBatch.of([]).padded()] == [(0, 0, 3), (0, 0, 0)]


def test_padding_keeps_derivatives() -> None:
    variable = BATCH.vertices.clone().requires_grad_()
    padded, faces = BATCH.with_vertices(variable).padded()
    again = MeshBatch.from_padded(padded, faces, BATCH.topology.mesh_sizes)
    (again.vertices * torch.arange(3.0)).sum().backward()
    assert torch.equal(variable.grad, torch.arange(3.0, dtype=DOUBLE).expand_as(variable))


def test_the_same_faces_for_all() -> None:
    vertices = torch.stack([TRIANGLES[0], 2 * TRIANGLES[0]])
    batch = MeshBatch.from_padded(vertices, TRIANGLES[1].triangles)
    assert equal(batch, MeshBatch.from_padded(vertices, TRIANGLES[1].triangles.expand(2, -1, -1)))
    assert len(batch) == 2


def test_padding_that_is_none_is_refused() -> None:
    vertices = torch.zeros(1, 5, 3)
    with pytest.raises(MeshError, match=r"mesh 0: 1 face\(s\) have a vertex behind padding \(-1\): faces 1"):
        MeshBatch.from_padded(vertices, torch.tensor([[[0, 1, 2, 3], [0, -1, 1, 4], [0, 3, 4, -1]]]))
    with pytest.raises(MeshError, match=r"mesh 0: .*face 1 uses vertex 4"):
        MeshBatch.from_padded(vertices, torch.tensor([[[0, 1, 2], [2, 1, 4]]]), [4])
    with pytest.raises(ShapeError, match=r"num_vertices: expected 1 numbers from 0 to 5"):
        MeshBatch.from_padded(vertices, torch.zeros(1, 0, 3, dtype=torch.int64), [6])
    with pytest.raises(ShapeError, match=r"an integer tensor \(1, F, k\)"):
        MeshBatch.from_padded(vertices, torch.zeros(2, 1, 3, dtype=torch.int64))
    with pytest.raises(MeshError, match=r"MeshBatch\.from_padded takes faces of several"):
        Topology.from_faces(torch.zeros(2, 1, 3, dtype=torch.int64))


@given(
    st.lists(st.lists(st.integers(0, 9), min_size=3, max_size=6, unique=True), min_size=1, max_size=1),
    st.integers(0, 3),
)
@settings(max_examples=30, deadline=None)
def test_rows_may_be_padded_to_any_width(faces: list[list[int]], more: int) -> None:
    rows = np.full((len(faces) + more, 6 + more), -1)
    for row, face in zip(rows, faces, strict=False):
        row[: len(face)] = face
    assert Topology.from_faces(rows) == Topology.from_faces(faces)


# ---- loaders ---------------------------------------------------------------------------------------------


class Meshes(Dataset[dict[str, Any]]):
    """Spheres and grids in turn, with a label and a pair of vertices and topology deep inside."""

    def __len__(self) -> int:
        return 6

    def __getitem__(self, number: int) -> dict[str, Any]:
        vertices, topology = TRIANGLES if number % 2 else QUADS
        return {"mesh": (vertices + number, topology), "label": number, "more": ([topology, 0.5 * number], "name")}


@pytest.mark.parametrize("workers", [0, pytest.param(2, marks=pytest.mark.slow)])
def test_loaders_make_batches(workers: int) -> None:
    loader = DataLoader(Meshes(), batch_size=4, collate_fn=collate, num_workers=workers)
    first, second = list(loader)
    assert [len(batch["mesh"]) for batch in (first, second)] == [4, 2]
    assert equal(second["mesh"], MeshBatch.of([Meshes()[4]["mesh"], Meshes()[5]["mesh"]]))
    assert first["label"].tolist() == [0, 1, 2, 3]
    (topologies, numbers), names = second["more"]
    assert topologies == Topology.join([QUADS[1], TRIANGLES[1]])
    assert numbers.tolist() == [2.0, 2.5]
    assert names == ["name", "name"]


class Single(Dataset[tuple[Tensor, Topology]]):
    def __len__(self) -> int:
        return 60

    def __getitem__(self, number: int) -> tuple[Tensor, Topology]:
        return TRIANGLES[0] + number, TRIANGLES[1]


def first_of(samples: list[Any]) -> Any:
    return samples[0]


@pytest.mark.slow
def test_kept_meshes_cost_few_files() -> None:
    """Workers hand over every tensor in a file of its own: two for a mesh, its vertices and its packed topology."""
    resource = pytest.importorskip("resource")
    import os

    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    before = len(os.listdir("/proc/self/fd")) if os.path.isdir("/proc/self/fd") else pytest.skip("no /proc")
    kept = list(DataLoader(Single(), batch_size=1, collate_fn=first_of, num_workers=1))
    opened = len(os.listdir("/proc/self/fd")) - before
    assert len(kept) == 60
    assert opened <= 2 * 60 + 20, (opened, limits)
    assert kept[7][1] == TRIANGLES[1]


def test_collate_joins_batches_and_topologies() -> None:
    assert equal(collate([BATCH[:1], BATCH[1:]]), BATCH)
    assert collate([TRIANGLES[1], QUADS[1]]) == Topology.join([TRIANGLES[1], QUADS[1]])
    meshes = [icosphere(0), icosphere(1)]
    assert equal(collate(meshes), MeshBatch.of(meshes))
    named = torch.utils.data.default_collate
    assert torch.equal(collate([torch.ones(2), torch.zeros(2)]), named([torch.ones(2), torch.zeros(2)]))


# ---- moving ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("way", [lambda b: b.cpu(), lambda b: b.to("cpu"), lambda b: b[:]], ids=["cpu", "to", "slice"])
def test_moving_changes_nothing(way: Callable[[MeshBatch], MeshBatch]) -> None:
    assert equal(way(BATCH), BATCH)


def test_moving_to_a_device_and_dtype() -> None:
    meta = BATCH.to("meta", torch.float32)
    assert (meta.vertices.dtype, meta.vertices.device.type, meta.topology.device.type) == (
        torch.float32,
        "meta",
        "meta",
    )
    assert BATCH.to(torch.float32).topology == BATCH.topology
    assert torchfair.collate is collate


@pytest.mark.skipif(not torch.cuda.is_available(), reason="needs a GPU")
def test_pinned_and_on_a_gpu() -> None:
    pinned = BATCH.pin_memory()
    assert pinned.vertices.is_pinned()
    assert pinned.topology.edges.is_pinned()
    assert equal(pinned, BATCH)
    moved = pinned.cuda()
    assert moved.topology.device.type == "cuda"
    assert moved.topology == BATCH.topology
    value = NormalVariation(moved.topology)(moved.vertices)
    torch.testing.assert_close(value.cpu(), NormalVariation(BATCH.topology)(BATCH.vertices))


def test_a_list_is_no_mesh_whatever_is_in_it() -> None:
    """Its entries are collated one by one, as those of any list."""
    vertices, topology = wavy_grid(3, 3)
    points, joined = collate([[vertices, topology], [vertices, topology]])
    assert points.shape == (2, *vertices.shape)
    assert joined.num_meshes == 2
