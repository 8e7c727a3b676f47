"""Quad meshes cut into the combinatorics of principal-symmetric meshes."""

from __future__ import annotations

import itertools

import pytest
import torch
from helpers import DOUBLE, cube, grid_faces, wavy_grid
from mesh_shelf import torus_faces
from torch import Tensor

from torchfair import MeshError, Topology
from torchfair.formfinding import principal_symmetric, symmetric_measures
from torchfair.principal import PrincipalEdges, half_shifted, triangles_from_quads
from torchfair.principal.quads import two_colours
from torchfair.shapes import Catenoid, Surface, Torus, principal_quads


def pairs(edges: Tensor) -> set[tuple[int, int]]:
    return {(min(pair), max(pair)) for pair in edges.tolist()}


def principal(edges: PrincipalEdges) -> set[tuple[int, int]]:
    return pairs(edges.topology.edges[edges.mask])


def diagonals_at(edges: PrincipalEdges, quads: Topology) -> dict[int, list[int]]:
    """The other ends of the diagonals at every vertex."""
    found: dict[int, list[int]] = {}
    for v, w in pairs(edges.topology.edges) - pairs(quads.edges):
        found.setdefault(v, []).append(w)
        found.setdefault(w, []).append(v)
    return found


@pytest.mark.parametrize("along", [0, 1])
@pytest.mark.parametrize("sizes", [(4, 6), (5, 5), (7, 4)])
def test_a_grid_has_the_combinatorics_whichever_family_is_principal(along: int, sizes: tuple[int, int]) -> None:
    rows, columns = sizes
    vertices, quads = wavy_grid(rows, columns)
    grid = torch.arange(rows * columns).view(rows, columns)
    lines = [grid.T, grid][along]  # each row of these is a principal polyline
    seed = quads.edges.sort(1).values.tolist().index(sorted(lines[1, :2].tolist()))
    edges = triangles_from_quads(vertices, quads, seed).check()
    assert principal(edges) == {(int(a), int(b)) for line in lines for a, b in itertools.pairwise(line)}
    assert edges.singular.numel() == 0
    assert len(edges.stars().vertices) == (rows - 2) * (columns - 2)
    assert pairs(quads.edges) < pairs(edges.topology.edges)
    for vertex, others in diagonals_at(edges, quads).items():
        if not bool(quads.is_boundary_vertex[vertex]):
            line, place = (lines == vertex).nonzero()[0].tolist()
            found = sorted((lines == other).nonzero()[0].tolist() for other in others)
            side = 1 if found[0][1] > place else -1  # both lean to one side of the vertex, one up and one down
            assert found == [[line - 1, place + side], [line + 1, place + side]]


def test_faces_keep_their_order_and_orientation() -> None:
    vertices, quads = wavy_grid(4, 5)
    edges = triangles_from_quads(vertices, quads)
    for number, quad in enumerate(quads.face_lists()):
        around = [tuple(quad[(i + shift) % 4] for shift in (0, 1, 2)) for i in range(4)]
        turns = {triple[i:] + triple[:i] for triple in around for i in range(3)}
        assert all(tuple(face) in turns for face in edges.topology.face_lists()[2 * number : 2 * number + 2])


def test_relabelled_faces_give_the_same_mesh() -> None:
    """Where the corners of a quad begin, and in which order quads come, does not matter."""
    vertices, quads = wavy_grid(6, 5)
    faces = quads.face_lists()
    order = torch.randperm(len(faces), generator=torch.Generator().manual_seed(1)).tolist()
    turned = Topology.from_faces([faces[i][i % 4 :] + faces[i][: i % 4] for i in order], quads.num_vertices)
    first, second = triangles_from_quads(vertices, quads), triangles_from_quads(vertices, turned)
    assert principal(first) == principal(second)
    cuts = [pairs(edges.topology.edges) for edges in (first, second)]
    mirrored = pairs(quads.edges) | {(min(pair), max(pair)) for quad in faces for pair in (quad[::2], quad[1::2])}
    assert cuts[1] in (cuts[0], (mirrored - cuts[0]) | pairs(quads.edges))


