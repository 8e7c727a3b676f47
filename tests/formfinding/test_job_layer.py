"""Finished meshes as differentiable functions: gradients against finite differences of finishing again."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair.curves import ClosedCurve
from torchfair.errors import DerivativeError, SettingsError, ShapeError
from torchfair.formfinding import (
    DenoiseRecipe,
    FairRecipe,
    FairSettings,
    FormRecipe,
    FormSettings,
    JobLayer,
    Recipe,
    SymmetricRecipe,
    SymmetricSettings,
    minimise_normal_variation,
    start_surface,
)
from torchfair.principal import principal_edges_of_lattice
from torchfair.shapes import Catenoid, Enneper, Paraboloid, irregular_triangles, parameter_quads, principal_triangles

FIXED = FairSettings(boundary="fixed")


@dataclass(frozen=True)
class Case:
    """A job, and the parameters that its finished mesh depends on."""

    recipe: Recipe[Any]
    parameters: dict[str, Tensor]

    def layer(self, **options: Any) -> JobLayer:
        return JobLayer(self.recipe, **options)


def number(value: float) -> Tensor:
    return torch.tensor(value, dtype=DOUBLE)


def raised(vertices: Tensor, chosen: list[int], height: float) -> tuple[Tensor, dict[int, list[float]]]:
    """Targets above vertices, as a tensor and as handles."""
    targets = vertices[chosen] + vertices.new_tensor([0.0, 0.0, height])
    return targets, dict(zip(chosen, targets.tolist(), strict=True))


def fair_handles() -> Case:
    vertices, topology = wavy_grid(6, 6)
    targets, handles = raised(vertices, [14, 21], 0.3)
    recipe = FairRecipe(vertices, topology, handles=handles, settings=FIXED)
    weights = {"fairness_weight": number(0.3), "handle_weight": number(50.0)}
    return Case(recipe, {"targets": targets, "vertices": vertices, **weights})


def fair_gliding() -> Case:
    """Boundary vertices of the mesh are put on their curves, on which they have slid."""
    mesh = parameter_quads(Paraboloid(1.0, -1.0), 6, 6)
    targets, handles = raised(mesh.vertices, [24], 0.2)
    weights = {"energy_weight": number(1.0), "boundary_weight": number(20.0)}
    return Case(FairRecipe(mesh.vertices, mesh.topology, handles=handles), {"targets": targets, **weights})


def fair_near_a_mesh() -> Case:
    mesh = parameter_quads(Paraboloid(1.0, -1.0), 6, 6)
    fine = irregular_triangles(Paraboloid(1.0, -1.0), 150)
    settings = replace(FIXED, closeness_weight=10.0)
    recipe = FairRecipe(mesh.vertices, mesh.topology, reference=(fine.vertices, fine.topology), settings=settings)
    return Case(recipe, {"reference": fine.vertices, "closeness_weight": number(10.0)})


def fair_planar() -> Case:
    vertices, topology = wavy_grid(5, 5)
    targets, handles = raised(vertices, [12], 0.1)
    settings = FairSettings(boundary="free", planar="quads", planarity_weight=1e3)
    return Case(FairRecipe(vertices, topology, handles=handles, settings=settings), {"targets": targets})


def ring(radius: float, height: float) -> ClosedCurve:
    turn = torch.arange(40, dtype=DOUBLE) * 2.0 * math.pi / 40
    return ClosedCurve(torch.stack([radius * turn.cos(), radius * turn.sin(), height + 0.2 * (2 * turn).sin()], dim=1))


def form(**options: Any) -> Case:
    vertices, topology = start_surface([ring(2.0, 0.0), ring(0.8, 0.8)], 50)
    parameters = {"fairness_weight": number(0.5)}
    handles = {}
    if options.pop("pulled", False):
        inside = torch.nonzero(~topology.is_boundary_vertex).squeeze(1)
        parameters["targets"], handles = raised(vertices, [int(inside[5])], 0.05)
    else:
        parameters["vertices"] = vertices
    return Case(FormRecipe(vertices, topology, handles=handles, **options), parameters)


def symmetric() -> Case:
    """Stars between spheres, near a surface, with conditions met exactly."""
    mesh = principal_triangles(Catenoid(), 5, 8, ends="zigzag")
    principal = principal_edges_of_lattice(mesh, "u")
    targets = 1.04 * mesh.vertices[[18, 33]]
    handles = dict(zip([18, 33], targets.tolist(), strict=True))
    surface = mesh.vertices + 0.02 * (3.0 * mesh.vertices).sin()
    settings = SymmetricSettings(closeness_weight=0.1)
    recipe = SymmetricRecipe(
        mesh.vertices, principal, handles=handles, reference=(surface, mesh.topology), settings=settings
    )
    weights = {"fairness_weight": number(1.0), "closeness_weight": number(0.1)}
    return Case(recipe, {"targets": targets, "reference": surface, **weights})


CASES: dict[str, Callable[[], Case]] = {
    "fair, handles": fair_handles,
    "fair, gliding boundary": fair_gliding,
    "fair, near a mesh": fair_near_a_mesh,
    "fair, planar faces": fair_planar,
    "form, boundary points": form,
    "form, handle": lambda: form(pulled=True),
    "symmetric": symmetric,
}


def wave(like: Tensor, phase: float) -> Tensor:
    return torch.linspace(0.0, 5.0, like.numel(), dtype=DOUBLE).add(phase).cos().view(like.shape)


def judged(vertices: Tensor) -> Tensor:
    """Some number that depends on all vertices."""
    return (wave(vertices, 0.3) * vertices).sum() + vertices.square().sum()


def slopes(
    layer: JobLayer, parameters: Mapping[str, Tensor], start: Tensor | None = None
) -> tuple[dict[str, Tensor], Any]:
    """Gradients of the number, by parameter."""
    given = {name: value.clone().requires_grad_() for name, value in parameters.items()}
    vertices, info = layer(given, start=start)
    return dict(zip(given, torch.autograd.grad(judged(vertices), list(given.values())), strict=True)), info


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_gradients_are_those_of_finishing_again(name: str) -> None:
    """Of every parameter by itself, in its own unit."""
    case = CASES[name]()
    layer = case.layer(tolerance=1e-9 if name.startswith("form") else 1e-10)
    finished, _ = layer(case.parameters)
    gradients, info = slopes(layer, case.parameters, finished)
    assert info.adjoint.remainder < 1e-7
    for parameter, value in case.parameters.items():
        way = wave(value, 2.0) if value.ndim else value
        step = 1e-4 if name.startswith("form") or not value.ndim else 1e-5
        sides = [
            judged(layer({**case.parameters, parameter: value + sign * step * way}, start=finished)[0])
            for sign in (1.0, -1.0)
        ]
        slope = (sides[0] - sides[1]) / (2.0 * step)
        found = (gradients[parameter] * way).sum()
        torch.testing.assert_close(found, slope, rtol=1e-4, atol=1e-6, msg=f"{parameter}: {found} is not {slope}")


def test_the_mesh_is_where_the_job_ends_but_for_its_tolerance() -> None:
    case = fair_handles()
    finished, info = case.layer(tolerance=1e-9)()
    job = minimise_normal_variation(
        case.recipe.given, case.recipe.topology, handles=case.recipe.handles, settings=FIXED
    )
    assert float((finished - job.vertices).norm(dim=1).max()) < 0.05 * case.recipe.unit.length
    assert len(info.runs) == len(job.runs)
    assert info.point.fault == ""
    boundary = case.recipe.topology.is_boundary_vertex
    assert torch.equal(finished[boundary], case.recipe.given[boundary])
    again, near = case.layer(tolerance=1e-9)(start=finished)
    assert near.runs == []
    assert near.steps <= 2
    torch.testing.assert_close(again, finished, rtol=0.0, atol=1e-8)


def test_lengths_are_in_the_unit_of_the_input_and_weights_have_none() -> None:
    case, scale = fair_handles(), 1000.0
    big = FairRecipe(
        scale * case.recipe.given,
        case.recipe.topology,
        handles={vertex: [scale * x for x in place] for vertex, place in case.recipe.handles.items()},
        settings=FIXED,
    )
    parameters = {name: value * (scale if value.ndim else 1.0) for name, value in case.parameters.items()}
    finished, _ = JobLayer(big, tolerance=1e-10)(parameters)
    small, _ = case.layer(tolerance=1e-10)(case.parameters)
    torch.testing.assert_close(finished, scale * small, rtol=1e-8, atol=1e-6)
    given = {name: value.clone().requires_grad_() for name, value in parameters.items()}
    vertices, _ = JobLayer(big, tolerance=1e-10)(given, start=finished)
    judged(vertices / scale).backward()
    expected, _ = slopes(case.layer(tolerance=1e-10), case.parameters, small)
    for name, slope in expected.items():
        factor = scale if slope.ndim else 1.0
        torch.testing.assert_close(given[name].grad * factor, slope, rtol=1e-5, atol=1e-7)


def test_gradients_go_to_parameters_alone_and_of_the_start_to_what_stays() -> None:
    case = fair_handles()
    start = case.recipe.given.clone().requires_grad_()
    vertices = case.recipe.given.clone().requires_grad_()
    finished, _ = case.layer()({"vertices": vertices}, start=start)
    judged(finished).backward()
    assert start.grad is None
    inside = ~case.recipe.topology.is_boundary_vertex
    assert not vertices.grad[inside].any()
    assert vertices.grad[~inside].all()
    quiet, _ = case.layer()({"vertices": case.recipe.given}, start=start)
    assert not quiet.requires_grad
    torch.testing.assert_close(quiet, finished.detach(), rtol=0.0, atol=0.0)


def test_calls_do_not_know_of_each_other() -> None:
    """Two passes forward, then two backward: each has its own targets and weights; the recipe keeps its own."""
    case = fair_handles()
    layer, handles = case.layer(tolerance=1e-10), case.recipe.handles
    other = {**case.parameters, "targets": case.parameters["targets"] + 0.1, "fairness_weight": number(0.6)}
    alone = [slopes(case.layer(tolerance=1e-10), given)[0]["targets"] for given in (case.parameters, other)]
    leaves = [
        {name: value.clone().requires_grad_() for name, value in given.items()} for given in (case.parameters, other)
    ]
    meshes = [layer(given)[0] for given in leaves]
    for number_, expected in enumerate(alone):
        (slope,) = torch.autograd.grad(judged(meshes[number_]), [leaves[number_]["targets"]])
        torch.testing.assert_close(slope, expected, rtol=1e-6, atol=1e-9)
    assert case.recipe.handles == handles
    assert case.recipe.settings == FIXED


def test_batches_are_members() -> None:
    case = fair_handles()
    layer = case.layer()
    targets = torch.stack([case.parameters["targets"], case.parameters["targets"] + 0.05]).requires_grad_()
    weights = torch.tensor([0.3, 0.4], dtype=DOUBLE, requires_grad=True)
    meshes, infos = layer({"targets": targets, "fairness_weight": weights})
    assert meshes.shape == (2, 36, 3)
    assert len(infos) == 2
    (slope,) = torch.autograd.grad(judged(meshes), [targets])
    for member in range(2):
        given = {"targets": targets[member].detach(), "fairness_weight": weights[member].detach()}
        alone, _ = layer(given)
        torch.testing.assert_close(meshes[member], alone)
    assert slope.shape == targets.shape
    nothing, none = layer({"targets": targets[:0]})
    assert (tuple(nothing.shape), none) == ((0, 36, 3), [])
    with pytest.raises(ShapeError, match="one leading batch dimension"):
        layer({"targets": targets, "fairness_weight": number(0.3)})


def test_single_precision_comes_and_goes() -> None:
    case = fair_handles()
    targets = case.parameters["targets"].float().requires_grad_()
    finished, _ = case.layer()({"targets": targets})
    assert finished.dtype == torch.float32
    judged(finished.double()).backward()
    expected, _ = slopes(case.layer(), {"targets": targets.detach().double()})
    torch.testing.assert_close(targets.grad.double(), expected["targets"], rtol=1e-4, atol=1e-4)


def test_unrolled_steps_tend_to_the_implicit_gradient() -> None:
    case = fair_handles()
    given = {"targets": case.parameters["targets"]}
    exact = slopes(case.layer(), given)[0]["targets"]
    errors = [
        float((slopes(case.layer(backward="unroll", unrolled_steps=n), given)[0]["targets"] - exact).norm())
        for n in (1, 60)
    ]
    assert errors[0] > 30.0 * errors[1] > 0.0
    assert errors[1] < 0.01 * float(exact.norm())


def test_second_derivatives_are_refused() -> None:
    case = fair_handles()
    targets = case.parameters["targets"].clone().requires_grad_()
    finished, _ = case.layer()({"targets": targets})
    (slope,) = torch.autograd.grad(judged(finished), [targets], create_graph=True)
    with pytest.raises(DerivativeError, match="differentiable once"):
        torch.autograd.grad(slope.sum(), [targets])


def test_faults_name_what_is_in_the_way() -> None:
    """A coarse mesh that slides on its own facets has kinks: no minimum after a few steps."""
    mesh = irregular_triangles(Enneper(), 90)
    recipe = FairRecipe(mesh.vertices, mesh.topology, settings=FIXED)
    weight = number(0.3).requires_grad_()
    finished, info = JobLayer(recipe, steps=2)()
    assert "no minimum was found in 2 steps" in info.point.fault
    assert finished.isfinite().all()
    with pytest.raises(DerivativeError, match=r"no derivative: no minimum was found in 2 steps.*reference mesh"):
        JobLayer(recipe, steps=2)({"fairness_weight": weight})
    with pytest.warns(UserWarning, match="Gauss-Newton matrix is used"):
        rough, _ = JobLayer(recipe, steps=2, on_fault="gauss-newton")({"fairness_weight": weight})
    judged(rough).backward()
    assert weight.grad.isfinite()


def test_bounds_of_faces_stop_the_way_down() -> None:
    """A guard that lets nothing move: the fault says that it does not."""
    case = fair_handles()
    recipe: Any = case.recipe
    recipe.problem.admits = lambda state, trial: torch.equal(state["vertices"], trial["vertices"])
    _, info = case.layer(steps=5)(start=case.recipe.given)
    assert "does not let a face go" in info.point.fault


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"places": torch.zeros(2, 3)}, "parameters of this job are .*targets, vertices, got 'places'"),
        ({"targets": torch.zeros(3, 3)}, r"parameter 'targets'.*\(2, 3\)"),
        ({"targets": torch.zeros(2, 3, dtype=torch.int64)}, "floating"),
        ({"targets": torch.full((2, 3), torch.nan)}, "finite"),
        ({"fairness_weight": torch.tensor(0.0)}, "must be above 0, got fairness_weight = 0"),
        ({"fairness_weight": torch.zeros(2, 3)}, "fairness_weight"),
    ],
)
def test_parameters_that_do_not_fit_are_refused(parameters: dict[str, Tensor], message: str) -> None:
    with pytest.raises((SettingsError, ShapeError), match=message):
        fair_handles().layer()(parameters)


def test_jobs_without_a_minimum_are_refused_at_once() -> None:
    vertices, topology = wavy_grid(5, 5, triangles=True)
    for recipe, message in (
        (DenoiseRecipe(vertices, topology), "'denoise' does not end in a minimum"),
        (FairRecipe(vertices, topology, settings=FairSettings(formulation="lifted")), "take 'reduced'"),
        (FormRecipe(vertices, topology, settings=FormSettings(formulation="lifted")), "take 'reduced'"),
    ):
        with pytest.raises(SettingsError, match=message):
            JobLayer(recipe)
    with pytest.raises(SettingsError, match="steps"):
        JobLayer(fair_handles().recipe, steps=0)
    gliding = JobLayer(FairRecipe(vertices, topology))
    with pytest.raises(SettingsError, match="parameters where it is fixed"):
        gliding({"vertices": vertices.clone().requires_grad_()})
    with pytest.raises(ShapeError, match="start"):
        gliding(start=vertices[1:])
