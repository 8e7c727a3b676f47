"""Which vertices lie within some rings."""

from __future__ import annotations

import pytest
import torch
from geometry_meshes import mixed_grid, with_isolated
from helpers import wavy_grid

from torchfair import Topology
from torchfair.errors import SettingsError, ShapeError
from torchfair.geometry import Patches
from torchfair.geometry import patches as patches_module
from torchfair.shapes import Paraboloid, Torus, irregular_triangles, rotated_lattice


def within(topology: Topology, rings: int) -> torch.Tensor:
    """(V, V) by repeated steps across faces, one vertex after the other."""
    near = torch.eye(topology.num_vertices, dtype=torch.bool)
    for _ in range(rings):
        wider = near.clone()
        for face in topology.face_lists():
            wider[:, face] |= near[:, face].any(1, keepdim=True)
        near = wider
    return near


def table(patches: Patches, count: int) -> torch.Tensor:
    found = torch.zeros(count, count, dtype=torch.int64)
    for centres, members, present in patches.groups:
        for centre, row, there in zip(centres, members, present, strict=True):
            found[centre].index_add_(0, row[there], torch.ones_like(row[there]))
    return found


def grown(topology: Topology, rings: int) -> torch.Tensor:
    lattice = 1 + 3 * rings * (rings + 1)
    expected = within(topology, rings)
    small = expected.sum(1) < 0.8 * lattice
    for more in range(1, rings + 1):
        growing = small & (expected.sum(1) < 1.25 * lattice)
        if more == 1:
            growing = small
        expected = torch.where(growing[:, None], within(topology, rings + more), expected)
    return expected


@pytest.mark.parametrize("rings", [1, 2, 3])
@pytest.mark.parametrize("mesh", [mixed_grid, lambda: wavy_grid(9, 7, triangles=True)], ids=["mixed", "triangles"])
def test_members_are_all_within_the_rings_and_more_where_they_are_few(mesh, rings) -> None:
    _, topology = mesh()
    found = table(Patches(topology, rings), topology.num_vertices)
    assert found.equal(grown(topology, rings).long())  # each once


def test_a_lattice_without_boundary_has_its_rings() -> None:
    topology = rotated_lattice(Torus(), 12, 24, 0.0).topology
    sizes = table(Patches(topology, 2), topology.num_vertices).sum(1)
    assert set(sizes[~topology.is_boundary_vertex].tolist()) >= {19}


def test_isolated_vertices_have_themselves() -> None:
    _, topology = with_isolated(mixed_grid())
    found = table(Patches(topology, 2), topology.num_vertices)
    assert found[-1].nonzero().flatten().tolist() == [topology.num_vertices - 1]


def test_means_are_those_of_the_members(monkeypatch: pytest.MonkeyPatch) -> None:
    vertices, topology = wavy_grid(9, 8)
    shares = grown(topology, 2).to(vertices)
    expected = shares @ vertices / shares.sum(1, keepdim=True)
    torch.testing.assert_close(Patches(topology, 2).means(vertices), expected)
    monkeypatch.setattr(patches_module, "_PAIRS", 200)  # many groups
    patches = Patches(topology, 2)
    assert len(patches.groups) > 5
    torch.testing.assert_close(patches.means(vertices.expand(2, -1, -1))[1], expected)


def test_groups_hold_little_more_than_their_members() -> None:
    topology = irregular_triangles(Paraboloid(1.0, -1.0), 3000).topology
    groups = Patches(topology, 3).groups
    assert sum(members.numel() for _, members, _ in groups) < 1.6 * sum(int(group.present.sum()) for group in groups)


@pytest.mark.parametrize("rings", [0, -1, 1.5, True, None])
def test_rings_are_counted(rings: object) -> None:
    with pytest.raises(SettingsError, match="rings must be a whole number of at least 1"):
        Patches(wavy_grid(3, 3)[1], rings)


