"""Quadratic patches at boundary vertices, tangent planes by them, and the bending between plane and boundary faces."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import random_rotation, wavy_grid
from torch import Tensor

from torchfair import Topology
from torchfair.constraints import BoundaryNormals, boundary_bending_terms, tangent_patch_terms
from torchfair.constraints.boundary_jets import BoundaryJets
from torchfair.constraints.tangent_planes import tangent_frames
from torchfair.projection import guided_projection

VERTICES, TOPOLOGY = wavy_grid(9, 8, triangles=True)
RIM = torch.nonzero(TOPOLOGY.is_boundary_vertex).squeeze(1)
UP = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)


def graph(form: Tensor, slope: Tensor) -> tuple[Tensor, Tensor]:
    """The plane grid lifted to ``p . form p / 2 + slope . p``: vertices and gradients (V, 2)."""
    plane = VERTICES[:, :2]
    heights = 0.5 * ((plane @ form) * plane).sum(1) + plane @ slope
    return torch.cat([plane, heights[:, None]], 1), plane @ form + slope


def random_graph(seed: int) -> tuple[Tensor, Tensor]:
    generator = torch.Generator().manual_seed(seed)
    form = torch.randn(2, 2, dtype=torch.float64, generator=generator)
    return graph(0.3 * (form + form.T), 0.3 * torch.randn(2, dtype=torch.float64, generator=generator))


def jets_over_the_plane(vertices: Tensor) -> BoundaryJets:
    across = torch.eye(3, dtype=torch.float64)[:2, None].expand(2, RIM.numel(), 3).unbind(0)
    return BoundaryJets.of(vertices, TOPOLOGY, RIM, UP.expand(RIM.numel(), 3), across)


@pytest.mark.parametrize("seed", range(3))
def test_patches_are_exact_on_quadratic_height_fields(seed: int) -> None:
    vertices, gradients = random_graph(seed)
    jets = jets_over_the_plane(vertices)
    torch.testing.assert_close(jets.slopes, gradients[RIM], atol=1e-10, rtol=0)
    assert float(jets.misfit.max()) < 1e-11
    heights = vertices[jets.stencil[:, 1:], 2] - vertices[RIM, None, 2]
    torch.testing.assert_close((jets.weights @ heights[:, :, None])[:, :, 0], jets.slopes, atol=1e-12, rtol=0)


@pytest.mark.parametrize("triangles", [False, True])
def test_patches_know_all_vertices_that_are_at_most_two_edges_away(triangles: bool) -> None:
    vertices, topology = wavy_grid(6, 5, triangles=triangles)
    rim = torch.nonzero(topology.is_boundary_vertex).squeeze(1)
    across = torch.eye(3, dtype=torch.float64)[:2, None].expand(2, rim.numel(), 3).unbind(0)
    jets = BoundaryJets.of(vertices, topology, rim, UP.expand(rim.numel(), 3), across)
    near: list[set[int]] = [set() for _ in range(topology.num_vertices)]
    for v, w in topology.edges.tolist():
        near[v].add(w)
        near[w].add(v)
    for row in jets.stencil.tolist():
        assert set(row) == {row[0]} | near[row[0]] | set().union(*(near[w] for w in near[row[0]]))


def test_patches_turn_and_scale_with_the_mesh() -> None:
    vertices, gradients = random_graph(0)
    turn, _ = torch.linalg.qr(torch.randn(3, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(1)))
    turn = turn * torch.det(turn)
    across = [axis.expand(RIM.numel(), 3) for axis in turn.T]
    jets = BoundaryJets.of(100.0 * vertices @ turn.T + 7.0, TOPOLOGY, RIM, across[2], (across[0], across[1]))
    torch.testing.assert_close(jets.slopes, gradients[RIM], atol=1e-9, rtol=0)


def test_a_crease_does_not_fit_a_patch() -> None:
    x = VERTICES[:, 0]
    middle = x[RIM].median()
    creased = torch.stack([x, VERTICES[:, 1], 0.25 * (x - middle).abs()], 1)
    jets = jets_over_the_plane(creased)
    away = (x[RIM] - middle).abs()
    assert float(jets.misfit[away == 0.0].min()) > 0.02
    assert float(jets.misfit[away > 3.0].max()) < 1e-10  # edges are about 1 long
    # Where it does not, stars are turned.
    terms = tangent_patch_terms(creased, TOPOLOGY, RIM, UP.expand(RIM.numel(), 3).clone(), weight=1.0)
    assert [term.linear for term in terms].count(True) == 1
    assert len(terms) > 1
    assert sum(term.num_elements for term in terms) == RIM.numel()


def test_surfaces_are_turned_until_their_normals_are_those_prescribed() -> None:
    form = torch.tensor([[0.04, 0.02], [0.02, -0.03]], dtype=torch.float64)
    vertices, gradients = graph(form, torch.zeros(2, dtype=torch.float64))
    normals = torch.cat([-gradients, torch.ones_like(gradients[:, :1])], 1)
    normals = normals / normals.norm(dim=1, keepdim=True)
    inside = ~TOPOLOGY.is_boundary_vertex
    noise = torch.randn(int(inside.sum()), dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    start = vertices.clone()
    start[inside, 2] += 0.01 * noise
    terms = tangent_patch_terms(start, TOPOLOGY, RIM, normals[RIM], weight=1.0)
    stays = torch.ones_like(start, dtype=torch.bool)
    stays[inside, 2] = False
    run = guided_projection({"vertices": start}, terms, fixed={"vertices": stays})

    def tilt(x: Tensor) -> float:
        found = BoundaryNormals.of(x, TOPOLOGY).at_boundary[RIM]
        return float(torch.linalg.cross(found, normals[RIM]).norm(dim=1).max())

    assert tilt(start) > 0.02
    assert tilt(vertices) < 0.002
    assert tilt(run.blocks["vertices"]) < 0.1 * tilt(start)


@pytest.mark.parametrize("angle", [0.0, 0.4, -1.1])
def test_bending_at_an_edge_is_its_length_times_the_sine(angle: float) -> None:
    tip = [0.7, 1.7 * math.cos(angle), 1.7 * math.sin(angle)]
    corners = torch.tensor([[0.0, 0, 0], [2, 0, 0], tip], dtype=torch.float64)
    topology = Topology.from_faces([[0, 1, 2]])
    normals = torch.stack([UP, UP, torch.zeros(3, dtype=torch.float64)])  # at the two ends of one edge
    (term,) = boundary_bending_terms(topology, normals, smoothing=1e-9, weight=3.0)
    arguments = term.arguments({"vertices": corners})
    values, jacobians = term.linearised(arguments)
    assert term.num_elements == 1
    assert float(values.abs()) == pytest.approx(2.0 * abs(math.sin(angle)), abs=1e-12)
    assert float(term.contributions(arguments, values)) == pytest.approx(6.0 * abs(math.sin(angle)), abs=1e-8)
    assert bool(torch.isfinite(jacobians).all())


@pytest.mark.parametrize("along", [False, True])
@pytest.mark.parametrize("apart", [0.0, 35.0, 60.0, 110.0, 150.0])
def test_bending_counts_against_the_plane_halfway_between_the_normals_of_both_ends(apart: float, along: bool) -> None:
    """However the prescribed normals twist along an edge or around it, the plane in its middle is level here."""
    tilt = math.radians(apart) / 2.0
    ends = [[math.sin(a), 0.0, math.cos(a)] if along else [0.0, math.sin(a), math.cos(a)] for a in (tilt, -tilt)]
    tip = [0.7, 1.7 * math.cos(0.4), 1.7 * math.sin(0.4)]
    corners = torch.tensor([[0.0, 0, 0], [2, 0, 0], tip], dtype=torch.float64)
    normals = torch.tensor([*ends, [0.0, 0.0, 0.0]], dtype=torch.float64)
    (term,) = boundary_bending_terms(Topology.from_faces([[0, 1, 2]]), normals, smoothing=1e-9)
    assert float(term.values(term.arguments({"vertices": corners})).abs()) == pytest.approx(2.0 * math.sin(0.4))


@pytest.mark.parametrize("apart", [152.0, 180.0])
def test_normals_that_nearly_oppose_each_other_have_no_plane_between_them(apart: float) -> None:
    tilt = math.radians(apart) / 2.0
    rows = [[math.sin(tilt), 0.0, math.cos(tilt)], [-math.sin(tilt), 0.0, math.cos(tilt)], [0.0, 0.0, 0.0]]
    normals = torch.tensor(rows, dtype=torch.float64)
    assert boundary_bending_terms(Topology.from_faces([[0, 1, 2]]), normals, smoothing=1e-9) == []


@pytest.mark.parametrize("seed", range(3))
def test_share_of_the_way_inwards_is_a_quotient_of_distances_from_the_boundary(seed: int) -> None:
    """In the plane: of the centroid of a star and the mean of its neighbours inside, orthogonal to the chord."""
    vertices, topology = wavy_grid(6, 5, triangles=True, seed=seed)
    side = (torch.arange(6) * 5).tolist()  # along y = 0
    flat = vertices * torch.tensor([2.5, 1.5, 0.0], dtype=torch.float64)
    shares = BoundaryNormals.of(flat @ random_rotation(seed).T + 3.0, topology).share
    triangles = flat[topology.triangles][..., :2]
    (a, b, c) = triangles.unbind(1)
    areas = 0.5 * torch.linalg.det(torch.stack([b - a, c - a], 1)).abs()
    for before, vertex, after in zip(side, side[1:], side[2:], strict=False):
        chord = flat[after] - flat[before]
        inwards = torch.stack([-chord[1], chord[0]])
        around = (topology.triangles == vertex).any(1)
        centroid = (areas[around, None] * triangles.mean(1)[around]).sum(0) / areas[around].sum()
        ends = topology.edges[(topology.edges == vertex).any(1)].flatten().unique()
        inner = [w for w in ends.tolist() if w != vertex and not topology.is_boundary_vertex[w]]
        ways = [float((place - flat[vertex, :2]) @ inwards) for place in (centroid, flat[inner, :2].mean(0))]
        assert float(shares[vertex]) == pytest.approx(min(max(ways[0] / ways[1], 0.0), 0.8))


def test_a_surface_that_meets_its_planes_has_no_bending_there() -> None:
    flat = VERTICES * torch.tensor([1.0, 1.0, 0.0], dtype=torch.float64)
    normals = torch.where(TOPOLOGY.is_boundary_vertex[:, None], UP, 0.0)
    (term,) = boundary_bending_terms(TOPOLOGY, normals, smoothing=0.1)
    assert term.num_elements == TOPOLOGY.boundary_edges.shape[0]
    assert float(term.values(term.arguments({"vertices": flat})).abs().max()) == 0.0
    assert boundary_bending_terms(TOPOLOGY, torch.zeros_like(normals), smoothing=0.1) == []


def test_frames_of_patches_do_not_matter() -> None:
    vertices, _ = random_graph(1)
    normals = UP.expand(RIM.numel(), 3)
    first, second = tangent_frames(normals)
    there, back = (BoundaryJets.of(vertices, TOPOLOGY, RIM, normals, f) for f in ((first, second), (second, -first)))
    turned = torch.stack([there.slopes[:, 1], -there.slopes[:, 0]], 1)
    torch.testing.assert_close(back.slopes, turned, atol=1e-10, rtol=0)
