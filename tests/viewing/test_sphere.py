from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, random_rotation

from torchfair.viewing.sphere import arc_pieces, fit_sphere_view, on_sphere

UP = torch.tensor([0.0, 0, 1], dtype=DOUBLE)
FRONT = torch.tensor([0.0, -1, 0], dtype=DOUBLE)


def unit_vectors(count: int, seed: int = 0) -> torch.Tensor:
    points = torch.randn(count, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(seed))
    return torch.nn.functional.normalize(points, dim=1)


def polyline_lengths(pieces: list[torch.Tensor]) -> torch.Tensor:
    return torch.cat([torch.linalg.vector_norm(p.diff(dim=1), dim=-1).sum(1) for p in pieces])


@pytest.mark.parametrize("spread", [1.0, 0.02])
def test_arcs_stay_on_the_sphere_and_have_the_length_of_the_angle(spread: float) -> None:
    points = unit_vectors(40)
    points[1::2] = torch.nn.functional.normalize(points[::2] + spread * points[1::2], dim=1)
    arcs = torch.arange(40).view(-1, 2)
    pieces = arc_pieces(points, arcs)
    for piece in pieces:
        assert torch.allclose(torch.linalg.vector_norm(piece, dim=-1), torch.ones(piece.shape[:2], dtype=DOUBLE))
    angles = torch.linalg.vector_norm(points[::2] - points[1::2], dim=1).div(2).asin().mul(2)
    lengths = polyline_lengths(pieces).sort().values
    assert torch.allclose(lengths, angles.sort().values, rtol=1e-3)
    ends = torch.cat([piece[:, [0, -1]] for piece in pieces])
    assert torch.allclose(ends.sum((0, 1)), points.sum(0))


def test_arcs_without_a_direction_are_left_out() -> None:
    points = torch.tensor([[1.0, 0, 0], [-1, 0, 0], [0, 0, 0]], dtype=DOUBLE)
    pieces = arc_pieces(points, torch.tensor([[0, 1], [0, 2], [2, 2]]))
    assert sum(len(piece) for piece in pieces) == 0
    still = arc_pieces(points, torch.tensor([[0, 0]]))
    assert torch.equal(still[0], points[:1].expand(1, 2, 3))


def test_window_holds_all_points_and_fits_them() -> None:
    points = torch.nn.functional.normalize(FRONT + 0.1 * unit_vectors(30), dim=1)
    view = fit_sphere_view(points, torch.zeros(3, 3), towards_eye=FRONT, up=UP)
    seen = (points @ view.axes.T)[:, :2] - torch.tensor(view.centre)
    assert seen.abs().max() <= view.reach
    assert seen.abs().max() > 0.85 * view.reach
    assert 3 <= 2 * math.degrees(math.asin(view.reach)) / view.net_step < 10


def test_whole_sphere_when_points_spread_or_lie_behind() -> None:
    for points in (unit_vectors(50), -FRONT[None], torch.zeros(0, 3), torch.zeros(4, 3)):
        view = fit_sphere_view(points, towards_eye=FRONT, up=UP)
        assert view.centre == (0.0, 0.0)
        assert view.reach > 1
        assert view.net_step == 30


def test_window_does_not_depend_on_a_common_rotation() -> None:
    points = torch.nn.functional.normalize(FRONT + 0.2 * unit_vectors(30), dim=1)
    turn = random_rotation(2)
    first = fit_sphere_view(points, towards_eye=FRONT, up=UP)
    second = fit_sphere_view(points @ turn.T, towards_eye=turn @ FRONT, up=turn @ UP)
    assert second.reach == pytest.approx(first.reach)
    assert math.dist(second.centre, first.centre) < 1e-12


def test_only_unit_vectors_count() -> None:
    points = torch.tensor([[1.0, 0, 0], [0, 0, 0], [2, 0, 0], [torch.nan, 0, 0]])
    assert on_sphere(points).tolist() == [[1, 0, 0]]
