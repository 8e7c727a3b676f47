"""The graph Laplacian of a mesh."""

from __future__ import annotations

import numpy as np
from helpers import wavy_grid

from torchfair import Topology
from torchfair._graph import graph_laplacian
from torchfair.geometry import umbrella_vectors


def test_laplacian_times_positions_is_minus_valence_times_umbrella() -> None:
    vertices, topology = wavy_grid(6, 5, triangles=True)
    umbrellas = umbrella_vectors(vertices, topology, include_boundary=True)
    expected = -topology.valences[:, None] * umbrellas
    np.testing.assert_allclose(graph_laplacian(topology) @ vertices.numpy(), expected.numpy(), atol=1e-12)


def test_rows_sum_to_zero_and_isolated_vertices_have_none() -> None:
    laplacian = graph_laplacian(Topology.from_faces([[0, 1, 2]], num_vertices=5))
    assert laplacian.shape == (5, 5)
    assert not laplacian.sum(axis=1).any()
    assert not laplacian[3:].toarray().any()
