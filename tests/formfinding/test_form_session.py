"""Surfaces of low C that follow a handle: steps are taken, what comes to rest is what the whole job finds."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair import Topology
from torchfair.curves import ClosedCurve
from torchfair.formfinding import FormRecipe, FormSettings, Session, minimise_absolute_curvature, start_surface
from torchfair.formfinding.form.cones import cone_weights
from torchfair.geometry import corner_angles, edge_lengths

UP, SIDEWAYS = torch.tensor([0.0, 0.0, 1.0], dtype=DOUBLE), torch.tensor([0.0, 1.0, 0.0], dtype=DOUBLE)


def ring(radius: float, height: float) -> ClosedCurve:
    angle = torch.arange(48, dtype=DOUBLE) * (math.tau / 48)
    return ClosedCurve(radius * torch.stack([angle.cos(), angle.sin(), 0 * angle], 1) + height * UP)


def annulus(count: int = 200) -> tuple[Tensor, Topology, int]:
    """A flat ring that rises a little, and a vertex in its middle on the x axis."""
    vertices, topology = start_surface([ring(2.0, 0.0), ring(0.8, 0.3)], count)
    middle = torch.tensor([1.4, 0.0, 0.15], dtype=DOUBLE)
    return vertices, topology, int((vertices - middle).norm(dim=1).argmin())


def dragged(session: Session[FormRecipe], handle: int, way: Tensor, moves: int) -> tuple[Tensor, int]:
    """Where the handle has been pulled, by ``way`` mean edges a move, and how many steps were accepted."""
    start = session.vertices
    by = way * edge_lengths(start, session.recipe.topology).mean()
    accepted, place = 0, start[handle]
    for _ in range(moves):
        place = place + by
        session.move({handle: place.tolist()})
        accepted += session.step().accepted
    return place, accepted


@pytest.mark.parametrize(
    ("way", "moves"),
    [
        pytest.param(0.1 * UP, 20, id="up"),
        pytest.param(0.3 * UP, 12, id="fast", marks=pytest.mark.slow),
        pytest.param(0.2 * SIDEWAYS, 20, id="sideways", marks=pytest.mark.slow),
    ],
)
def test_a_dragged_handle_is_followed_and_comes_to_rest_where_the_whole_job_does(way: Tensor, moves: int) -> None:
    vertices, topology, handle = annulus()
    session = Session(FormRecipe(vertices, topology), live=True)
    session.solve()
    place, accepted = dragged(session, handle, way, moves)
    edge = float(edge_lengths(vertices, topology).mean())
    assert accepted >= 0.8 * moves
    assert float((session.vertices[handle] - place).norm()) < 0.1 * edge
    assert float(corner_angles(session.vertices, topology).min()) > math.radians(2.0)
    assert not session.settle()
    whole = minimise_absolute_curvature(vertices, topology, handles={handle: place.tolist()})
    found = session.measures()
    assert found["total_absolute_curvature"] < 1.01 * whole.after["total_absolute_curvature"]
    assert found["largest_handle_distance"] < 0.05 * edge
    assert found["largest_boundary_distance"] == 0.0


def test_what_surrounds_a_handle_is_taken_along() -> None:
    """One move, one step: neighbours of the handle rise by much of what it rises, and the rim stays."""
    vertices, topology, handle = annulus()
    session = Session(FormRecipe(vertices, topology), live=True)
    session.solve()
    before = session.vertices
    edge = float(edge_lengths(vertices, topology).mean())
    dragged(session, handle, 0.3 * UP, 1)
    rise = (session.vertices - before)[:, 2] / edge
    v, w = topology.edges.unbind(1)
    near = torch.cat([w[v == handle], v[w == handle]])
    assert float(rise[handle]) == pytest.approx(0.3, abs=0.02)
    assert float(rise[near].mean()) > 0.1
    assert not bool(rise[topology.is_boundary_vertex].any())


def test_a_snapshot_is_put_back_bit_for_bit() -> None:
    vertices, topology, handle = annulus(120)
    session = Session(FormRecipe(vertices, topology), live=True)
    dragged(session, handle, 0.1 * UP, 3)
    snapshot = session.snapshot()
    dragged(session, handle, 0.2 * UP, 3)
    expected = session.vertices
    session.free([handle])
    session.hold([handle - 1])
    session.weigh(fairness=2.0, coarse_fairness=2.0)
    session.step()
    session.restore(snapshot)
    dragged(session, handle, 0.2 * UP, 3)
    assert torch.equal(session.vertices, expected)


def test_handles_come_and_go_without_new_index_maps() -> None:
    vertices, topology, handle = annulus(120)
    session = Session(FormRecipe(vertices, topology), live=True)
    dragged(session, handle, 0.1 * UP, 1)
    problem, *others = session._problems.all()
    assert not others
    session.hold([handle])
    held = session.vertices[handle]
    other = handle + 7
    dragged(session, other, 0.1 * UP, 2)
    assert torch.equal(session.vertices[handle], held)
    (later,) = session._problems.all()
    assert later.structure.shares_pattern(problem.structure)
    session.solve()  # also along normals
    session.free([other])
    session.solve()
    assert torch.equal(session.vertices[handle], held)


def test_vertices_held_elsewhere_stay_when_the_surface_comes_to_rest() -> None:
    vertices, topology, handle = annulus(120)
    session = Session(FormRecipe(vertices, topology), live=True)
    dragged(session, handle, 0.2 * UP, 4)
    session.hold([handle])
    held = session.vertices[handle]
    session.settle()
    assert torch.equal(session.vertices[handle], held)


def test_sessions_are_refined_with_their_handles() -> None:
    vertices, topology, handle = annulus(120)
    session = Session(FormRecipe(vertices, topology), live=True)
    place, _ = dragged(session, handle, 0.2 * UP, 2)
    session.settle()
    finer = session.refined()
    assert finer.recipe.topology.num_faces == 4 * topology.num_faces
    finer.solve()
    assert float((finer.vertices[handle] - place).norm()) < 0.01


# ---- cones -------------------------------------------------------------------------------------------------


def test_cones_fall_from_handles_to_what_stays_along_edges() -> None:
    vertices, topology = wavy_grid(9, 9, triangles=True)
    handles, rim = torch.tensor([30, 50]), topology.is_boundary_vertex
    weights = cone_weights(vertices, topology, handles, rim)
    assert torch.equal(weights[handles], torch.eye(2, dtype=DOUBLE))
    assert not bool(weights[rim].any())
    (alone,) = cone_weights(vertices, topology, handles[:1], rim).unbind(1)
    inner = ~rim
    inner[30] = False
    assert bool(((alone > 0.0) & (alone < 1.0))[inner].all())
    lengths = torch.full((81, 81), math.inf, dtype=DOUBLE)
    v, w = topology.edges.unbind(1)
    lengths[v, w] = lengths[w, v] = edge_lengths(vertices, topology)
    lengths.fill_diagonal_(0.0)
    for k in range(81):  # Floyd and Warshall
        lengths = torch.minimum(lengths, lengths[:, k, None] + lengths[k])
    to_rim, to_handle = lengths[:, rim].amin(1), lengths[:, 30]
    torch.testing.assert_close(alone, to_rim / (to_rim + to_handle))


def test_a_handle_with_nothing_that_stays_moves_its_component() -> None:
    vertices, topology = wavy_grid(5, 5, triangles=True)
    two = Topology.from_faces(torch.cat([topology.triangles, topology.triangles + 25]))
    weights = cone_weights(torch.cat([vertices, vertices + 9.0]), two, torch.tensor([12]), torch.zeros(50).bool())
    assert torch.equal(weights[:, 0], (torch.arange(50) < 25).to(DOUBLE))


# ---- promises ----------------------------------------------------------------------------------------------


def test_promises_say_what_was_asked_and_reached() -> None:
    vertices, topology, handle = annulus(120)
    plain = minimise_absolute_curvature(vertices, topology)
    assert plain.holds
    assert {promise.name for promise in plain.promises} >= {"C", "smallest angle", "folded faces"}
    few = FormSettings(handle_weight=1e-3)  # too weak to pull
    place = (vertices[handle] + UP).tolist()
    pulled = minimise_absolute_curvature(vertices, topology, handles={handle: place}, settings=few)
    (missed,) = [promise for promise in pulled.promises if not promise.holds]
    assert "handle" in missed.name
    assert missed.reached == pulled.after["largest_handle_distance"] > missed.asked
    assert any("NOT REACHED" in note for note in pulled.notes)
    assert "C" not in {promise.name for promise in pulled.promises}


def test_folded_faces_are_counted() -> None:
    vertices, topology = wavy_grid(6, 6, triangles=True)
    recipe = FormRecipe(vertices, topology)
    assert recipe.measures(vertices)["folded_faces"] == 0
    folded = vertices.clone()
    folded[14, :2] += torch.tensor([1.7, 0.0])  # over its neighbour
    assert recipe.measures(folded)["folded_faces"] > 0