@pytest.mark.parametrize(("surface", "along"), [(Torus(), "u"), (Catenoid(), "v")])
def test_the_family_that_bends_less_is_taken(surface: Surface, along: str) -> None:
    mesh = principal_quads(surface, 8, 16)
    edges = triangles_from_quads(mesh.vertices, mesh.topology).check()
    assert principal(edges) == pairs(mesh.topology.edges[mesh.edges_along(along)])  # type: ignore[arg-type]


def coplanar(vertices: Tensor, edges: PrincipalEdges) -> float:
    """Largest residual of normals along principal edges."""
    none = torch.zeros(0, dtype=torch.int64)
    return symmetric_measures(vertices, edges, edges.stars(), none, vertices[none])["largest_coplanar"]


def test_shifted_rows_start_nearly_principal_symmetric() -> None:
    """On a torus they would be by symmetry, if half an edge were half an angle; sheared ones are far from it."""
    found = []
    for count in (16, 32):
        mesh = principal_quads(Torus(), 12, count)
        edges = triangles_from_quads(mesh.vertices, mesh.topology)
        shifted, stars = half_shifted(mesh.vertices, mesh.topology, edges), edges.stars()
        moved = (shifted - mesh.vertices)[stars.vertices].norm(dim=1)
        ahead = (mesh.vertices[stars.principal] - mesh.vertices[stars.vertices, None]).norm(dim=2)
        assert float((moved / ahead.mean(1) - 0.25).abs().max()) < 0.01
        found.append((coplanar(mesh.vertices, edges), coplanar(shifted, edges)))
    assert found[0][1] < 0.1 * found[0][0]
    assert found[1][1] < 0.3 * found[0][1]


def test_the_boundary_stays() -> None:
    mesh = principal_quads(Catenoid(), 8, 16)
    edges = triangles_from_quads(mesh.vertices, mesh.topology)
    shifted, still = half_shifted(mesh.vertices, mesh.topology, edges), mesh.topology.is_boundary_vertex
    assert torch.equal(shifted[still], mesh.vertices[still])
    assert not bool((shifted == mesh.vertices).all(1)[~still].any())


def test_the_job_accepts_them() -> None:
    mesh = principal_quads(Torus(), 8, 12)
    edges = triangles_from_quads(mesh.vertices, mesh.topology)
    result = principal_symmetric(half_shifted(mesh.vertices, mesh.topology, edges), edges)
    assert result.holds


def test_what_cannot_be_cut_is_refused() -> None:
    vertices, quads = cube()
    with pytest.raises(MeshError, match="no two families around vertices 0, 1, 2, 3, 4 and 3 more, whose"):
        triangles_from_quads(vertices, quads)
    flat = torch.zeros(30, 3, dtype=DOUBLE)
    odd = Topology.from_faces(torus_faces(5, 6))
    for seed in range(odd.num_edges):
        number = odd.edges[seed].sort().values.tolist()
        rows_even = (number[1] - number[0]) % 6 == 0  # which way round the seed runs
        if rows_even:
            triangles_from_quads(flat, odd, seed).check()
        else:
            with pytest.raises(MeshError, match="an odd number of them closes up"):
                triangles_from_quads(flat, odd, seed)
    with pytest.raises(MeshError, match=r"1 face\(s\) are not quads: faces 1"):
        triangles_from_quads(flat, Topology.from_faces([[0, 1, 2, 3], [1, 4, 2]]))
    with pytest.raises(MeshError, match="seed_edge: no such edge: 99"):
        triangles_from_quads(flat, Topology.from_faces(grid_faces(3, 3)), 99)


def test_colours_differ_where_they_are_to_or_there_are_none() -> None:
    generator = torch.Generator().manual_seed(0)
    for _ in range(30):
        wanted = torch.rand(12, generator=generator) < 0.5
        joined = torch.randint(0, 12, (9, 2), generator=generator)
        joined = joined[joined[:, 0] != joined[:, 1]]
        differ = wanted[joined[:, 0]] != wanted[joined[:, 1]]
        colours, broken = two_colours(12, joined, differ)
        assert broken.numel() == 0
        assert torch.equal(colours[joined[:, 0]] != colours[joined[:, 1]], differ)
    _, broken = two_colours(4, torch.tensor([[0, 1], [1, 2], [2, 0]]), torch.tensor([True, False, False]))
    assert broken.tolist() == [0, 1, 2]
