from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from helpers import DOUBLE
from scipy.spatial import Delaunay
from torch import Tensor

from torchfair import ShapeError
from torchfair.rasterisation import scan
from torchfair.rasterisation.rasterise import interpolate, rasterise, visible_triangles
from torchfair.rasterisation.scan import Spans, triangle_spans

TWO = torch.tensor([[0, 1, 2], [0, 2, 3]])


def rectangle(left: float, top: float, right: float, bottom: float, depth: float = 1.0) -> Tensor:
    corners = [[left, top, depth], [left, bottom, depth], [right, bottom, depth], [right, top, depth]]
    return torch.tensor(corners, dtype=DOUBLE)


def random_triangles(count: int, size: float, seed: int) -> tuple[Tensor, Tensor]:
    generator = np.random.default_rng(seed)
    points = generator.uniform(-0.2 * size, 1.2 * size, (3 * count, 3))
    return torch.from_numpy(points), torch.arange(3 * count).view(count, 3)


def all_spans(points: Tensor, triangles: Tensor, width: int, height: int) -> Spans:
    return Spans(*(torch.cat(parts) for parts in zip(*triangle_spans(points, triangles, width, height), strict=True)))


def naive(points: Tensor, triangles: Tensor, width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    """Every triangle against every pixel centre, in plain loops."""
    index, depth = np.full((height, width), -1), np.full((height, width), np.inf)
    for number, triangle in enumerate(points[triangles].numpy()):
        for row in range(height):
            for column in range(width):
                system = np.vstack([triangle[:, :2].T, np.ones(3)])
                weights = np.linalg.solve(system, [column + 0.5, row + 0.5, 1])
                z = weights @ triangle[:, 2]
                if (weights > 0).all() and z < depth[row, column]:
                    index[row, column], depth[row, column] = number, z
    return index, depth


@pytest.mark.parametrize("box", [(2, 3, 7, 5), (2.2, 2.6, 7.4, 5.4), (1.5, 1.5, 4.5, 3.5)])
def test_rectangle_covers_the_pixel_centres_in_its_half_open_box(box: tuple[float, float, float, float]) -> None:
    left, top, right, bottom = box
    seen = visible_triangles(rectangle(*box), TWO, 9, 8) >= 0
    x, y = torch.arange(9) + 0.5, torch.arange(8) + 0.5
    expected = ((left <= x) & (x < right)) & ((top <= y) & (y < bottom))[:, None]
    assert torch.equal(seen, expected)


@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_meshes_are_covered_without_gaps_or_overlaps(dtype: torch.dtype) -> None:
    """Pixel counts of the triangles of a plane mesh add up to the pixel count of its outline."""
    generator = np.random.default_rng(1)
    inner = np.rint(generator.uniform(0, 64, (300, 2)) * 4) / 4 + 0.5  # many vertices exactly on pixel centres
    corners = np.array([[0, 0], [0, 64], [64, 64], [64, 0]])
    plane = np.unique(np.concatenate([corners, np.clip(inner, 0, 64)]), axis=0)
    triangles = torch.from_numpy(Delaunay(plane).simplices.astype(np.int64))
    points = torch.from_numpy(np.c_[plane, np.zeros(len(plane))]).to(dtype)
    assert all_spans(points, triangles, 64, 64).length.sum() == 64 * 64
    assert bool((visible_triangles(points, triangles, 64, 64) >= 0).all())


def test_agrees_with_a_loop_over_pixels() -> None:
    points, triangles = random_triangles(25, 20.0, seed=2)
    fragments = rasterise(points, triangles, 21, 17)
    index, depth = naive(points, triangles, 21, 17)
    assert np.array_equal(fragments.face_index.numpy(), index)
    assert np.allclose(fragments.depth.numpy(), depth, rtol=1e-12)


def test_barycentric_weights_reproduce_pixel_centre_and_depth() -> None:
    points, triangles = random_triangles(40, 30.0, seed=3)
    fragments = rasterise(points, triangles, 30, 30)
    covered = fragments.face_index >= 0
    corners = points[triangles[fragments.face_index[covered]]]
    places = (fragments.barycentric[covered][..., None] * corners).sum(1)
    rows, columns = torch.nonzero(covered).unbind(1)
    expected = torch.stack([columns + 0.5, rows + 0.5, fragments.depth[covered]], dim=1)
    assert torch.allclose(places, expected, rtol=0, atol=1e-9)
    assert torch.allclose(fragments.barycentric.sum(-1), covered.to(DOUBLE), rtol=0, atol=1e-12)
    assert bool((fragments.depth[~covered] == torch.inf).all())
    assert bool((fragments.barycentric[covered] > -1e-9).all())


@pytest.mark.parametrize("order", [[0, 1], [1, 0]])
def test_nearer_hides_farther_in_any_order(order: list[int]) -> None:
    points = torch.cat([rectangle(0, 0, 6, 6, depth=2.0), rectangle(2, 2, 4, 4, depth=-1.0)])
    triangles = torch.stack([TWO, TWO + 4])[order].view(-1, 3)
    near = torch.tensor([order.index(1) * 2, order.index(1) * 2 + 1])
    index = visible_triangles(points, triangles, 6, 6)
    assert torch.isin(index[2:4, 2:4], near).all()
    index[2:4, 2:4] = -1
    assert not torch.isin(index, near).any()


def test_crossing_triangles_change_places_where_they_cross() -> None:
    points = torch.cat([rectangle(0, 0, 10, 4, depth=5.0), rectangle(0, 0, 10, 4)])
    points[4:, 2] = points[4:, 0]  # depth x
    index = visible_triangles(points, torch.cat([TWO, TWO + 4]), 10, 4)
    assert bool((index[:, :5] >= 2).all())
    assert bool((index[:, 5:] < 2).all())


def test_equal_depths_go_to_the_smaller_number() -> None:
    points = torch.cat([rectangle(0, 0, 5, 5), rectangle(0, 0, 5, 5)])
    assert torch.isin(visible_triangles(points, torch.cat([TWO, TWO + 4]), 5, 5), torch.tensor([0, 1])).all()
    assert torch.isin(visible_triangles(points, torch.cat([TWO + 4, TWO]), 5, 5), torch.tensor([0, 1])).all()


def test_both_sides_are_drawn() -> None:
    points, triangles = random_triangles(10, 20.0, seed=4)
    turned = triangles[:, [0, 2, 1]]
    assert torch.equal(visible_triangles(points, triangles, 20, 20), visible_triangles(points, turned, 20, 20))


def test_triangles_without_area_or_with_infinite_corners_cover_nothing() -> None:
    points = torch.tensor([[0.0, 0, 0], [8, 8, 0], [4, 4, 0], [torch.nan, 1, 1], [9, torch.inf, 0]])
    triangles = torch.tensor([[0, 1, 2], [0, 1, 3], [0, 2, 4], [0, 0, 1]])
    fragments = rasterise(points, triangles, 8, 8)
    assert bool((fragments.face_index == -1).all())
    assert bool((fragments.barycentric == 0).all())


def test_nothing_to_see() -> None:
    nothing = torch.zeros(0, 3, dtype=torch.int64)
    assert bool((rasterise(torch.zeros(0, 3), nothing, 3, 2).face_index == -1).all())
    outside = rectangle(100, 100, 120, 120)
    assert bool((visible_triangles(outside, TWO, 8, 8) == -1).all())


def test_huge_triangles_are_clipped_to_the_screen() -> None:
    points = rectangle(-1e7, -1e7, 1e7, 1e7)
    assert bool((visible_triangles(points, TWO, 5, 4) >= 0).all())


def test_weights_and_depth_are_differentiable() -> None:
    points, triangles = random_triangles(4, 6.0, seed=5)
    index = visible_triangles(points, triangles, 6, 6)
    assert (index >= 0).sum() > 10
    depth_seen = lambda x: interpolate(x, triangles, index)[1][index >= 0]  # noqa: E731
    assert torch.autograd.gradcheck(lambda x: interpolate(x, triangles, index)[0], points.requires_grad_())
    assert torch.autograd.gradcheck(depth_seen, points)


def test_many_small_triangles_span_several_chunks() -> None:
    """More covered pixels than fit one chunk; each chunk boundary would show as a gap or a wrong triangle."""
    points = torch.cat([rectangle(0, 0, 700, 400, depth=1.0), rectangle(0, 0, 700, 400, depth=0.0)])
    index = visible_triangles(points, torch.cat([TWO, TWO + 4]), 700, 400)
    assert bool((index >= 2).all())


@pytest.mark.parametrize(
    ("points", "triangles", "size", "named"),
    [
        (torch.zeros(3, 2), TWO, (4, 4), "points"),
        (torch.zeros(4, 3, dtype=torch.int64), TWO, (4, 4), "points"),
        (torch.zeros(4, 3), TWO.view(3, 2), (4, 4), "triangles"),
        (torch.zeros(4, 3), TWO.float(), (4, 4), "triangles"),
        (torch.zeros(4, 3), TWO, (0, 4), "width and height"),
    ],
)
def test_wrong_shapes_are_named(points: Tensor, triangles: Tensor, size: tuple[int, int], named: str) -> None:
    with pytest.raises(ShapeError, match=named):
        rasterise(points, triangles, *size)


def test_triangles_scanned_some_at_a_time_cover_the_same_pixels(monkeypatch: pytest.MonkeyPatch) -> None:
    points, triangles = random_triangles(50, 9.0, 3)
    whole = all_spans(points, triangles, 40, 30)
    monkeypatch.setattr(scan, "_TRIANGLES", 7)
    for mine, expected in zip(all_spans(points, triangles, 40, 30), whole, strict=True):
        assert torch.equal(mine, expected)


def test_triangles_are_seen_the_same_however_many_are_scanned_at_a_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """In three pictures, of which depths in one are a thousand times as large as in the others."""
    points, triangles = random_triangles(60, 30.0, 6)
    pictures = torch.arange(60) % 3
    points[triangles[pictures == 1].flatten(), 2] *= 1000.0
    whole = visible_triangles(points, triangles, 30, 30, pictures=pictures, num_pictures=3)
    monkeypatch.setattr(scan, "_TRIANGLES", 7)
    assert torch.equal(visible_triangles(points, triangles, 30, 30, pictures=pictures, num_pictures=3), whole)
    for number in range(3):
        mine = torch.nonzero(pictures == number).squeeze(1)
        alone = visible_triangles(points, triangles[mine], 30, 30)
        assert torch.equal(torch.where(alone < 0, -1, mine[alone]), whole[number])


def test_depths_are_told_apart_beyond_those_of_what_is_scanned_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """Levels of the first triangle alone, which is level, would overflow at the others."""
    monkeypatch.setattr(scan, "_TRIANGLES", 1)
    points = torch.cat([rectangle(0, 0, 4, 4, depth) for depth in (0.0, 50.0, -50.0)])
    triangles = torch.tensor([[0, 1, 2], [4, 5, 6], [8, 9, 10]])
    seen = visible_triangles(points, triangles, 4, 4)
    assert set(seen.unique().tolist()) == {-1, 2}
    behind = visible_triangles(points, triangles[:2], 4, 4)
    assert set(behind.unique().tolist()) == {-1, 0}


def spans_one_by_one(points: Tensor, triangles: Tensor, width: int, height: int) -> list[tuple[int, int, int, int]]:
    """Triangle, row, first pixel and length of all runs, by crossings of the three edges at every row."""
    found = []
    for number, corners in enumerate(points.double()[triangles].tolist()):
        if not all(math.isfinite(value) for corner in corners for value in corner):
            continue
        for row in range(height):
            crossings = []
            for k in range(3):
                upper, lower = sorted((corners[k], corners[k - 2]), key=lambda corner: corner[1])
                if upper[1] <= row + 0.5 < lower[1]:
                    slope = (lower[0] - upper[0]) / (lower[1] - upper[1])
                    crossings.append(upper[0] + (row + 0.5 - upper[1]) * slope)
            if crossings:
                start, stop = (min(max(math.ceil(x - 0.5), 0), width) for x in (min(crossings), max(crossings)))
                if stop > start:
                    found.append((number, row, start, stop - start))
    return found


@pytest.mark.parametrize("case", range(12))
def test_spans_against_crossings_of_edges_one_by_one(case: int) -> None:
    torch.manual_seed(case)
    points = torch.rand(20, 3, dtype=DOUBLE) * torch.tensor([50.0, 40, 3]) - 5
    if case % 3 == 0:
        points = (2 * points).round() / 2  # on pixel centres and borders, with level edges
    if case % 4 == 1:
        points = points.float()
    if case % 5 == 0:
        points = 1e3 * (points - 15) + 15
    if case % 2:
        points[3, 0], points[7, 1], points[11, 2] = math.nan, math.inf, -math.inf
    triangles = torch.randint(0, 20, (60, 3))
    spans = all_spans(points, triangles, 37, 29)
    columns = torch.stack([spans.triangle, spans.row, spans.start, spans.length], 1)
    expected = spans_one_by_one(points, triangles, 37, 29)
    assert expected
    assert list(map(tuple, columns.tolist())) == expected
