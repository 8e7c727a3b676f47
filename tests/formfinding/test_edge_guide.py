"""Edges are drawn to directions that change as they move."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE, grid_faces
from torch import Tensor

from torchfair import Topology
from torchfair.errors import SettingsError, TorchfairError
from torchfair.formfinding import FairRecipe, FairSettings, minimise_normal_variation
from torchfair.formfinding.fair.edge_guide import EdgeGuide


def grid(n: int = 5) -> tuple[Tensor, Topology]:
    x, y = torch.meshgrid(*(torch.arange(n, dtype=DOUBLE),) * 2, indexing="ij")
    return torch.stack([x, y, 0 * x], -1).reshape(-1, 3), Topology.from_faces(grid_faces(n, n))


def off(guide: EdgeGuide, vertices: Tensor) -> Tensor:
    """(I,) how far edges are sideways of their directions."""
    (term,) = guide.terms(weight=1.0)
    ((_, ends),) = term.stencil
    return torch.stack([term.residual(vertices[of], *data) for of, *data in zip(ends, *term.data, strict=True)])[:, 0]


def around(middles: Tensor, along: Tensor) -> Tensor:
    """Circles about the z axis, and rays: whichever is nearer."""
    ray = torch.nn.functional.normalize(middles * middles.new_tensor([1.0, 1.0, 0.0]), dim=1)
    circle = torch.stack([-ray[:, 1], ray[:, 0], ray[:, 2]], 1)
    return torch.where(((along * ray).sum(1).abs() > (along * circle).sum(1).abs())[:, None], ray, circle)


def test_edges_keep_their_own_directions_where_none_are_wanted():
    vertices, topology = grid()
    moved = vertices + 0.1 * torch.sin(3 * vertices.flip(1).roll(-1, 1))
    own, none = EdgeGuide(vertices, topology), EdgeGuide(vertices, topology, lambda middles, along: 0 * along)
    none.read(moved)
    assert float(off(own, vertices).abs().max()) == 0
    assert float(off(own, moved).abs().max()) > 0.05
    torch.testing.assert_close(off(none, moved).abs(), off(own, moved).abs())


def test_directions_are_those_where_the_edges_are_when_they_are_read():
    """Of a polar grid that was moved: off at first, on them where it was read off."""
    plane, topology = grid()
    radius, angle = 2 + plane[:, 0], 0.1 * plane[:, 1]
    polar = torch.stack([radius * angle.cos(), radius * angle.sin(), 0 * radius], 1)
    moved = polar + polar.new_tensor([0.0, 1.0, 0.0])
    guide = EdgeGuide(polar, topology, around)
    guide.read(polar)
    assert float(off(guide, polar).abs().max()) < 1e-12
    first = guide.version
    guide.read(moved)
    assert guide.version > first
    assert float(off(guide, moved).abs().max()) > 0.05
    guide.read(polar)
    assert float(off(guide, polar).abs().max()) < 1e-12


def test_sideways_is_within_the_surface_as_it_is_when_directions_are_read():
    """Of a plane that was turned upright edges may bend out of that plane, not out of the one before."""
    plane, topology = grid()
    upright = plane[:, [0, 2, 1]]
    guide = EdgeGuide(plane, topology, lambda middles, along: along)
    guide.read(upright)
    out = torch.sin(2 * upright.sum(1, keepdim=True)) * upright.new_tensor([0.0, 1.0, 0.0])
    assert float(off(guide, upright + out).abs().max()) < 1e-12
    assert float(off(guide, upright + out.roll(1, 1)).abs().max()) > 0.1


def test_finer_meshes_ask_for_the_same_directions():
    recipe = FairRecipe(*grid(), settings=FairSettings(directions="keep"), directions_at=around)
    assert recipe.refined(recipe.state()).directions_at is around


@pytest.mark.parametrize("wanted", [around, None])
def test_terms_are_made_anew_for_directions_that_were_read_anew(wanted):
    """And only then."""
    recipe = FairRecipe(*grid(), settings=FairSettings(directions="keep"), directions_at=wanted)
    stages = [recipe.problem.stage(recipe.state(), 1.0, 1.0, recipe.settings.projection) for _ in range(2)]
    assert (stages[0].version != stages[1].version) is (wanted is not None)


@pytest.mark.parametrize("scale", [1.0, 1e-3])
def test_directions_are_asked_for_in_the_unit_of_the_input_and_before_every_stage(scale):
    """What edges become does not depend on the unit, and those of a grid turn to a field that is not theirs."""
    plane, topology = grid()
    places = scale * (plane + plane.new_tensor([3.0, -2.0, 0.0]))
    asked = []

    def wanted(middles: Tensor, along: Tensor) -> Tensor:
        asked.append(middles)
        return around(middles, along)

    settings = FairSettings(directions="keep", boundary="free", free_boundary_weight=0.1, direction_weight=1e3)
    result = minimise_normal_variation(
        places, topology, reference=(places, topology), settings=settings, directions_at=wanted
    )
    runs = len(result.levels[-1].runs)
    assert len(asked) == runs > 1
    ends = places[topology.interior_edges].mean(1)
    torch.testing.assert_close(asked[0], ends)
    assert not torch.equal(asked[-1], asked[0])

    def mean_angle(vertices: Tensor) -> float:
        ends = vertices[topology.interior_edges]
        along = ends[:, 1] - ends[:, 0]
        field = around(ends.mean(1), along)
        sine = torch.linalg.vector_norm(torch.linalg.cross(along, field), dim=1)
        return float(torch.atan2(sine, (along * field).sum(1).abs()).mean())

    assert mean_angle(result.vertices) < 0.5 * mean_angle(places)


WRONG = {
    "one number each": (lambda along: along[:, 0], r"expected a tensor \(40, 3\), got \(40,\)"),
    "one for all": (lambda along: along[:1], r"expected a tensor \(40, 3\), got \(1, 3\)"),
    "nothing": (lambda along: None, r"expected a tensor \(40, 3\), got NoneType"),
    "an array": (lambda along: along.numpy(), r"expected a tensor \(40, 3\), got ndarray"),
    "not finite": (lambda along: along.index_fill(0, torch.tensor([3]), float("nan")), "not finite.* edges 3$"),
}


@pytest.mark.parametrize("policy", ["judged", "every"])
@pytest.mark.parametrize("name", WRONG)
def test_directions_that_are_none_are_refused_by_name(name: str, policy: str) -> None:
    wrong, message = WRONG[name]
    settings = FairSettings(directions="keep")
    settings = replace(settings, projection=replace(settings.projection, step_policy=policy))
    with pytest.raises(TorchfairError, match=f"directions_at gives.*{message}"):
        minimise_normal_variation(*grid(6), settings=settings, directions_at=lambda middles, along: wrong(along))


def test_directions_of_another_precision_and_with_a_gradient_are_taken() -> None:
    settings, one = FairSettings(directions="keep"), torch.ones(1, requires_grad=True)
    mesh = grid()
    plain, other = (
        minimise_normal_variation(*mesh, settings=settings, directions_at=wanted).vertices
        for wanted in (lambda middles, along: along, lambda middles, along: one * along.float())
    )
    assert not other.requires_grad
    torch.testing.assert_close(other, plain, atol=1e-5, rtol=0)


def test_directions_without_settings_that_keep_them_are_refused() -> None:
    for settings in (None, FairSettings()):
        with pytest.raises(SettingsError, match="directions='keep'"):
            minimise_normal_variation(*grid(), settings=settings, directions_at=around)


def test_directions_are_not_asked_for_where_edges_are_free() -> None:
    """As in a session whose settings were changed."""
    asked = []
    recipe = FairRecipe(*grid(), settings=FairSettings(directions="keep"), directions_at=lambda *of: asked.append(of))
    recipe.take_settings(FairSettings())
    recipe.problem.stage(recipe.state(), 1.0, 1.0, recipe.settings.projection)
    assert not asked