@pytest.mark.parametrize(("rings", "where"), [(2, "no"), (3, "all"), (4, "all"), (5, "rim"), (8, "no")])
def test_wide_patches_near_the_boundary_and_none_elsewhere(rings: int, where: str) -> None:
    """Whole rings, the fewest of which have as many members as are wanted; other groups are the same objects."""
    topology = irregular_triangles(Paraboloid(1.0, -1.0), 1000).topology
    patches = Patches(topology, rings)
    step, reach = within(topology, 1).float(), [torch.eye(topology.num_vertices, dtype=torch.bool)]
    for _ in range(3 * rings):
        reach.append(reach[-1].float() @ step > 0)
    near, rim = (reach[k][:, topology.is_boundary_vertex].any(1) for k in (rings - 1, 2))
    assert patches.border.equal({"all": near, "rim": rim, "no": torch.zeros_like(near)}[where])
    last = patches.wide[len(patches.wide) - patches.num_rim_groups :]
    centres = torch.cat([group.centres for group in last]) if last else torch.zeros(0).long()
    assert centres.sort().values.equal((patches.border & rim).nonzero().flatten())
    members: dict[int, set[int]] = {}
    for group in patches.wide:
        assert any(group is other for other in patches.groups) == (not patches.border[group.centres].any())
        for centre, row, there in zip(group.centres, group.members, group.present, strict=True):
            members[int(centre)] = set(row[there].tolist())
    assert sorted(members) == list(range(topology.num_vertices))
    lattice = 1 + 3 * rings * (rings + 1)
    for vertex in patches.border.nonzero().flatten()[::7].tolist():
        distance = next(k for k in range(rings) if reach[k][vertex][topology.is_boundary_vertex].any())
        most, share = (4, 0.2) if distance <= 2 else (3, 0.1)
        wanted = min((most - (most - 1) * distance / rings) * lattice, share * topology.num_vertices)
        counts = [int(reach[k][vertex].sum()) for k in range(rings + 1, 3 * rings + 1)]
        enough = next((k for k, count in enumerate(counts) if count >= wanted), len(counts) - 1)
        assert members[vertex] == set(reach[rings + 1 + enough][vertex].nonzero().flatten().tolist())
    order = torch.cat([group.centres for group in patches.wide])
    assert patches.in_order([order[:, None]], wide=True).squeeze(1).equal(torch.arange(topology.num_vertices))


def test_connected_parts_have_the_wide_patches_that_they_have_alone() -> None:
    """A large part has some, and a small one beside it none."""
    large, small = (irregular_triangles(Paraboloid(1.0, -1.0), count).topology for count in (1000, 220))
    shifted = [[vertex + large.num_vertices for vertex in face] for face in small.face_lists()]
    both = Patches(Topology.from_faces([*large.face_lists(), *shifted]), 3)
    alone = Patches(large, 3)
    assert alone.border.any()
    assert both.border[: large.num_vertices].equal(alone.border)
    assert not both.border[large.num_vertices :].any()
    assert both.num_parts == 2
    assert both.parts.bincount().tolist() == [large.num_vertices, small.num_vertices]
    counts = [torch.zeros(len(patches.border), dtype=torch.int64) for patches in (alone, both)]
    for patches, count in zip((alone, both), counts, strict=True):
        for centres, _, present in patches.wide:
            count[centres] = present.sum(1)
    assert counts[1][: large.num_vertices].equal(counts[0])


@pytest.mark.parametrize("rings", [2, 3])
def test_patches_of_some_vertices_are_those_of_all(rings: int) -> None:
    topology = irregular_triangles(Paraboloid(1.0, -0.5), 1500).topology
    at = torch.rand(topology.num_vertices, generator=torch.Generator().manual_seed(0)) < 0.2
    some, every = Patches(topology, rings, at=at), Patches(topology, rings)
    assert table(some, topology.num_vertices).equal(table(every, topology.num_vertices) * at[:, None])
    assert some.border.equal(every.border & at)
    assert some.border.any() == (rings == 3)
    assert some.sizes.equal(every.sizes * at)
    values = torch.rand(topology.num_vertices, 2, dtype=torch.float64)
    near = (table(every, topology.num_vertices) * at).double()
    expected = at[:, None] * (near @ values) / near.sum(1, keepdim=True).clamp_min(1.0)
    assert torch.allclose(some.means(values), expected)


def test_chosen_vertices_are_true_or_false() -> None:
    topology = irregular_triangles(Torus(), 100).topology
    for wrong in (torch.arange(5), torch.ones(3, dtype=torch.bool)):
        with pytest.raises(ShapeError, match="at: expected a boolean tensor"):
            Patches(topology, 2, at=wrong)
