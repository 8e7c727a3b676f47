from __future__ import annotations

import itertools
import math

import pytest
import torch
from geometry_meshes import torus
from helpers import DOUBLE, wavy_grid

from torchfair import MeshError, ShapeError
from torchfair.energies import PolylineFairness, polyline_fairness
from torchfair.polylines import straight_triples

TRIPLES = torch.tensor([[0, 1, 2], [5, 6, 7], [1, 6, 11]])


def test_given_triples_are_summed_as_in_a_loop():
    vertices, topology = wavy_grid(5, 5)
    terms = [(vertices[p] - 2 * vertices[v] + vertices[n]).square().sum() for p, v, n in TRIPLES.tolist()]
    module = PolylineFairness(topology, TRIPLES)
    torch.testing.assert_close(module.per_triple(vertices), torch.stack(terms))
    torch.testing.assert_close(module(vertices), sum(terms))
    torch.testing.assert_close(polyline_fairness(vertices, topology, TRIPLES), sum(terms))


def test_by_default_the_straight_triples_of_the_mesh():
    vertices, topology = wavy_grid(5, 5)
    expected = polyline_fairness(vertices, topology, straight_triples(topology))
    torch.testing.assert_close(polyline_fairness(vertices, topology), expected)
    torch.testing.assert_close(PolylineFairness(topology)(vertices), expected)
    assert polyline_fairness(vertices.round(), topology).item() == 0


def test_one_lifted_vertex_inside_a_grid():
    """Two polylines run through it, each with second differences 1, -2, 1 of its height."""
    vertices, topology = wavy_grid(7, 7)
    vertices = vertices.round()
    vertices[24, 2] = 1.0
    assert polyline_fairness(vertices, topology).item() == pytest.approx(2 * (1 + 4 + 1))


def test_circles_of_a_torus_in_closed_form():
    rows, columns = 16, 12
    vertices, topology = torus(rows, columns, big=3.0, small=1.0)
    across = columns * rows * (2 - 2 * math.cos(2 * math.pi / columns)) ** 2
    distances = [3 + math.cos(2 * math.pi * k / columns) for k in range(columns)]
    along = rows * sum(d**2 for d in distances) * (2 - 2 * math.cos(2 * math.pi / rows)) ** 2
    assert polyline_fairness(vertices, topology).item() == pytest.approx(across + along)


def test_vanishes_with_second_order_under_refinement():
    values = [polyline_fairness(*torus(n, n)).item() for n in (12, 24, 48)]
    assert all(1.8 < math.log2(coarse / fine) < 2.2 for coarse, fine in itertools.pairwise(values))


def test_refuses_triples_that_do_not_fit():
    vertices, topology = wavy_grid(5, 5)
    with pytest.raises(MeshError, match=r"1 triple\(s\) use vertex numbers out of range 0..24.*\[0, 1, 25\]"):
        PolylineFairness(topology, torch.tensor([[0, 1, 2], [0, 1, 25]]))
    with pytest.raises(ShapeError, match="triples: expected an integer tensor"):
        PolylineFairness(topology, TRIPLES.double())
    assert vertices.dtype == DOUBLE
