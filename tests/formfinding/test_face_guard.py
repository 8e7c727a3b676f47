"""The guard against faces that turn over."""

from __future__ import annotations

import itertools
import math

import torch
from torch import Tensor

from torchfair import Topology
from torchfair.formfinding.face_guard import FaceGuard
from torchfair.geometry import corner_angles
from torchfair.projection.layout import State

TOPOLOGY = Topology.from_faces([[0, 1, 2], [0, 2, 3]])
SQUARE = torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=torch.float64)


def moved(vertex: int, place: list[float]) -> dict[str, Tensor]:
    vertices = SQUARE.clone()
    vertices[vertex] = torch.tensor(place, dtype=torch.float64)
    return {"x": vertices}


def test_only_steps_that_turn_a_face_are_refused() -> None:
    guard = FaceGuard(TOPOLOGY, lambda state: state["x"])
    start = {"x": SQUARE}
    assert guard(start, moved(1, [1.0, 0.2, 0.3]))
    assert not guard(start, moved(1, [0.0, 1.0, 0.0]))  # beyond the diagonal
    assert not guard(start, moved(1, [0.5, 0.5, 1.0]))  # upright
    turned = moved(1, [0.0, 1.0, 0.0])
    assert guard(turned, moved(1, [0.1, 0.9, 0.0]))  # judged from the state, not from the start


def test_normals_of_a_trial_are_not_computed_again_when_it_becomes_the_state() -> None:
    asked = []

    def place(state: State) -> Tensor:
        asked.append(state)
        return state["x"]

    guard = FaceGuard(TOPOLOGY, place)
    states = [moved(1, [1.0, 0.1 * i, 0.0]) for i in range(4)]
    for state, trial in itertools.pairwise(states):
        assert guard(state, trial)
    assert len(asked) == 4


def test_steps_that_collapse_an_angle_are_refused_on_request() -> None:
    flat = {"x": moved(1, [1.0, 0.95, 0.0])["x"]}
    start = {"x": SQUARE}
    smallest = float(corner_angles(flat["x"], TOPOLOGY).min())
    assert FaceGuard(TOPOLOGY, lambda state: state["x"])(start, flat)
    assert FaceGuard(TOPOLOGY, lambda state: state["x"], 0.99 * smallest)(start, flat)
    assert not FaceGuard(TOPOLOGY, lambda state: state["x"], 1.01 * smallest)(start, flat)


def test_steps_that_fold_an_edge_are_refused_on_request() -> None:
    """The corner is turned about the diagonal, out of the plane, in steps that turn no face over."""

    def folded(degrees: float) -> State:
        angle = math.radians(degrees)
        half = 0.5**0.5
        return moved(1, [0.5 + 0.5 * math.cos(angle), 0.5 - 0.5 * math.cos(angle), half * math.sin(angle)])

    for degrees in (100.0, 140.0, -140.0):
        guard = FaceGuard(TOPOLOGY, lambda state: state["x"], steepest=math.radians(abs(degrees)))
        assert guard(folded(degrees * 0.9), folded(degrees * 0.999))
        assert not guard(folded(degrees * 0.9), folded(degrees * 1.001))
        assert FaceGuard(TOPOLOGY, lambda state: state["x"])(folded(degrees * 0.9), folded(degrees * 1.001))
