"""What the job that lowers E may do in a step."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, grid_faces, split_quads
from torch import Tensor

from torchfair import MeshError, Topology
from torchfair.energies import normal_variation
from torchfair.formfinding import FairSettings, minimise_normal_variation
from torchfair.formfinding.fair.problem import FairProblem
from torchfair.formfinding.job import Pulls
from torchfair.geometry import corner_angles


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
    pulls = Pulls(vertices)
    result = FairProblem(vertices, topology, own, pulls, settings or FairSettings(boundary="free"))
    if targets:
        pulls.pull(torch.tensor(list(targets)), torch.stack(list(targets.values())))
    result.reconsider()
    return result


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
    assert design.near.design_mode
    assert not design.admits(start, beyond)
    assert design.admits(beyond, beyond)  # far from the start only the last state says what is front


def test_one_handle_that_leaves_the_surface_is_enough_for_design_mode() -> None:
    """The farthest target counts, measured from the reference surface and not from the vertex."""
    vertices, _ = bent_sheet()
    along, away = torch.tensor([0.0, 0.3, 0.0], dtype=DOUBLE), torch.tensor([0.0, 0.0, 0.7], dtype=DOUBLE)
    on, off = {11: vertices[11] + along}, {13: vertices[13] + away}
    assert not problem(targets=on).near.design_mode
    assert problem(targets=off).near.design_mode
    assert problem(targets={**on, **off}).near.design_mode
    assert not problem(targets=off, settings=FairSettings(distance_limit=None)).near.design_mode
    assert not problem(targets=off, settings=FairSettings(distance_limit=1.0)).near.design_mode


def test_auxiliary_variables_fit_their_constraints_at_every_start_of_a_stage() -> None:
    vertices, _ = bent_sheet()
    fair = problem(settings=FairSettings(formulation="lifted"))
    moved_on = vertices + 0.1 * torch.randn(vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    lifted = [term for term in fair.terms(1.0) if any(name != "vertices" for name, _ in term.stencil)]
    for place in (vertices, moved_on):
        blocks = fair.blocks(place)
        assert torch.equal(blocks["vertices"], place)
        for term in lifted:
            if term.name in ("normal variation", "flat edges"):  # what is asked for
                continue
            assert float(term.values(term.arguments(blocks)).abs().max()) < 1e-12


def test_a_single_face_without_area_is_refused() -> None:
    vertices = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0.5, 0, 0]], dtype=DOUBLE)
    topology = Topology.from_faces([[0, 1, 2], [1, 0, 3]])
    with pytest.raises(MeshError, match=r"1 face\(s\) have no area: faces 1\b"):
        minimise_normal_variation(vertices, topology)


def test_handles_do_not_glide() -> None:
    vertices, topology = bent_sheet()
    targets = {2: vertices[2] + torch.tensor([-0.3, 0.0, 0.1], dtype=DOUBLE)}
    gliding = []
    glide = FairSettings(boundary="glide")
    for fair in (problem(settings=glide), problem(targets=targets, settings=glide)):
        (term,) = (term for term in fair.terms(1.0) if term.name == "boundary gliding")
        assert term.element_weights is not None
        gliding.append(set(term.stencil[0][1][term.element_weights > 0.0, 0].tolist()))
    corners = {0, 4, 20, 24}
    assert gliding[0] == set(torch.nonzero(topology.is_boundary_vertex).squeeze(1).tolist()) - corners
    assert gliding[1] == gliding[0] - {2}


def test_normals_of_faces_that_are_kept_planar_are_orthogonal_to_all_their_edges() -> None:
    """In the paper's own variables; those of other polygons are tied to their area vectors."""
    vertices, _ = bent_sheet()
    topology = Topology.from_faces(grid_faces(5, 5))
    counts = {}
    for planar in ("none", "quads", (0, 5, 9)):
        settings = FairSettings(formulation="lifted", planar=planar)
        terms = FairProblem(vertices, topology, None, Pulls(vertices), settings).terms(1.0)
        counts[planar] = [term.num_elements for term in terms if term.name == "face normals"]
    assert counts == {"none": [16], "quads": [4 * 16], (0, 5, 9): [4 * 3, 13]}


@pytest.mark.parametrize("squeeze", [1.0, 0.3, 0.1])
def test_barriers_of_angles_leave_every_angle_room(squeeze: float) -> None:
    """Silent from where an angle starts, or from 25 degrees or twice the bound on, but never nearer than 2 degrees."""
    vertices, topology = bent_sheet()
    vertices = vertices * torch.tensor([1.0, squeeze, 1.0], dtype=DOUBLE)
    angles = corner_angles(vertices, topology)
    fair = FairProblem(vertices, topology, None, Pulls(vertices), FairSettings())
    (term,) = (term for term in fair.terms(1.0) if term.name == "corner angles")
    bound = min(math.radians(10.0), float(angles.min()))
    most = max(math.radians(25.0), 2.0 * bound)
    expected = angles.clamp(max=most).clamp(min=bound + math.radians(2.0))
    torch.testing.assert_close(term.data[0], expected)
    assert bool((term.values(term.arguments({"vertices": vertices})) <= 10.0 + 1e-6).all())


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
