"""Snapshots of live sessions, ways back, and whole solves between moves."""

from __future__ import annotations

import itertools

import pytest
import torch
from session_steps import MIDDLE, above, drag, opened, sheet
from torch import Tensor

from torchfair import ShapeError
from torchfair.formfinding import (
    FairRecipe,
    FairSettings,
    Session,
    minimise_normal_variation,
)
from torchfair.projection import IterationRecord


@pytest.mark.parametrize("back", ["let go", "pulled back"])
def test_a_mesh_that_a_handle_has_pulled_off_the_reference_comes_back_to_it(back: str) -> None:
    session = opened()
    drag(session, 8)
    near = session.recipe.problem.near
    assert near.design_mode
    if back == "let go":
        session.free([MIDDLE])
    else:
        session.move({MIDDLE: above(session, 0.0)})
    far = [float(near.distances(session.state["vertices"]).max())]
    for _ in range(20):
        if not session.step().accepted:
            break
        far.append(float(near.distances(session.state["vertices"]).max()))
    assert not near.design_mode
    session.settle()
    limit = float(near.limits.max())
    assert far[0] > 0.5 > limit
    assert all(after <= max(before, limit) * (1.0 + 1e-6) for before, after in itertools.pairwise(far[1:]))
    assert float(near.distances(session.state["vertices"]).max()) <= limit


def test_the_way_back_to_the_reference_is_in_snapshots() -> None:
    session = opened()
    drag(session, 8)
    session.free([MIDDLE])
    session.step()
    snapshot = session.snapshot()
    session.step()
    once = session.vertices
    drag(session, 3)
    session.restore(snapshot)
    session.step()
    assert torch.equal(session.vertices, once)


@pytest.mark.parametrize("at", ["start", "dragged", "settled"])
def test_snapshots_bring_everything_back_bit_for_bit(at: str) -> None:
    session = opened()
    if at != "start":
        drag(session)
    if at == "settled":
        session.settle()
    snapshot = session.snapshot()

    def goes_on() -> list[Tensor]:
        places = []
        drag(session, 3, start=0.4)
        places.append(session.vertices)
        session.hold([8])
        session.weigh(fairness=1.0)
        session.step()
        session.settle()
        places.append(session.vertices)
        return places

    once = goes_on()
    runs = len(session.runs)
    session.restore(snapshot)
    assert session.recipe.settings.fairness_weight == FairSettings().fairness_weight
    twice = goes_on()
    assert len(session.runs) == runs
    for first, second in zip(once, twice, strict=True):
        assert torch.equal(first, second)


def test_a_callback_that_raises_leaves_a_session_as_it_was() -> None:
    session = opened()
    drag(session)
    before, runs = session.vertices.clone(), len(session.runs)
    undisturbed = session.snapshot()
    session.solve()
    expected = session.vertices.clone()
    session.restore(undisturbed)

    def fail(record: IterationRecord) -> None:
        if record.iteration == 3:
            raise ZeroDivisionError

    session.callback = fail
    with pytest.raises(ZeroDivisionError):
        session.solve()
    assert torch.equal(session.vertices, before)
    assert len(session.runs) == runs
    session.callback = None
    session.solve()
    assert torch.equal(session.vertices, expected)


def test_a_whole_solve_from_a_session_is_the_job() -> None:
    vertices, topology = sheet()
    session = Session(FairRecipe(vertices, topology))
    session.solve()
    result = minimise_normal_variation(vertices, topology)
    torch.testing.assert_close(session.vertices, result.vertices, rtol=0.0, atol=1e-9)


def test_the_time_limit_is_that_of_a_whole_solve() -> None:
    from dataclasses import replace

    settings = FairSettings()
    limited = replace(settings, projection=replace(settings.projection, time_limit=0.0))
    result = minimise_normal_variation(*sheet(), settings=limited)
    assert result.stopped
    assert len(result.runs) == 1


def test_other_handles_between_whole_solves() -> None:
    """A session that is not live has terms for its handles alone, which are made anew where there are others."""
    session = Session(FairRecipe(*sheet(), handles={MIDDLE: above(opened(), 0.2)}), live=False)
    session.solve()
    session.move({10: above(session, 0.1, 10)})
    session.solve()
    assert session.measures()["largest_handle_distance"] < 0.05 * session.recipe.unit.length


def test_a_mesh_is_put_where_it_was_and_goes_on_from_there_beyond_the_limits_too() -> None:
    session = opened()
    session.place(session.recipe.given)
    assert torch.equal(session.vertices, session.recipe.given)
    drag(session)
    session.settle()
    away = session.vertices
    fresh = opened()
    fresh.place(away)
    assert torch.allclose(fresh.vertices, away, rtol=0.0, atol=1e-12)
    limit = fresh.recipe.settings.distance_limit
    assert limit is not None
    assert fresh.measures()["largest_distance_relative"] > limit  # where a barrier would be infinite
    assert fresh.step().accepted
    assert fresh.measures()["largest_distance_relative"] < session.measures()["largest_distance_relative"]
    with pytest.raises(ShapeError):
        fresh.place(away[:-1])


def test_states_of_a_solve_are_watched() -> None:
    session, seen = opened(), []
    session.watch = lambda vertices: seen.append(vertices.clone())
    session.solve()
    assert torch.equal(seen[0], session.recipe.given)
    assert any(torch.equal(vertices, session.vertices) for vertices in seen)
    session.watch = None
    count = len(seen)
    session.settle()
    assert len(seen) == count
