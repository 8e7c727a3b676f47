"""Stars and polylines of principal edges, and principal edges of finer meshes."""

from __future__ import annotations

import pytest
import torch
from principal_lattices import LATTICES, cone, twisted_torus

from torchfair import MeshError, ShapeError, Topology, mesh_polylines
from torchfair.principal import PrincipalEdges, principal_edges_from_seed, principal_edges_of_lattice
from torchfair.shapes import Catenoid, PrincipalParaboloid, Torus, principal_triangles
from torchfair.subdivision import loop, midpoint, refine

every_lattice = pytest.mark.parametrize("name", LATTICES)


def steps(line: torch.Tensor) -> list[tuple[int, int]]:
    return [(min(a, b), max(a, b)) for a, b in zip(line.tolist(), line.tolist()[1:], strict=False)]


def slow_stars(edges: PrincipalEdges) -> dict[int, tuple[set[int], list[int]]]:
    """For each regular vertex its principal neighbours, and its ring."""
    topology = edges.topology
    principal = {tuple(sorted(pair)) for pair in topology.edges[edges.mask].tolist()}
    found = {}
    for v, ring in enumerate(torch.split(topology.ring_vertices, topology.valences.tolist())):
        if len(ring) == 6 and not topology.is_boundary_vertex[v]:
            found[v] = ({w for w in ring.tolist() if tuple(sorted((v, w))) in principal}, ring.tolist())
    return found


@every_lattice
def test_stars_against_a_slow_loop(name: str) -> None:
    mesh, along = LATTICES[name]
    edges = principal_edges_of_lattice(mesh, along)
    stars, slow = edges.stars(), slow_stars(edges)
    assert stars.vertices.tolist() == sorted(slow)
    for v, (w1, w4), (w2, w3, w5, w6) in zip(*(part.tolist() for part in stars), strict=True):
        principal, ring = slow[v]
        assert {w1, w4} == principal
        start = ring.index(w1)
        assert ring[start:] + ring[:start] == [w1, w2, w3, w4, w5, w6]


def test_stars_of_a_flat_lattice_are_symmetric() -> None:
    mesh = principal_triangles(Torus(), 8, 10)
    stars = principal_edges_of_lattice(mesh).stars()
    period = torch.tensor([high - low for low, high in mesh.surface.domain], dtype=torch.float64)
    v, p, c = (mesh.parameters[part] for part in (stars.vertices, stars.principal, stars.cospherical))
    p, c = ((q - v[:, None] + 1.5 * period) % period - 0.5 * period for q in (p, c))
    assert torch.allclose(p.sum(1), torch.zeros(1, 2).double(), atol=1e-12)
    w2, w3, w5, w6 = c.unbind(1)
    assert torch.allclose(w2, -w5, atol=1e-12)
    assert torch.allclose(w3, -w6, atol=1e-12)
    angle = torch.atan2(*torch.stack([p[:, 0], w2, w3, p[:, 1], w5, w6]).flip(-1).unbind(-1))
    assert (((angle.roll(-1, 0) - angle) % (2 * torch.pi)) < torch.pi).all()  # counterclockwise in u, v


# ---- polylines -------------------------------------------------------------------------------------------


@every_lattice
def test_polylines_are_the_parameter_lines(name: str) -> None:
    mesh, along = LATTICES[name]
    edges = principal_edges_of_lattice(mesh, along)
    lines = edges.polylines()
    covered = sorted(step for line in lines for step in steps(line))
    assert covered == sorted(tuple(sorted(pair)) for pair in mesh.topology.edges[edges.mask].tolist())
    axis = "uv".index(along)
    across = mesh.parameters[:, 1 - axis]
    assert all((across[line] - across[line[0]]).abs().max() < 1e-9 for line in lines)
    assert len(lines) == len({round(float(across[line[0]]), 6) for line in lines})
    assert all((line[0] == line[-1]) == mesh.surface.periodic[axis] for line in lines)


