"""The noise of a mesh, estimated from the mesh alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from helpers import DOUBLE, random_rotation, tetrahedron, wavy_grid
from noisy_meshes import box, noisy

from torchfair import MeshError, Topology
from torchfair.formfinding import noise_level
from torchfair.formfinding.denoise import noise
from torchfair.formfinding.denoise.neighbourhoods import Neighbourhoods, smoothed_area_vectors
from torchfair.geometry import edge_lengths
from torchfair.shapes import Paraboloid, Sphere, irregular_triangles


def edge(vertices: torch.Tensor, topology: Topology) -> float:
    return float(edge_lengths(vertices, topology).mean())


@pytest.mark.parametrize("kind", ["normal", "all"])
@pytest.mark.parametrize("level", [0.02, 0.1, 0.3, 0.5])
@pytest.mark.parametrize("name", ["box", "sphere", "saddle"])
def test_gaussian_noise_is_found_within_ten_percent(name: str, level: float, kind: str) -> None:
    if name == "box":  # a third of all neighbourhoods has an edge in it
        mesh = box(22)
    else:
        made = irregular_triangles(Sphere() if name == "sphere" else Paraboloid(1.0, -1.0), 1500)
        mesh = made.vertices, made.topology
    found = noise_level(noisy(mesh, kind, level), mesh[1]) / edge(*mesh)
    assert found == pytest.approx(level, rel=0.1)


def test_clean_meshes_have_next_to_none() -> None:
    made = irregular_triangles(Sphere(), 1500)
    assert noise_level(made.vertices, made.topology) < 1e-3 * edge(made.vertices, made.topology)
    assert noise_level(*box(12)) < 1e-12


def test_noise_is_a_length_and_does_not_turn() -> None:
    mesh = box(10)
    vertices = noisy(mesh, "all", 0.2)
    found = noise_level(vertices, mesh[1])
    moved = 1000.0 * (vertices @ random_rotation().T) + torch.tensor([3.0, -2.0, 5.0], dtype=DOUBLE)
    assert noise_level(moved, mesh[1]) == pytest.approx(1000.0 * found, rel=1e-6)


def test_neighbourhoods_are_all_within_two_edges() -> None:
    _, topology = wavy_grid(5, 4, triangles=True)
    adjacent = torch.eye(topology.num_vertices, dtype=torch.bool)
    v, w = topology.edges.unbind(1)
    adjacent[v, w] = adjacent[w, v] = True
    expected = (adjacent.double() @ adjacent.double()) > 0
    near = Neighbourhoods.of(topology)
    found = torch.zeros_like(expected)
    found[near.centres, near.members] = True
    assert found.equal(expected)
    assert len(near.centres) == int(expected.sum())  # no pair twice
    assert near.counts.equal(expected.sum(1))
    assert near.centres.equal(near.centres.sort().values)


def test_isolated_vertices_have_no_neighbourhood_and_change_nothing() -> None:
    vertices, topology = wavy_grid(7, 7, triangles=True)
    faces = topology.corners.view(-1, 3)
    more = Topology.from_faces(faces, num_vertices=len(vertices) + 2)
    assert Neighbourhoods.of(more).counts[-2:].tolist() == [0, 0]
    longer = torch.cat([vertices, torch.full((2, 3), 99.0, dtype=DOUBLE)])
    assert noise_level(longer, more) == pytest.approx(noise_level(vertices, topology), rel=1e-12)


@pytest.mark.parametrize("chunk", [1, 100, 1 << 18])
def test_remainders_are_those_of_least_squares(chunk: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(noise, "_CHUNK", chunk)
    mesh = wavy_grid(7, 8, triangles=True)
    vertices, topology = noisy(mesh, "all", 0.2), mesh[1]
    near = Neighbourhoods.of(topology)
    normals = smoothed_area_vectors(vertices, topology, near)[0].numpy()
    expected, freedom = [], []
    for centre in range(topology.num_vertices):
        members = near.members[near.centres == centre]
        if len(members) < 10:
            continue
        normal = normals[centre] / np.linalg.norm(normals[centre])
        first = np.cross(normal, [0.3, 0.5, 0.8])
        first /= np.linalg.norm(first)
        away = (vertices[members] - vertices[centre]).numpy()
        x, y, z = away @ first, away @ np.cross(normal, first), away @ normal
        rows = np.stack([np.ones_like(x), x, y, x * x, x * y, y * y], axis=1)
        left = z - rows @ np.linalg.lstsq(rows, z, rcond=None)[0]
        expected.append(left @ left)
        freedom.append(len(members) - 6)
    found = noise._remainders(vertices, topology, near)
    torch.testing.assert_close(found[0], torch.tensor(expected, dtype=DOUBLE), rtol=1e-8, atol=1e-12)
    assert found[1].tolist() == freedom


@pytest.mark.parametrize("strange", [0.0, 0.4])
def test_variance_ignores_neighbourhoods_with_edges_in_them(strange: float) -> None:
    random = np.random.default_rng(1)
    freedom = random.integers(5, 16, 20000)
    remainders = 0.09 * random.chisquare(freedom)
    remainders[: int(strange * 20000)] += random.uniform(2.0, 30.0, int(strange * 20000))
    variance = noise._pooled_variance(torch.from_numpy(remainders), torch.from_numpy(freedom).to(DOUBLE))
    assert variance == pytest.approx(0.09, rel=0.04)


def test_meshes_without_neighbourhoods_are_refused() -> None:
    with pytest.raises(MeshError, match=r"too few vertices.*give the noise"):
        noise_level(*tetrahedron())


def test_noise_of_polygons_is_found() -> None:
    vertices, topology = wavy_grid(40, 40)
    flat = vertices * torch.tensor([1.0, 1.0, 0.0], dtype=DOUBLE)
    size = 0.1 * edge(flat, topology)
    lifted = flat.clone()
    lifted[:, 2] = size * torch.randn(len(flat), generator=torch.Generator().manual_seed(0), dtype=DOUBLE)
    assert noise_level(lifted, topology) == pytest.approx(size, rel=0.1)
    assert math.isfinite(noise_level(vertices, topology))
