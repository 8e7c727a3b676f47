"""Live sessions: handles that move and are let go, vertices that are held, steps that come to rest."""

from __future__ import annotations

import itertools

import pytest
import torch
from helpers import DOUBLE
from session_steps import MIDDLE, above, drag, opened, sheet

from torchfair import MeshError, ShapeError
from torchfair.errors import SettingsError
from torchfair.formfinding import (
    DenoiseRecipe,
    FairRecipe,
    FormRecipe,
    Session,
)
from torchfair.shapes import Torus, principal_triangles


@pytest.mark.parametrize("recipe", [FairRecipe, FormRecipe])
@pytest.mark.parametrize("height", [1.0, 3.0])
def test_a_handle_that_is_let_go_far_away_goes_all_the_way(recipe: type[FairRecipe], height: float) -> None:
    """A live step pulls by half an edge at most, and the rest was forgotten when the mesh came to rest after it."""
    session = Session(recipe(*sheet()))
    place = above(session, height)
    session.move({MIDDLE: place})
    assert session.step().accepted
    assert not session.settle()
    assert float((session.vertices[MIDDLE] - torch.tensor(place)).norm()) < 0.05 * session.recipe.unit.length


def test_a_handle_that_is_dragged_is_followed_step_by_step() -> None:
    session = opened()
    assert max(drag(session, 8)) < 0.01
    others = (session.vertices - session.recipe.given).norm(dim=1)
    near = session.recipe.topology.edges
    ring = near[(near == MIDDLE).any(1)].flatten().unique()
    assert float(others[ring].min()) > 0.02  # its surroundings come along


def test_steps_at_rest_are_none_and_say_so() -> None:
    session = opened()
    for _ in range(400):  # plain Gauss-Newton steps, each of which leaves 0.9 of the gradient
        progress = session.step()
        if not progress.accepted:
            break
    assert not progress.accepted
    assert progress.reason == "at rest"
    before = session.vertices
    assert not session.step().accepted
    assert torch.equal(session.vertices, before)


def test_the_merit_never_rises_between_moves() -> None:
    session, merits = opened(), []
    session.move({MIDDLE: above(session, 0.4)})
    for _ in range(6):
        progress = session.step()
        assert progress.record is not None
        merits.append(progress.record.merit)
    assert merits == sorted(merits, reverse=True)


def test_settling_and_solving_end_below_where_following_left_off() -> None:
    session = opened()
    drag(session)
    followed = session.measures()
    assert not session.settle()
    settled = session.measures()
    session.solve()
    assert session.runs[-1].merit <= session.runs[0].merit * 1.01
    assert settled["normal_variation"] <= followed["normal_variation"] * (1.0 + 1e-3)
    assert settled["largest_handle_distance"] < 0.01


def test_far_moves_are_followed_in_portions() -> None:
    session = opened()
    session.move({MIDDLE: above(session, 2.0)})
    gaps = []
    for _ in range(8):
        assert session.step().accepted
        gaps.append(session.measures()["largest_handle_distance"] / session.recipe.unit.length)
    assert gaps[0] > 1.4  # half a mean edge at a time
    assert gaps[-1] < 0.02
    assert session.measures()["flipped_faces"] == 0


def test_held_vertices_stay_exactly_and_come_along_when_they_are_freed() -> None:
    session = opened()
    held = [MIDDLE - 1, MIDDLE + 1]
    session.hold(held)
    drag(session)
    assert torch.equal(session.vertices[held], session.recipe.given[held])
    session.free(held)
    drag(session, start=0.4)
    assert float((session.vertices[held] - session.recipe.given[held]).norm(dim=1).min()) > 0.01


def test_a_vertex_that_is_held_after_it_moved_stays_there() -> None:
    session = opened()
    drag(session)
    place = session.vertices[MIDDLE].clone()
    session.hold([MIDDLE])
    session.move({10: above(session, 0.2, 10)})
    session.step()
    torch.testing.assert_close(session.vertices[MIDDLE], place, rtol=0.0, atol=1e-14)


def test_handles_that_are_let_go_no_longer_pull() -> None:
    session = opened(distance_limit=None)
    drag(session)
    session.free([MIDDLE])
    session.step()
    session.settle()
    assert float((session.vertices[MIDDLE] - torch.tensor(above(session, 0.4))).norm()) > 0.2


def test_live_steps_go_on_while_barriers_cut_them_short_of_the_handle() -> None:
    """On the torus of table 20 the distance limit cuts the second move, which ends just within it."""
    mesh = principal_triangles(Torus(2.0, 1.0), 12, 40)
    session = Session(FairRecipe(mesh.vertices, mesh.topology))
    trials, unit = [], session.recipe.unit.length
    stride = 0.1 * unit * torch.tensor([0.3, 0.2, 1.0], dtype=DOUBLE) / 1.13**0.5
    handle = mesh.topology.num_vertices // 5
    for number in range(1, 5):
        place = mesh.vertices[handle] + number * stride
        session.move({handle: place.tolist()})
        trials.append(session.step().trials)
        assert float((session.vertices[handle] - place).norm()) < 0.01 * unit
    assert max(trials) > 1


def test_weak_handles_do_not_ask_for_step_after_step() -> None:
    session = opened()
    session.weigh(handle=1e-2)
    session.move({MIDDLE: above(session, 0.1)})
    assert session.step().trials <= 2


def test_wrong_steering_is_refused_by_name() -> None:
    session = opened()
    with pytest.raises(MeshError, match="vertices are numbered 0 to 48, got \\[49\\]"):
        session.hold([3, 49])
    with pytest.raises(MeshError, match="handle 50 is no vertex"):
        session.move({50: (0.0, 0.0, 0.0)})
    with pytest.raises(ShapeError, match="three finite coordinates"):
        session.move({5: (0.0, float("nan"), 0.0)})
    with pytest.raises(SettingsError, match=r"weights of this job are .*fairness.*, got glue"):
        session.weigh(glue=1.0)
    with pytest.raises(SettingsError, match="at least 0"):
        session.weigh(fairness=-1.0)
    with pytest.raises(MeshError, match="'denoise' works on one mesh and does not refine"):
        Session(DenoiseRecipe(*sheet())).refined()


def test_a_session_is_at_rest_as_soon_as_a_step_lowers_the_merit_by_little() -> None:
    session = opened()
    drag(session)
    session.settle()
    merits = [record.merit for record in session.runs[-1].history if record.accepted]
    falls = [1.0 - after / before for before, after in itertools.pairwise(merits)]
    assert falls[-1] < 1e-2
    assert all(fall >= 1e-2 for fall in falls[:-1])
