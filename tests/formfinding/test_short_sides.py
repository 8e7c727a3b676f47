"""No side of a polygon collapses in the job that lowers E, where angles and areas would let it."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE, grid_faces, split_quads
from torch import Tensor

from torchfair import Topology
from torchfair.formfinding import FairRecipe, FairSettings, minimise_normal_variation
from torchfair.formfinding.fair.short_sides import ShortSides
from torchfair.geometry import edge_lengths, planarity


def uneven(seed: int = 0) -> tuple[Tensor, Topology]:
    """Nine uneven quads on a saddle."""
    x, y = torch.meshgrid(*(torch.arange(4, dtype=DOUBLE),) * 2, indexing="ij")
    shifts = 0.2 * torch.rand(2, 4, 4, generator=torch.Generator().manual_seed(seed), dtype=DOUBLE)
    x, y = x + shifts[0], y + shifts[1]
    heights = 0.15 * (x - 1.5) * (y - 1.5)
    return torch.stack([x, y, heights], -1).reshape(-1, 3), Topology.from_faces(grid_faces(4, 4))


def shortest_share(vertices: Tensor, start: Tensor, topology: Topology) -> float:
    lengths = edge_lengths(start, topology)
    return float((edge_lengths(vertices, topology) / lengths.clamp_max(float(lengths.mean()))).min())


@pytest.mark.parametrize("seed", [0, 1])
def test_quads_do_not_become_planar_by_becoming_triangles(seed: int) -> None:
    """A side shrank to 1e-4 of its length: a triangle is planar, and the two that share the side are rid of it."""
    vertices, topology = uneven(seed)
    result = minimise_normal_variation(vertices, topology, settings=FairSettings(planar="quads"))
    share = shortest_share(result.vertices, vertices, topology)
    assert share >= 0.2 * (1 - 1e-9)
    assert float(planarity(result.vertices, topology).max()) < 1e-4
    (promise,) = (promise for promise in result.promises if "side" in promise.name)
    assert promise.holds
    assert promise.reached == pytest.approx(share)
    assert result.after["shortest_edge"] == pytest.approx(float(edge_lengths(result.vertices, topology).min()))


def test_the_bound_is_that_of_the_settings() -> None:
    vertices, topology = uneven()
    settings = FairSettings(smallest_edge=0.9, continuation=())
    result = minimise_normal_variation(vertices, topology, settings=settings)
    assert shortest_share(result.vertices, vertices, topology) >= 0.9 * (1 - 1e-9)
    problem = FairRecipe(vertices, topology, settings=settings).problem
    closer = problem.vertices.clone()
    closer[5] += 0.3 * (closer[6] - closer[5])  # both inside
    assert problem.guard.keeps_bounds({"vertices": problem.vertices.clone()})
    assert not problem.guard.keeps_bounds({"vertices": closer})


def test_sides_are_those_of_polygons_against_the_mean_at_most() -> None:
    topology = Topology.from_faces([[0, 1, 2, 3], [2, 1, 4], [4, 5, 2]])
    vertices = torch.tensor([[0.0, 0, 0], [4, 0, 0], [4, 1, 0], [0, 1, 0], [5, 1, 0], [5, 2, 0]], dtype=DOUBLE)
    sides = ShortSides.of(vertices, topology)
    lengths = edge_lengths(vertices, topology)
    assert {tuple(edge) for edge in topology.edges[sides.edges].tolist()} == {(0, 1), (1, 2), (2, 3), (3, 0)}
    assert sides.own.tolist() == pytest.approx([min(float(lengths[k]), float(lengths.mean())) for k in sides.edges])
    assert not len(ShortSides.of(vertices, Topology.from_faces(split_quads(grid_faces(3, 2)))).edges)


def test_the_barrier_of_sides_has_its_derivatives() -> None:
    vertices, topology = uneven()
    sides = ShortSides.of(vertices, topology)
    (term,) = sides.terms(topology, 0.6, weight=1.0)
    ends, least = vertices[term.stencil[0][1]], term.data[0]
    expected = torch.func.vmap(torch.func.jacrev(lambda x, m: term.residual(x[None], m[None])[0]))(ends, least)
    assert term.jacobian is not None
    torch.testing.assert_close(term.jacobian(ends, least), expected.reshape(len(least), -1))
    assert bool((term.residual(ends, least) > 0.0).all())
    lengths = (ends[:, 1] - ends[:, 0]).norm(dim=1, keepdim=True)[..., None]
    assert bool((term.residual(2.01 * least[:, None, None] * ends / lengths, least) == 0.0).all())
    assert bool(torch.isinf(term.residual(0.99 * least[:, None, None] * ends / lengths, least)).all())
    assert not sides.terms(topology, 0.0, weight=1.0)
