"""Live sessions of principal-symmetric meshes: handles dragged, let go, exact; steered; snapshots; levels."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import torch
from helpers import DOUBLE, random_rotation
from session_steps import dragged
from torch import Tensor

from torchfair import MeshError
from torchfair.constraints.saddle_sides import SaddleSides
from torchfair.formfinding import Session, SymmetricRecipe, SymmetricSettings, symmetric_measures
from torchfair.geometry import vertex_normals
from torchfair.principal import PrincipalEdges, principal_edges_of_lattice
from torchfair.shapes import Torus, principal_triangles

HANDLE = 40


def torus() -> tuple[Tensor, PrincipalEdges]:
    mesh = principal_triangles(Torus(2.0, 1.0), 10, 14, along="u")
    return mesh.vertices, principal_edges_of_lattice(mesh, "u").check()


def opened(fixed: Tensor | None = None, **settings: object) -> Session[SymmetricRecipe]:
    return Session(SymmetricRecipe(*torus(), fixed=fixed, settings=SymmetricSettings(**settings)))  # type: ignore[arg-type]


def above(session: Session[SymmetricRecipe], height: float, vertex: int = HANDLE) -> list[float]:
    """A place over where a vertex started, in mean edge lengths."""
    recipe = session.recipe
    normal = vertex_normals(recipe.given, recipe.topology)[vertex]
    place: list[float] = (recipe.given[vertex] + height * recipe.unit.length * normal).tolist()
    return place


def drag(session: Session[SymmetricRecipe], moves: int = 4, start: float = 0.0) -> list[float]:
    """Lags of the handle behind its target after each move, in mean edges."""
    return dragged(session, HANDLE, lambda height: above(session, height), moves, start)


def largest(measures: dict[str, float]) -> float:
    return max(measures["largest_cospherical"], measures["largest_coplanar"])


def kept(session: Session[SymmetricRecipe]) -> list[str]:
    """Promises that the mesh does not keep."""
    measures = session.measures()
    return [str(promise) for promise in session.recipe.promises(session.recipe.before(), measures) if not promise.holds]


def test_a_dragged_handle_is_followed_and_settling_meets_all_that_is_promised() -> None:
    session = opened()
    assert max(drag(session, 8)) < 0.01
    followed = session.measures()
    assert 1e-8 < largest(followed) < 1e-2  # conditions are weighted while a handle is dragged
    others = (session.vertices - session.recipe.given).norm(dim=1)
    edges = session.recipe.topology.edges
    ring = edges[(edges == HANDLE).any(1)].flatten().unique()
    assert float(others[ring].min()) > 0.02  # its surroundings come along
    assert not session.settle()
    assert kept(session) == []
    assert sum(run.iterations for run in session.runs) <= 15


def test_stars_are_decided_where_a_step_begins() -> None:
    session = opened()
    for height in (0.3, 0.6):
        before = session.state["vertices"].clone()
        session.move({HANDLE: above(session, height)})
        session.step()
        fresh = SaddleSides(session.recipe.stars)
        fresh.decide(before)
        found = session.recipe.problem.sides
        assert torch.equal(found.is_saddle, fresh.is_saddle)
        assert all(torch.equal(*pair) for pair in zip(found._data, fresh._data, strict=True))


def test_settling_far_from_the_handle_goes_on_as_the_whole_job_does() -> None:
    session = opened()
    session.move({HANDLE: above(session, 3.0)})
    session.settle()
    assert kept(session) == []


def test_nothing_is_compiled_anew_whatever_is_steered(monkeypatch: pytest.MonkeyPatch) -> None:
    from torchfair.formfinding.job import compiled_problems as module

    session = opened()
    drag(session, 2)
    session.settle()
    made: list[int] = []
    original: Callable[..., object] = module.GuidedProjection
    monkeypatch.setattr(module, "GuidedProjection", lambda *a, **k: made.append(1) or original(*a, **k))
    session.move({7: above(session, 0.1, 7)})
    session.hold([3, 90])
    session.weigh(fairness=0.7, handle=200.0)
    session.step()
    session.free([3, HANDLE])
    session.step()
    session.settle()
    assert not made
    session.weigh(energy=0.1)  # terms that were not there
    session.move({7: above(session, 0.2, 7)})
    assert session.step().accepted
    assert made


def test_held_vertices_stay_exactly_until_they_are_freed() -> None:
    session = opened()
    held = [HANDLE - 1, HANDLE + 1]
    session.hold(held)
    drag(session)
    session.settle()
    assert torch.equal(session.vertices[held], session.recipe.given[held])
    session.free(held)
    drag(session, start=0.4)
    assert float((session.vertices[held] - session.recipe.given[held]).norm(dim=1).min()) > 0.01


def test_weights_act_on_the_next_step() -> None:
    lags = []
    for weight in (1.0, 1e4):
        session = opened()
        session.step()
        session.weigh(handle=weight)
        lags.append(drag(session, 1)[0])
    assert lags[1] < 0.1 * lags[0]


@pytest.mark.parametrize(
    "at", [pytest.param("start", marks=pytest.mark.slow), "dragged", pytest.param("settled", marks=pytest.mark.slow)]
)
def test_snapshots_bring_everything_back_bit_for_bit(at: str) -> None:
    session = opened(rounds=2, most_steps=60)
    if at != "start":
        drag(session)
    if at == "settled":
        session.settle()
    snapshot = session.snapshot()

    def goes_on() -> list[Tensor]:
        places = []
        drag(session, 2, start=0.4)
        places.append(session.vertices)
        session.hold([8])
        session.weigh(fairness=2.0)
        session.step()
        session.settle()
        places.append(session.vertices)
        session.move({8: above(session, 1.8, 8)})
        session.solve()
        session.recipe.problem.sides.reconsider(session.state["vertices"])
        places.append(session.vertices)
        return places

    once, runs = goes_on(), len(session.runs)
    for _ in range(2):  # a snapshot shares nothing with what was restored from it
        session.restore(snapshot)
        again = goes_on()
        assert len(session.runs) == runs
        assert all(torch.equal(*pair) for pair in zip(once, again, strict=True))


def test_snapshots_hold_what_stars_are_to_be() -> None:
    session = opened(rounds=1, most_steps=10)
    sides = session.recipe.problem.sides
    sides._preference[5], sides.margin = 8.0, 0.07
    snapshot = session.snapshot()
    for _ in range(2):
        session.move({HANDLE: above(session, 1.0)})
        session.solve()
        assert float(sides._preference[5]) == 1.0
        session.restore(snapshot)
        assert session.recipe.problem.sides is sides
        assert (float(sides._preference[5]), sides.margin) == (8.0, 0.07)
        assert not bool(session.recipe.pulls.pulled.any())


def test_refined_sessions_carry_handles_held_and_fixed_vertices() -> None:
    vertices, _ = torus()
    fixed = torch.zeros(len(vertices), dtype=torch.bool)
    fixed[100] = True
    session = opened(fixed=fixed)
    session.hold([3])
    drag(session)
    session.settle()
    finer = session.refined()
    assert finer.recipe.topology.num_vertices == 4 * len(vertices)
    assert finer.recipe.pulls.vertices.tolist() == [HANDLE]
    assert torch.nonzero(finer.recipe.pulls.held).flatten().tolist() == [3]
    assert torch.nonzero(finer.recipe.stays()).flatten().tolist() == [100]
    places = finer.vertices[[3, 100]].clone()
    target = finer.recipe.unit.invert(finer.recipe.pulls.targets[[HANDLE]])
    torch.testing.assert_close(target[0], torch.tensor(above(session, 0.4), dtype=DOUBLE))
    finer.solve()
    assert kept(finer) == []
    assert torch.equal(finer.vertices[[3, 100]], places)
    with pytest.raises(MeshError, match="handles \\[100\\] are fixed"):
        finer.move({100: (0.0, 0.0, 0.0)})


def test_faces_turned_over_are_seen_against_their_neighbours_however_the_mesh_is_turned() -> None:
    vertices, edges = torus()
    stars = edges.stars()
    nothing = torch.zeros(0, dtype=torch.int64)
    turned = vertices @ random_rotation(3).T

    def count(places: Tensor) -> float:
        return symmetric_measures(places, edges, stars, nothing, places[nothing])["flipped_faces"]

    assert count(vertices) == count(turned) == 0.0
    topology = edges.topology
    a, b, c = topology.triangles[37].tolist()
    folded = turned.clone()
    folded[a] = turned[b] + turned[c] - turned[a]  # over the opposite edge: its own face looks the other way
    assert count(folded) >= 1.0
