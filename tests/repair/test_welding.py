"""Seams are found and closed along edges; what only happens to be near stays apart."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import torch
from helpers import cube, wavy_grid
from hypothesis import given, settings
from hypothesis import strategies as st

from torchfair import MeshError, Topology
from torchfair.energies import NormalVariation
from torchfair.errors import SettingsError
from torchfair.repair import coincident_edges, repair_mesh

SPLIT = torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 1, 0.2], [0, 0, 0], [1, 1, 0.2], [0, 1, 0]], dtype=torch.float64)
PAIR = [[0, 1, 2], [3, 4, 5]]


def energy(vertices: torch.Tensor, topology: Topology) -> float:
    return float(NormalVariation(topology)(vertices))


def soup_of(vertices: torch.Tensor, topology: Topology, seed: int) -> tuple[torch.Tensor, list[list[int]]]:
    """Every face with vertices of its own, in random order."""
    rng = np.random.default_rng(seed)
    order = rng.permutation(topology.corners.numel())
    places = np.empty_like(order)
    places[order] = np.arange(order.size)
    offsets = topology.face_offsets.tolist()
    faces = [places[a:b].tolist() for a, b in itertools.pairwise(offsets)]
    return vertices[topology.corners[order]], faces


def test_two_triangles_with_a_double_diagonal() -> None:
    loose, joined = repair_mesh(SPLIT, PAIR), repair_mesh(SPLIT, PAIR, weld=True)
    assert energy(loose.vertices, loose.topology) == 0.0
    assert joined.faces == [[0, 1, 2], [0, 2, 3]]
    assert energy(joined.vertices, joined.topology) == pytest.approx(0.396, abs=5e-4)
    assert joined.vertex_map.tolist() == [0, 1, 2, 0, 2, 3]
    assert joined.kept_vertices.tolist() == [0, 1, 2, 5]
    assert joined.messages == [
        "welded 2 vertex(es) to others at the same place, at most 0 away: vertices 3 to 0, 4 to 2."
    ]


def test_double_edges_are_told_and_single_ones_not() -> None:
    told = coincident_edges(SPLIT, Topology.from_faces(PAIR))
    assert told is not None
    assert told.told().startswith("not welded: 1 pair(s) of boundary edges lie on each other")
    assert "edges (2, 0) and (3, 4)" in told.told()
    for vertices, topology in (wavy_grid(), cube()):
        assert coincident_edges(vertices, topology) is None


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), scale=st.sampled_from([1e-6, 1.0, 1e6]), far=st.sampled_from([0.0, 100.0]))
def test_a_soup_becomes_the_mesh_that_it_was(seed: int, scale: float, far: float) -> None:
    """Of any size, away from the origin, with noise below single precision."""
    vertices, topology = wavy_grid(5, 6, triangles=bool(seed % 2))
    vertices = scale * (vertices + far)
    points, faces = soup_of(vertices, topology, seed)
    result = repair_mesh(points.float().double(), faces, weld=True)
    assert result.topology.num_vertices == topology.num_vertices
    assert result.topology.num_interior_edges == topology.num_interior_edges
    assert torch.allclose(result.vertices[result.topology.corners], vertices[topology.corners], rtol=1e-6)


def test_the_tolerance_is_a_distance() -> None:
    moved = SPLIT + torch.tensor([0, 0, 0, 1, 1, 0]).double()[:, None] * torch.tensor([0.0, 0.01, 0.0]).double()
    assert repair_mesh(moved, PAIR, weld=0.02).topology.num_vertices == 4
    assert repair_mesh(moved, PAIR, weld=0.005).topology.num_vertices == 6
    assert repair_mesh(moved, PAIR, weld=True).topology.num_vertices == 6
    assert repair_mesh(SPLIT, PAIR, weld=0.0).topology.num_vertices == 4
    for wrong in (-1.0, float("nan"), float("inf"), "1"):
        with pytest.raises(SettingsError, match="weld must be"):
            repair_mesh(SPLIT, PAIR, weld=wrong)  # type: ignore[arg-type]


def test_points_that_touch_without_a_common_edge_stay_apart() -> None:
    points = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [-1, 0, 0], [0, -1, 0]], dtype=torch.float64)
    assert repair_mesh(points, PAIR, weld=True).topology.num_vertices == 6


def test_sheets_that_meet_in_threes_are_named_and_split_where_asked() -> None:
    points = torch.tensor([[0.0, 0, 0], [0, 1, 0], [1, 0, 0], [-1, 0, 0], [0, 0, 1]], dtype=torch.float64)
    loose = points[[0, 1, 3, 1, 0, 2, 0, 1, 4]]
    faces = [[0, 1, 2], [3, 4, 5], [6, 7, 8]]
    with pytest.raises(MeshError, match=r"1 edge\(s\) have more than two faces: edge \(0, 1\) of faces \[0, 1, 2\]"):
        repair_mesh(loose, faces, weld=True)
    result = repair_mesh(loose, faces, weld=True, split_edges=True)
    assert result.faces == [[0, 1, 2], [1, 0, 3], [4, 5, 6]]


def test_t_junctions_take_the_vertex_into_the_long_edge() -> None:
    """Also from vertices of their own, and only where a half of the edge is there, too."""
    points = torch.tensor(
        [[0.0, 0, 0], [2, 0, 0], [1, 0, 0], [0.5, 0, 0], [1, 1, 0.3], [1, -1, 0]], dtype=torch.float64
    )
    shared = repair_mesh(points, [[0, 3, 4], [3, 2, 4], [2, 1, 4], [1, 0, 5]])
    assert shared.faces[3] == [1, 2, 3, 0, 5]
    assert shared.topology.num_interior_edges == 5
    loose = points[[0, 2, 4, 2, 1, 4, 1, 0, 5]]
    own = repair_mesh(loose, [[0, 1, 2], [3, 4, 5], [6, 7, 8]], weld=True)
    assert own.faces == [[0, 1, 2], [1, 3, 2], [3, 1, 0, 4]]
    assert own.kept_corners.tolist() == [0, 1, 2, 3, 4, 5, 6, -1, 7, 8]
    touching = torch.tensor(
        [[0.0, 0, 0], [2, 0, 0], [1, -1, 0], [1, 0, 0], [1.5, 1, 0], [0.5, 1, 0]], dtype=torch.float64
    )
    assert repair_mesh(touching, [[0, 1, 2], [3, 4, 5]]).messages == []


def test_neighbours_that_are_turned_over_are_welded_and_turned_back() -> None:
    result = repair_mesh(SPLIT, [[0, 1, 2], [5, 4, 3]], weld=True)
    assert result.flipped_faces.tolist() == [1]
    assert result.topology.num_interior_edges == 1
    assert result.kept_corners.tolist() == [0, 1, 2, 3, 5, 4]


def test_a_batch_is_welded_where_all_its_meshes_touch() -> None:
    bent = SPLIT.clone()
    bent[[3, 4]] += 0.5
    assert repair_mesh(torch.stack([SPLIT, 2 * SPLIT]), PAIR, weld=True).topology.num_vertices == 4
    assert repair_mesh(torch.stack([SPLIT, bent]), PAIR, weld=True).topology.num_vertices == 6


@pytest.mark.parametrize("scale", [1e-300, 1e300])
def test_no_size_is_too_small_or_too_large(scale: float) -> None:
    result = repair_mesh(scale * SPLIT, [*PAIR, [0, 1, 1]], weld=1e-9 * scale)
    assert result.faces == [[0, 1, 2], [0, 2, 3]]
    assert coincident_edges(scale * SPLIT, Topology.from_faces(PAIR)) is not None


def test_points_that_are_not_finite_are_named() -> None:
    points = SPLIT.clone()
    points[4, 1] = float("nan")
    with pytest.raises(MeshError, match="not finite: vertices 4"):
        repair_mesh(points, PAIR)


def apart(gap: float, size: float = 1.0, shift: float = 0.0) -> torch.Tensor:
    """The vertices of the pair with the second triangle higher by a gap."""
    vertices = SPLIT.clone()
    vertices[3:, 2] += gap
    return size * vertices + shift


@pytest.mark.parametrize(
    ("gap", "shift", "joined"),
    [
        (3e-7, 0.0, True),
        (3e-6, 0.0, False),
        (1e-4, 1e3, True),
        (1e-3, 1e3, False),
        (5e-3, 1e6, True),
        (0.03, 1e6, False),
    ],
)
def test_the_default_tolerance_is_rounding_to_single_precision_but_small_against_edges(
    gap: float, shift: float, joined: bool
) -> None:
    assert (len(repair_mesh(apart(gap, shift=shift), PAIR, weld=True).vertices) == 4) == joined


def test_the_distance_that_is_told_has_the_unit_of_the_input() -> None:
    (message,) = repair_mesh(apart(0.25, 1000.0), PAIR, weld=300.0).messages
    assert "at most 2.5e+02 away" in message
