"""The quick answer of large meshes: humps around handles, replaced by the step."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from design_tools import Bench
from helpers import DOUBLE, grid_faces

from torchfair import Topology
from torchfair.design.engine import follower
from torchfair.design.engine.coarse import coarse_answer

SIDE = 31
TOPOLOGY = Topology.from_faces(grid_faces(SIDE, SIDE))
MIDDLE, CORNER = SIDE * (SIDE // 2) + SIDE // 2, 0


def grid() -> torch.Tensor:
    x, y = torch.meshgrid(*(torch.arange(SIDE, dtype=DOUBLE),) * 2, indexing="ij")
    return torch.stack([x, y, 0.0 * x], -1).reshape(-1, 3)


def answered(
    handles: list[int], ways: list[tuple[float, float, float]], stays: torch.Tensor | None = None
) -> torch.Tensor:
    vertices, numbers = grid(), torch.tensor(handles)
    places = vertices[numbers] + torch.tensor(ways, dtype=DOUBLE)
    nothing = torch.zeros(len(vertices), dtype=torch.bool)
    return coarse_answer(vertices, TOPOLOGY, numbers, places, nothing if stays is None else stays) - vertices


def test_a_handle_is_where_it_is_pulled_and_its_surroundings_go_along_by_a_smooth_step() -> None:
    moves = answered([MIDDLE], [(0.0, 0.0, 2.0)])
    row = moves.view(SIDE, SIDE, 3)[SIDE // 2, SIDE // 2 :, 2]
    part = 1.0 - torch.arange(len(row), dtype=DOUBLE) / 12.0
    part = part.clamp_min(0.0)
    way = torch.arange(len(row), dtype=DOUBLE)
    expected = 2.0 * part**2 * (3.0 - 2.0 * part) * (12.0 / (12.0 + way))
    torch.testing.assert_close(row, expected, rtol=1e-12, atol=1e-12)
    assert (moves[:, :2] == 0).all()


def test_humps_are_as_wide_as_ways_are_long() -> None:
    for long in (1.0, 4.0, 4.5):
        moved = answered([MIDDLE], [(0.0, 0.0, long)])[:, 2] > 0
        away = (grid() - grid()[MIDDLE]).abs().sum(1)  # along edges
        assert torch.equal(moved, away < max(12.0, 3.0 * long))


def test_what_stays_stays_and_handles_do_not_take_each_other_along() -> None:
    stays = TOPOLOGY.is_boundary_vertex.clone()
    moves = answered([MIDDLE, MIDDLE + 3, CORNER], [(0, 0, 1.0), (0, 0, -0.5), (0.2, 0, 0)], stays)
    torch.testing.assert_close(moves[[MIDDLE, MIDDLE + 3], 2], torch.tensor([1.0, -0.5], dtype=DOUBLE))
    torch.testing.assert_close(moves[CORNER], torch.tensor([0.2, 0, 0], dtype=DOUBLE))
    stays[CORNER] = False
    assert (moves[stays] == 0).all()


def test_a_large_mesh_answers_coarsely_first_and_its_steps_are_the_same(
    bench: Bench, monkeypatch: pytest.MonkeyPatch
) -> None:
    place = bench.vertices[30] * np.array([1.1, 1.1, 1.0])

    def dragged() -> tuple[list[np.ndarray], np.ndarray]:
        bench.frames.clear()
        bench.say(type="move", places=[[30, *map(float, place)]], count=1)
        frames = [frame.vertices for frame in bench.frames]
        bench.say(type="release", id=1)
        released = bench.vertices
        bench.say(type="undo", id=2)
        return frames, released

    plain, end = dragged()
    monkeypatch.setattr(follower, "_COARSE_FROM", 10)
    frames, same = dragged()
    assert not bench.errors
    assert np.abs(frames[0][30] - place).max() < 1e-12, "the first frame has the handle where it is pulled"
    assert np.abs(plain[0][30] - place).max() > 1e-6
    assert all(any(np.array_equal(one, other) for other in frames) for one in plain)
    assert np.array_equal(frames[-1], plain[-1]), "the last one is no coarse answer"
    assert np.array_equal(same, end)


def test_what_the_job_keeps_fixed_stays_in_the_coarse_answer(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(follower, "_COARSE_FROM", 10)
    bench.say(type="choose", choices={"boundary": "fixed"})
    faces = bench.session.history.now.faces
    rim = Topology.from_packed_faces(faces.corners, faces.offsets, len(bench.vertices)).is_boundary_vertex.numpy()
    before = bench.vertices.copy()
    bench.frames.clear()
    bench.say(type="move", places=[[30, *map(float, before[30] * np.array([1.2, 1.2, 1.0]))]], count=1)
    assert np.array_equal(bench.frames[0].vertices[rim], before[rim])
    assert (np.abs(bench.frames[0].vertices - before).max(1) > 1e-6).sum() > 10


def test_where_no_step_is_possible_the_mesh_is_shown_as_it_is(bench: Bench, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(follower, "_COARSE_FROM", 10)
    monkeypatch.setattr(follower.Follower, "step", lambda self: follower.Stepped(False, False))
    before = bench.vertices.copy()
    bench.frames.clear()
    bench.say(type="move", places=[[30, *map(float, before[30] * np.array([1.2, 1.2, 1.0]))]], count=1)
    assert [np.array_equal(frame.vertices, before) for frame in bench.frames] == [False, True]
