"""Where surfaces run through themselves: known meshes, and triangles against rational arithmetic."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import torch
from helpers import wavy_grid
from hypothesis import given, settings
from hypothesis import strategies as st

from torchfair import Topology
from torchfair._exact_triangles import meet_exactly
from torchfair.errors import ShapeError
from torchfair.self_intersections import _near_pairs, self_intersections
from torchfair.shapes import icosphere

DOUBLE = torch.float64


def soup(corners: np.ndarray) -> tuple[torch.Tensor, Topology]:
    """Triangles (n, 3, 3) without common vertices."""
    count = len(corners)
    return torch.from_numpy(corners.reshape(-1, 3)), Topology.from_faces(torch.arange(3 * count).view(count, 3))


@pytest.mark.parametrize("spread", [0.3, 1.0])
@pytest.mark.parametrize("flat", [False, True])
def test_triangles_in_space_and_in_a_plane_meet_where_exact_arithmetic_says_so(spread: float, flat: bool) -> None:
    rng = np.random.default_rng(3)
    corners = 0.5 * rng.normal(size=(30, 3, 3)) + spread * rng.normal(size=(30, 1, 3))
    if flat:
        corners[..., 2] = 0.25 * corners[..., 0]  # exact: coplanar
    found = self_intersections(*soup(corners))
    pairs = itertools.combinations(range(len(corners)), 2)
    expected = [(i, j) for i, j in pairs if meet_exactly(corners[i], corners[j])]
    assert len(expected) >= 4
    assert [tuple(pair) for pair in found.tolist()] == expected


@given(st.lists(st.integers(-2, 2), min_size=18, max_size=18))
@settings(max_examples=150, deadline=None)
def test_triangles_on_a_grid_meet_where_points_of_them_do(numbers: list[int]) -> None:
    """On small integers everything that can be degenerate is: touching corners, sides in sides, coplanar overlap."""
    a, b = np.array(numbers, float).reshape(2, 3, 3)
    if any(np.linalg.norm(np.cross(x[1] - x[0], x[2] - x[0])) == 0 for x in (a, b)):
        return
    distance = separation(a, b)
    found = len(self_intersections(*soup(np.stack([a, b])))) == 1
    assert found == (distance < 1e-9)


def separation(a: np.ndarray, b: np.ndarray) -> float:
    """Distance of two triangles: the least over all pairs of corners, sides and insides that is attained in both."""
    parts = [list(part) for size in (1, 2, 3) for part in itertools.combinations(range(3), size)]
    least = math.inf
    for p, q in itertools.product([a[part] for part in parts], [b[part] for part in parts]):
        directions = np.concatenate([p[1:] - p[0], q[0] - q[1:]]).T  # p[0] - q[0] + directions @ weights joins both
        weights = np.linalg.lstsq(directions, q[0] - p[0])[0]
        ours, others = np.split(weights, [len(p) - 1])
        if min(*ours, 1 - ours.sum(), *others, 1 - others.sum()) >= -1e-12:
            least = min(least, float(np.linalg.norm(p[0] - q[0] + directions @ weights)))
    return least


def test_meshes_without_crossings_have_none_not_even_flat_ones() -> None:
    sphere = icosphere(2)
    assert self_intersections(sphere.vertices, sphere.topology).shape == (0, 2)
    vertices, topology = wavy_grid(7, 6, triangles=True)
    flat = vertices * torch.tensor([1.0, 1.0, 0.0], dtype=vertices.dtype)
    tilted = flat @ torch.linalg.qr(torch.randn(3, 3, generator=torch.Generator().manual_seed(1)).double())[0]
    for places in (vertices, flat, tilted):
        assert not len(self_intersections(places, topology))


def test_two_spheres_cross_along_a_circle() -> None:
    sphere = icosphere(2)
    moved = sphere.vertices + torch.tensor([1.2, 0.1, 0.0], dtype=DOUBLE)
    faces = torch.tensor(sphere.topology.face_lists())
    count = sphere.topology.num_vertices
    both = Topology.from_faces(torch.cat([faces, faces + count]))
    found = self_intersections(torch.cat([sphere.vertices, moved]), both)
    assert len(found) > 30
    assert bool((found[:, 0] < len(faces)).all())
    assert bool((found[:, 1] >= len(faces)).all())
    permuted = self_intersections(torch.cat([sphere.vertices, moved])[:, [2, 0, 1]] * 1e-4, both)
    assert torch.equal(found, permuted)


def test_faces_with_one_common_vertex_meet_only_elsewhere() -> None:
    """A star that winds around its centre twice runs through itself; one that winds once does not."""
    for turns in (1, 2):
        angle = torch.arange(10, dtype=DOUBLE) * (turns * torch.pi / 5)
        height = 0.3 * torch.cos(angle / 2 * (3 if turns == 2 else 2))
        rim = torch.stack([angle.cos(), angle.sin(), height], 1)
        faces = [[0, 1 + i, 1 + (i + 1) % 10] for i in range(10)]
        found = self_intersections(torch.cat([torch.zeros(1, 3, dtype=DOUBLE), rim]), Topology.from_faces(faces))
        assert bool(len(found)) == (turns == 2)


def test_polygons_are_named_by_their_own_numbers() -> None:
    square = torch.tensor([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=DOUBLE)
    upright = square[:, [0, 2, 1]] + torch.tensor([0.0, 0.5, -0.5], dtype=DOUBLE)
    both = torch.cat([square, upright])
    assert self_intersections(both, Topology.from_faces([[0, 1, 2, 3], [4, 5, 6, 7]])).tolist() == [[0, 1]]


def test_batches_are_refused() -> None:
    sphere = icosphere(0)
    with pytest.raises(ShapeError):
        self_intersections(sphere.vertices.expand(2, -1, -1), sphere.topology)


@pytest.mark.parametrize(
    "spread", [(1.0, 1.0, 1.0), (1.0, 1.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1e-9, 1.0), (0.0, 0.0, 0.0)]
)
def test_boxes_that_meet_are_all_found_once_whatever_their_sizes(spread: tuple[float, float, float]) -> None:
    """Against all pairs: among small triangles some that reach across all others; flat in some directions, too."""
    random = np.random.default_rng(7)
    triangles = random.uniform(0.0, 1.0, (150, 1, 3)) + random.normal(0.0, 0.02, (150, 3, 3))
    triangles[:3] = random.uniform(0.0, 1.0, (3, 3, 3))
    triangles *= spread
    found = np.sort(np.concatenate(list(_near_pairs(triangles))), axis=1)
    low, high = triangles.min(1), triangles.max(1)
    meet = ((low[:, None] <= high) & (low <= high[:, None])).all(2)
    expected = np.argwhere(np.triu(meet, 1))
    assert np.array_equal(found[np.lexsort(found.T[::-1])], expected)
