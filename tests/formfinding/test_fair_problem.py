"""What the job that lowers E may do in a step."""

from __future__ import annotations

import torch
from helpers import DOUBLE, grid_faces, split_quads
from torch import Tensor

from torchfair import Topology
from torchfair.energies import normal_variation
from torchfair.formfinding import FairSettings, minimise_normal_variation
from torchfair.formfinding.fair_problem import FairProblem


def bent_sheet(n: int = 5) -> tuple[Tensor, Topology]:
    """Part of a cylinder over a grid of unit edges; vertex 12 is the middle one, its neighbours 11, 13, 7, 17."""
    x, y = torch.meshgrid(*(torch.arange(n, dtype=DOUBLE),) * 2, indexing="ij")
    vertices = torch.stack([x, y, 0.1 * x**2], dim=-1).reshape(-1, 3)
    return vertices, Topology.from_faces(split_quads(grid_faces(n, n)))


def problem(
    *, targets: dict[int, Tensor] | None = None, reference: bool = False, settings: FairSettings | None = None
) -> FairProblem:
    vertices, topology = bent_sheet()
    own = (vertices, topology) if reference else None
    return FairProblem(vertices, topology, own, targets or {}, settings or FairSettings())


def moved(vertex: int, by: tuple[float, float, float]) -> dict[str, Tensor]:
    vertices, _ = bent_sheet()
    vertices[vertex] += torch.tensor(by, dtype=DOUBLE)
    return {"vertices": vertices}


def test_steps_above_the_energy_of_the_start_are_refused_from_every_state() -> None:
    vertices, topology = bent_sheet()
    flatter = {"vertices": vertices * torch.tensor([1.0, 1.0, 0.5], dtype=DOUBLE)}
    bumpy = moved(12, (0.0, 0.0, 0.2))
    start = {"vertices": vertices}
    energy = {id(state): float(normal_variation(state["vertices"], topology)) for state in (start, flatter, bumpy)}
    assert energy[id(flatter)] < energy[id(start)] < energy[id(bumpy)]
    fair = problem()
    assert fair.admits(start, flatter)
    assert fair.admits(flatter, start)  # above the state before, not above the start
    assert not fair.admits(start, bumpy)
    assert not fair.admits(flatter, bumpy)


def test_energy_may_rise_where_something_else_is_asked_for() -> None:
    start, bumpy = moved(12, (0.0, 0.0, 0.0)), moved(12, (0.0, 0.0, 0.2))
    assert problem(reference=True).admits(start, bumpy)
    assert problem(targets={12: bumpy["vertices"][12]}).admits(start, bumpy)
    assert not problem().admits(start, bumpy)


def test_no_face_turns_over_whatever_is_asked_for() -> None:
    """Beyond its neighbour a vertex turns the faces between over; the start is what faces are compared with."""
    start, beyond, slightly = (moved(12, (0.0, y, 0.0)) for y in (0.0, 1.4, 0.4))
    asked = problem(reference=True)
    assert asked.admits(start, slightly)
    assert not asked.admits(start, beyond)
    assert not asked.admits(beyond, beyond)
    design = problem(targets={12: beyond["vertices"][12] + torch.tensor([0.0, 0.0, 3.0], dtype=DOUBLE)})
    assert design.design_mode
    assert not design.admits(start, beyond)
    assert design.admits(beyond, beyond)  # far from the start only the last state says what is front


def test_energy_stays_at_most_that_of_the_start_even_where_fairness_would_raise_it() -> None:
    """A cylinder with its rulings as edges has the least E there is; fairness of great weight bends them."""
    u, z = torch.meshgrid(torch.linspace(0, 2, 9, dtype=DOUBLE), torch.arange(5, dtype=DOUBLE) / 4, indexing="ij")
    u = u + 0.08 * torch.sin(9.0 * torch.arange(9, dtype=DOUBLE))[:, None]
    vertices = torch.stack([u.cos(), u.sin(), z], dim=-1).reshape(-1, 3)
    topology = Topology.from_faces(grid_faces(9, 5))
    settings = FairSettings(
        fairness_weight=1e3, closeness_weight=0.0, energy_weight=1e-6, distance_limit=None, planar="none"
    )
    result = minimise_normal_variation(vertices, topology, settings=settings)
    assert result.after["normal_variation"] <= result.before["normal_variation"] * (1 + 1e-12)
    assert any(not record.accepted for record in result.projection.history)  # it would have risen
