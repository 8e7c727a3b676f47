"""Families of parallel edges: one edge of every triangle, two opposite ones at every regular vertex."""

from __future__ import annotations

import pytest
import torch
from helpers import tetrahedron
from hypothesis import given, settings
from hypothesis import strategies as st
from principal_lattices import LATTICES, cone, relabelled, twisted_torus

from torchfair import MeshError, ShapeError, Topology
from torchfair._graph import edge_numbers
from torchfair.principal import PrincipalEdges, principal_edges_from_seed, principal_edges_of_lattice
from torchfair.shapes import Catenoid, Enneper, Sphere, irregular_triangles, principal_quads, principal_triangles

every_lattice = pytest.mark.parametrize("name", LATTICES)


def sides_marked(edges: PrincipalEdges) -> torch.Tensor:
    """(F,) number of principal edges of each triangle."""
    return edges.mask[edges.topology.corner_edges].view(-1, 3).sum(1)


def families(topology: Topology) -> list[torch.Tensor]:
    """The masks that the three edges of the first triangle lead to."""
    return [principal_edges_from_seed(topology, edge).mask for edge in topology.corner_edges[:3].tolist()]


@every_lattice
def test_any_principal_edge_of_a_lattice_leads_to_all_others(name: str) -> None:
    mesh, along = LATTICES[name]
    edges = principal_edges_of_lattice(mesh, along)
    assert torch.equal(edges.mask, mesh.edges_along(along))
    for seed in torch.nonzero(edges.mask).squeeze(1)[::17]:
        assert torch.equal(principal_edges_from_seed(mesh.topology, seed).mask, edges.mask)


@every_lattice
def test_the_direction_of_a_lattice_is_found(name: str) -> None:
    mesh, along = LATTICES[name]
    assert torch.equal(principal_edges_of_lattice(mesh).mask, mesh.edges_along(along))


@pytest.mark.parametrize(
    "topology",
    [*(mesh.topology for mesh, _ in LATTICES.values()), twisted_torus(4, 7, 3), cone(3, 4), cone(9, 4), cone(6, 3)],
)
def test_three_families_share_the_edges(topology: Topology) -> None:
    masks = families(topology)
    assert (sum(mask.int() for mask in masks) == 1).all()
    for mask in masks:
        edges = PrincipalEdges(topology, mask).check()
        assert (sides_marked(edges) == 1).all()
        regular = ~topology.is_boundary_vertex & (topology.valences == 6)
        assert torch.equal(edges.stars().vertices, torch.nonzero(regular).squeeze(1))


@pytest.mark.parametrize("shift", range(5))
def test_a_torus_closed_with_a_twist_has_consistent_families(shift: int) -> None:
    """A closed mesh of valence 6 is a flat torus, which is the plane divided by translations."""
    for mask in families(twisted_torus(4, 5, shift)):
        assert mask.sum() == 20


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 1000), edge=st.integers(0, 10_000), twist=st.integers(0, 6))
def test_numbers_of_vertices_and_faces_do_not_matter(seed: int, edge: int, twist: int) -> None:
    for topology in (twisted_torus(4, 7, twist), cone(9, 3)):
        edge %= topology.num_edges
        other, new = relabelled(topology, seed)
        moved = edge_numbers(other, new[topology.edges])
        expected = principal_edges_from_seed(topology, edge).mask
        assert torch.equal(principal_edges_from_seed(other, moved[edge]).mask[moved], expected)


# ---- where no choice is possible -------------------------------------------------------------------------


@pytest.mark.parametrize("valence", [4, 5, 7, 8, 10])
def test_singular_vertices_that_exchange_the_families_are_named(valence: int) -> None:
    with pytest.raises(MeshError, match=rf"around 1 singular vertex\(es\): vertices 0 \(valence {valence}\)"):
        principal_edges_from_seed(cone(valence, 5), 7)


@pytest.mark.parametrize("valence", [4, 5, 7, 8, 10])
def test_exceptions_lie_along_one_seam_from_the_singular_vertex_to_the_boundary(valence: int) -> None:
    rings = 8
    topology = cone(valence, rings)
    edges = principal_edges_from_seed(topology, topology.num_edges - 1, allow_exceptions=True)
    assert edges.singular.tolist() == [0]
    assert 0 < edges.exceptions.numel() <= 2 * rings
    assert edges.stars().vertices.numel() + edges.exceptions.numel() == (topology.num_vertices - 1) - valence * rings
    assert set(sides_marked(edges).tolist()) <= {1, 2, 3}
    with pytest.raises(MeshError, match="do not have exactly two principal edges"):
        edges.check()


