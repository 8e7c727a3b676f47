"""Live sessions: handles that move, vertices that are held, weights that are turned, snapshots."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE, grid_faces, split_quads
from torch import Tensor

from torchfair import MeshError, ShapeError, Topology
from torchfair.errors import SettingsError
from torchfair.formfinding import (
    DenoiseRecipe,
    FairRecipe,
    FairSettings,
    FormRecipe,
    Session,
    minimise_normal_variation,
)
from torchfair.projection import IterationRecord
from torchfair.shapes import Torus, principal_triangles

MIDDLE = 24  # of the sheet


def sheet(n: int = 7) -> tuple[Tensor, Topology]:
    """A saddle over a bent grid with edges of about one; no symmetry, or rounding chooses among mirrored minima."""
    x, y = torch.meshgrid(*(torch.arange(n, dtype=DOUBLE) - n // 2,) * 2, indexing="ij")
    x, y = x + 0.1 * torch.sin(2.0 * y), y + 0.1 * torch.sin(3.0 * x)
    vertices = torch.stack([x, y, 0.08 * (x**2 - y**2) + 0.003 * (x**3 + x * y)], dim=-1).reshape(-1, 3)
    return vertices, Topology.from_faces(split_quads(grid_faces(n, n)))


def opened(**settings: object) -> Session[FairRecipe]:
    return Session(FairRecipe(*sheet(), settings=FairSettings(**settings)))  # type: ignore[arg-type]


def above(session: Session[FairRecipe], height: float, vertex: int = MIDDLE) -> list[float]:
    """A place over where a vertex started, in mean edge lengths."""
    up = torch.tensor([0.0, 0.0, height * session.recipe.unit.length], dtype=DOUBLE)
    place: list[float] = (session.recipe.given[vertex] + up).tolist()
    return place


def drag(session: Session[FairRecipe], moves: int = 4, start: float = 0.0) -> list[float]:
    """Lags of the handle behind its target after each move, in mean edges."""
    lags = []
    for number in range(1, moves + 1):
        place = above(session, start + 0.1 * number)
        session.move({MIDDLE: place})
        assert session.step().accepted
        lags.append(float((session.vertices[MIDDLE] - torch.tensor(place)).norm()) / session.recipe.unit.length)
    return lags


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


def test_index_maps_and_analysis_are_kept_whatever_is_steered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Handles, held vertices and weights are data: nothing is compiled after the first step."""
    from torchfair.formfinding.job import compiled_problems as module

    session = opened()
    session.step()
    made: list[int] = []
    original: Callable[..., object] = module.GuidedProjection
    monkeypatch.setattr(module, "GuidedProjection", lambda *a, **k: made.append(1) or original(*a, **k))
    before = session._problems.all()[0]
    drag(session)
    session.hold([3])
    session.step()
    session.free([3])
    session.weigh(fairness=0.7, closeness=3.0)
    session.move({5: above(session, 0.1, 5)})
    session.step()
    session.settle()
    after = session._problems.all()[0]
    assert not made
    assert after.structure.lower is before.structure.lower


def test_weights_act_on_the_running_solve() -> None:
    """More fairness, evener edges."""
    spreads = []
    for weight in (0.01, 30.0):
        session = opened(distance_limit=None)
        session.step()
        session.weigh(fairness=weight, closeness=0.1)
        for _ in range(10):
            session.step()
        ends = session.vertices[session.recipe.topology.edges]
        spreads.append(float((ends[:, 0] - ends[:, 1]).norm(dim=1).std()))
    assert spreads[1] < spreads[0]


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


def test_weights_come_and_go() -> None:
    """Terms without a weight are none; the merit has them again where their weights are back."""

    def kinds(session: Session[FairRecipe]) -> set[str]:
        problem, *_ = session._problems.all()
        return {term.name for term in problem.structure.terms}

    session = opened()
    for weights, there in (({"closeness": 0.0}, False), ({"closeness": 20.0, "fairness": 0.0}, True)):
        session.weigh(**weights)
        assert session.step().accepted
        assert ("closeness" in kinds(session)) is there
    assert "fairness" not in kinds(session)
    assert not session.settle()


def test_other_handles_between_whole_solves() -> None:
    """A session that is not live has terms for its handles alone, which are made anew where there are others."""
    session = Session(FairRecipe(*sheet(), handles={MIDDLE: above(opened(), 0.2)}), live=False)
    session.solve()
    session.move({10: above(session, 0.1, 10)})
    session.solve()
    assert session.measures()["largest_handle_distance"] < 0.05 * session.recipe.unit.length


def test_a_session_is_at_rest_as_soon_as_a_step_lowers_the_merit_by_little() -> None:
    session = opened()
    drag(session)
    session.settle()
    merits = [record.merit for record in session.runs[-1].history if record.accepted]
    falls = [1.0 - after / before for before, after in itertools.pairwise(merits)]
    assert falls[-1] < 1e-2
    assert all(fall >= 1e-2 for fall in falls[:-1])


WEIGHTS = [name.removesuffix("_weight") for name in vars(FairSettings()) if name.endswith("_weight")]


@pytest.mark.parametrize("formulation", ["reduced", "lifted"])
@pytest.mark.parametrize("name", WEIGHTS)
def test_a_weight_that_is_turned_is_the_weight_of_a_job_that_has_it_from_the_start(name: str, formulation: str) -> None:
    vertices, topology = sheet()
    given = {"formulation": formulation, "planar": "quads", "directions": "keep", "flat": (0, 1)}
    if name == "free_boundary":
        given["boundary"] = "free"
    settings = FairSettings(**given)  # type: ignore[arg-type]
    quads = Topology.from_faces(grid_faces(7, 7)) if name == "planarity" else topology

    def felt(recipe: FairRecipe) -> list[tuple[str, float]]:
        return [(term.name, term.weight) for term in recipe.problem.terms(1.0)]

    session = Session(FairRecipe(vertices, quads, handles={MIDDLE: vertices[MIDDLE].tolist()}, settings=settings))
    before = felt(session.recipe)
    session.weigh(**{name: 7.0})
    turned = replace(settings, **{f"{name}_weight": 7.0})
    fresh = FairRecipe(vertices, quads, handles={MIDDLE: vertices[MIDDLE].tolist()}, settings=turned)
    assert felt(session.recipe) == felt(fresh)
    assert felt(session.recipe) != before or (name == "constraint" and formulation == "reduced")


def test_without_the_weight_of_quality_no_bound_of_faces_is_kept() -> None:
    session = opened()
    problem = session.recipe.problem
    thin = problem.vertices.clone()
    thin[MIDDLE] = 0.98 * thin[MIDDLE + 1] + 0.02 * thin[MIDDLE]
    assert not problem.guard.keeps_bounds({"vertices": thin})
    session.weigh(quality=0.0)
    assert problem.guard.keeps_bounds({"vertices": thin})


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
