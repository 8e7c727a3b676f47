"""Edges that keep their directions within the surface."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE, grid_faces
from torch import Tensor

from torchfair import MeshError, Topology
from torchfair.constraints import EdgeDirections, FlatEdges, edge_direction_terms
from torchfair.formfinding import FairSettings, minimise_normal_variation
from torchfair.geometry import planarity
from torchfair.projection import ElementTerm


def quads(n: int = 6, bend: float = 0.0) -> tuple[Tensor, Topology]:
    """A grid, on a saddle of this bend."""
    x, y = torch.meshgrid(*(torch.arange(n, dtype=DOUBLE),) * 2, indexing="ij")
    z = bend * ((x - 2.3) ** 2 - (y - 2.6) ** 2 + 0.05 * (x - 2.3) * (y - 2.6))
    return torch.stack([x, y, z], -1).reshape(-1, 3), Topology.from_faces(grid_faces(n, n))


def test_the_value_is_half_the_square_of_what_edges_turn() -> None:
    """A plane grid turned by a small angle: every inner edge of length one is beside its direction by the sine."""
    vertices, topology = quads()
    angle = torch.tensor(0.3, dtype=DOUBLE)
    cosine, sine = angle.cos(), angle.sin()
    turn = torch.tensor([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]], dtype=DOUBLE)
    value = EdgeDirections(vertices, topology)(vertices @ turn)
    torch.testing.assert_close(value, 0.5 * topology.num_interior_edges * sine**2)


def test_edges_have_other_directions_than_their_own_where_these_are_given() -> None:
    """A grid is beside the edges of a turned one by the sine of the angle, and the turned one is not."""
    vertices, topology = quads()
    angle = torch.tensor(0.3, dtype=DOUBLE)
    cosine, sine = angle.cos(), angle.sin()
    turn = torch.tensor([[cosine, sine, 0.0], [-sine, cosine, 0.0], [0.0, 0.0, 1.0]], dtype=DOUBLE)
    every = torch.arange(topology.num_interior_edges)
    ends = vertices[topology.interior_edges]
    along = 7.0 * (ends[:, 1] - ends[:, 0]) @ turn  # of any length
    (term,) = edge_direction_terms(vertices, topology, every, along=along, weight=1.0)
    for places, expected in ((vertices, sine.abs()), (vertices @ turn, 0 * sine)):
        values = torch.stack([term.residual(places[ends], *data) for ends, *data in _elements(term)])
        torch.testing.assert_close(values.abs(), expected.expand_as(values))


def _elements(term: ElementTerm) -> list[tuple[Tensor, ...]]:
    """Stencil and data of each element."""
    ((_, stencil),) = term.stencil
    return list(zip(stencil, *term.data, strict=True))


@pytest.mark.parametrize("how", ["stretched", "bent"])
def test_lengths_and_bends_out_of_the_surface_are_free(how: str) -> None:
    vertices, topology = quads()
    if how == "stretched":
        after = vertices * torch.tensor([2.0, 0.5, 1.0], dtype=DOUBLE)
    else:
        after = vertices + torch.stack([0 * vertices[:, 0], 0 * vertices[:, 0], vertices[:, 0] ** 2], 1)
    assert float(EdgeDirections(vertices, topology)(after)) < 1e-28


def turned(before: Tensor, after: Tensor, topology: Topology) -> float:
    """Mean angle in degrees between edges before and after, seen from above."""
    ends = topology.interior_edges
    one, other = ((places[ends[:, 1]] - places[ends[:, 0]])[:, :2] for places in (before, after))
    cross = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    return float(torch.atan2(cross.abs(), (one * other).sum(1)).rad2deg().mean())


def test_planar_faces_turn_edges_less_where_directions_are_kept() -> None:
    vertices, topology = quads(bend=0.08)
    results = {}
    for directions in ("free", "keep"):
        settings = FairSettings(planar="quads", directions=directions, distance_limit=0.1)
        after = minimise_normal_variation(vertices, topology, settings=settings).vertices
        assert float(planarity(after, topology).max()) < 1e-4
        results[directions] = turned(vertices, after, topology)
    assert results["keep"] < 0.7 * results["free"]


@pytest.mark.parametrize("kind", [lambda v, t, e: EdgeDirections(v, t, e), lambda v, t, e: FlatEdges(t, e)])
@pytest.mark.parametrize("number", [-1, 60])
def test_edges_out_of_range_are_named(kind, number: int) -> None:  # type: ignore[no-untyped-def]
    vertices, topology = quads()
    last = topology.num_interior_edges - 1
    with pytest.raises(MeshError, match=rf"numbered 0 to {last}, got \[{number}\]"):
        kind(vertices, topology, torch.tensor([0, number]))