@pytest.mark.parametrize(("shift", "count"), [(0, 6), (1, 1), (2, 2), (3, 3), (4, 2)])
def test_polylines_of_a_twisted_torus_wind(shift: int, count: int) -> None:
    topology = twisted_torus(4, 6, shift)
    seed = next(e for e, pair in enumerate(topology.edges.tolist()) if pair == [0, 6])
    lines = principal_edges_from_seed(topology, seed).polylines()
    assert len(lines) == count
    assert all(line[0] == line[-1] and len(line) == 24 // count + 1 for line in lines)


def test_polylines_are_mesh_polylines_where_nothing_is_singular() -> None:
    topology = twisted_torus(4, 7, 2)
    edges = principal_edges_from_seed(topology, 5)
    sets = {frozenset(steps(line)) for line in mesh_polylines(topology)}
    assert {frozenset(steps(line)) for line in edges.polylines()} <= sets


def test_polylines_end_at_singular_vertices() -> None:
    edges = principal_edges_from_seed(cone(9, 4), 0)
    at_apex = [line for line in edges.polylines() if 0 in line.tolist()]
    assert len(at_apex) == 3  # one in three of its nine edges
    assert all(0 in (line[0], line[-1]) and len(line) == 5 for line in at_apex)


def test_a_polyline_passes_a_boundary_vertex_that_it_only_touches() -> None:
    """Of two rows of triangles one ends: the line between them goes on as the boundary of the other."""
    faces = [[0, 1, 4], [1, 5, 4], [1, 2, 5], [4, 5, 6], [5, 7, 6], [5, 8, 7]]
    topology = Topology.from_faces(faces)  # 4 - 5 - 8 with faces above all along and below on the left
    seed = topology.edges.tolist().index([4, 5])
    lines = [line.tolist() for line in principal_edges_from_seed(topology, seed).polylines()]
    assert topology.valences[5] == 6
    assert [4, 5, 8] in lines or [8, 5, 4] in lines


@every_lattice
def test_where_all_edges_are_principal_every_edge_is_a_polyline(name: str) -> None:
    """No vertex, inside or on the boundary, has just two opposite ones."""
    mesh, _ = LATTICES[name]
    everything = torch.ones(mesh.topology.num_edges, dtype=torch.bool)
    lines = PrincipalEdges(mesh.topology, everything).polylines()
    assert sorted(sorted(line.tolist()) for line in lines) == sorted(mesh.topology.edges.sort(1).values.tolist())


# ---- finer meshes ----------------------------------------------------------------------------------------


@every_lattice
@pytest.mark.parametrize("step", [loop, midpoint])
def test_refined_edges_are_a_family_of_the_fine_mesh(name: str, step) -> None:
    mesh, along = LATTICES[name]
    coarse = principal_edges_of_lattice(mesh, along)
    fine = coarse.refine(step(mesh.topology)).check()
    seed = torch.nonzero(fine.mask)[0, 0]
    assert torch.equal(fine.mask, principal_edges_from_seed(fine.topology, seed).mask)
    twice = fine.refine(loop(fine.topology))
    assert torch.equal(twice.mask, coarse.refine(refine(mesh.topology, "loop", 2)).mask)


def test_refined_edges_on_a_finer_surface_are_those_of_the_finer_lattice() -> None:
    coarse, fine = (principal_triangles(PrincipalParaboloid(1.0, -1.0), n, n, ends="zigzag") for n in (4, 8))
    step = midpoint(coarse.topology)
    edges = principal_edges_of_lattice(coarse).refine(step)
    along = step.apply(coarse.parameters)[edges.topology.edges[edges.mask]]
    assert (along[:, 0, 1] - along[:, 1, 1]).abs().max() < 1e-12
    rows = {round(float(v), 9) for v in along[..., 1].ravel()}
    assert rows == {round(float(v), 9) for v in fine.parameters[:, 1]}


def test_exceptions_survive_refinement() -> None:
    topology = cone(5, 4)
    coarse = principal_edges_from_seed(topology, 0, allow_exceptions=True)
    fine = coarse.refine(loop(topology))
    assert fine.singular.tolist() == [0]
    assert set(coarse.exceptions.tolist()) <= set(fine.exceptions.tolist())  # old vertices keep their numbers
    finest = fine.refine(loop(fine.topology))
    counts = [edges.exceptions.numel() for edges in (coarse, fine, finest)]
    assert counts[0] < counts[1] < counts[2] < 3 * counts[1]  # a seam is a curve


def test_refinement_of_another_mesh_is_refused() -> None:
    edges = principal_edges_from_seed(cone(9, 3), 0)
    with pytest.raises(MeshError, match="does not start from the mesh of the principal edges"):
        edges.refine(loop(cone(9, 2)))


# ---- input -----------------------------------------------------------------------------------------------


def test_masks_of_a_wrong_kind() -> None:
    topology = twisted_torus(4, 5, 0)
    for wrong in (torch.zeros(60), torch.zeros(59, dtype=torch.bool), [True] * 60):
        with pytest.raises(ShapeError, match=r"mask: expected a bool tensor \(60,\)"):
            PrincipalEdges(topology, wrong)


def test_the_empty_mesh_and_meshes_without_regular_vertices() -> None:
    for topology in (Topology.from_faces([], num_vertices=2), Topology.from_faces([[0, 1, 2]])):
        edges = PrincipalEdges(topology, torch.zeros(topology.num_edges, dtype=torch.bool)).check()
        assert [tuple(part.shape) for part in edges.stars()] == [(0,), (0, 2), (0, 4)]
        assert edges.polylines() == []
        assert edges.singular.numel() == edges.exceptions.numel() == 0


def test_representation_and_device() -> None:
    edges = principal_edges_of_lattice(principal_triangles(Catenoid(), 4, 6))
    assert repr(edges) == "PrincipalEdges(30 of 78 edges, 0 singular vertices, 0 exceptions)"
    assert torch.equal(edges.to("cpu").mask, edges.mask)