def test_a_hole_can_hide_what_exchanges_the_families() -> None:
    assert principal_edges_from_seed(cone(9, 5, apex=False), 3).exceptions.numel() == 0
    topology = cone(5, 5, apex=False)
    with pytest.raises(MeshError, match=r"around a handle or a hole\. It breaks at edges"):
        principal_edges_from_seed(topology, 3)
    with pytest.raises(MeshError, match=r"around a handle or a hole\. It breaks at edges"):  # one seed, named twice
        principal_edges_from_seed(topology, torch.tensor([3, 3]))
    edges = principal_edges_from_seed(topology, 3, allow_exceptions=True)
    assert edges.singular.numel() == 0
    assert edges.exceptions.numel() > 0


def test_seeds_of_two_families_contradict_each_other() -> None:
    topology = twisted_torus(6, 8, 0)
    first, *_ = families(topology)
    far = topology.corner_edges[3 * 50 :][:3]
    seeds = torch.stack([topology.corner_edges[0], far[~first[far]][0]])
    with pytest.raises(MeshError, match="the seeds are not of one family"):
        principal_edges_from_seed(topology, seeds)
    assert principal_edges_from_seed(topology, seeds, allow_exceptions=True).exceptions.numel() > 0
    agreeing = torch.stack([topology.corner_edges[0], far[first[far]][0]])
    assert torch.equal(principal_edges_from_seed(topology, agreeing).mask, first)


def test_seeds_beside_each_other_are_refused() -> None:
    topology = twisted_torus(4, 5, 0)
    with pytest.raises(MeshError, match="several seeds lie in one triangle: faces 0"):
        principal_edges_from_seed(topology, topology.corner_edges[:2])


def test_every_component_needs_a_seed() -> None:
    one = twisted_torus(4, 5, 1)
    faces = torch.cat([one.triangles, one.triangles + one.num_vertices])
    two = Topology.from_faces(faces)
    seed, other = two.corner_edges[0], two.corner_edges[-1]
    with pytest.raises(MeshError, match=r"40 face\(s\) are not connected with any seed, such as face 40 at vertex 20"):
        principal_edges_from_seed(two, seed)
    left_out = principal_edges_from_seed(two, seed, allow_exceptions=True)
    assert left_out.exceptions.tolist() == list(range(20, 40))
    both = principal_edges_from_seed(two, torch.stack([seed, other]))
    assert (sides_marked(both) == 1).all()


# ---- input -----------------------------------------------------------------------------------------------


def test_seeds_that_are_no_edges() -> None:
    topology = twisted_torus(4, 5, 0)
    with pytest.raises(MeshError, match=r"no such edges: \[60\]; the mesh has 60"):
        principal_edges_from_seed(topology, 60)
    with pytest.raises(MeshError, match="no such edges"):
        principal_edges_from_seed(topology, -1)
    for wrong in (
        torch.tensor([0.0]),
        torch.tensor([True]),
        torch.zeros(0, dtype=torch.int64),
        torch.zeros(2, 2).long(),
    ):
        with pytest.raises(ShapeError, match="seed_edge: expected an edge number"):
            principal_edges_from_seed(topology, wrong)
    with pytest.raises(MeshError, match="no such edges"):
        principal_edges_from_seed(Topology.from_faces([], num_vertices=3), 0)
    with pytest.raises(MeshError, match="are not triangles"):
        principal_edges_from_seed(principal_quads(Catenoid(), 3, 4).topology, 0)


def test_one_triangle_and_closed_shells() -> None:
    single = Topology.from_faces([[0, 1, 2]])
    assert principal_edges_from_seed(single, 2).mask.tolist() == [False, False, True]
    solid = tetrahedron()[1]  # all valences are 3: two edges that do not meet
    edges = principal_edges_from_seed(solid, 0)
    assert edges.mask.sum() == 2
    assert len(set(solid.edges[edges.mask].ravel().tolist())) == 4


@pytest.mark.parametrize("along", ["u", "v"])
def test_lattices_of_a_single_row_have_the_direction_of_most_edges(along: str) -> None:
    rows, columns = (1, 5) if along == "u" else (5, 1)
    mesh = principal_triangles(Enneper(), rows, columns, along=along)
    edges = principal_edges_of_lattice(mesh)
    assert edges.stars().vertices.numel() == 0
    assert torch.equal(edges.mask, mesh.edges_along(along))


def test_lattices_around_poles_and_meshes_that_are_none() -> None:
    for along in ("u", "v"):
        mesh = principal_triangles(Sphere(), 6, 8, along=along)
        edges = principal_edges_of_lattice(mesh, along)
        assert torch.equal(edges.mask, mesh.edges_along(along))
        assert edges.singular.numel() >= 2
    with pytest.raises(MeshError, match="do not have exactly two principal edges"):
        principal_edges_of_lattice(irregular_triangles(Catenoid(), 300))
