"""Solves as differentiable functions: gradients against finite differences of solving again."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, get_type_hints

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair import Topology
from torchfair.constraints import (
    absolute_curvature_terms,
    between_stars,
    coplanar_terms,
    cospherical_terms,
    handle_terms,
    normal_variation_terms,
    planarity_terms,
    sphere_blocks,
)
from torchfair.errors import DerivativeError, SettingsError, ShapeError
from torchfair.formfinding import FairRecipe, JobLayer
from torchfair.principal import principal_edges_of_lattice
from torchfair.projection import BackwardRule, ElementTerm, OneSided, ProjectionLayer, ProjectionSettings
from torchfair.projection.implicit import BackwardOptions
from torchfair.shapes import Catenoid, principal_triangles

Terms = Callable[[Mapping[str, Tensor]], Sequence[ElementTerm]]
SETTINGS = ProjectionSettings(max_iterations=300)
NODES = torch.arange(3)[:, None]


@dataclass(frozen=True)
class Case:
    """A start, what is solved for, and the parameters that it depends on."""

    blocks: dict[str, Tensor]
    terms: Terms
    parameters: dict[str, Tensor]
    fixed: Mapping[str, Tensor] | None = None

    def layer(self, **options: object) -> ProjectionLayer:
        return ProjectionLayer(self.blocks, self.terms, fixed=self.fixed, settings=SETTINGS, **options)


def near(vertices: Tensor, weight: float) -> ElementTerm:
    """A weak pull back to the start, which makes minima unique."""
    return handle_terms(torch.arange(len(vertices)), vertices, weight=weight, name="near the start")[0]


def rim(topology: Topology) -> dict[str, Tensor]:
    return {"vertices": topology.is_boundary_vertex}


def handles() -> Case:
    vertices, topology = wavy_grid(5, 5)
    picked = torch.tensor([6, 12, 18])

    def terms(given):
        return [
            *normal_variation_terms(topology, smoothing=0.1),
            *handle_terms(picked, given["targets"], weight=10.0),
            near(vertices, 0.1),
        ]

    return Case({"vertices": vertices}, terms, {"targets": vertices[picked] + 0.1}, rim(topology))


def edge_weights() -> Case:
    vertices, topology = wavy_grid(5, 5, triangles=True)

    def terms(given):
        (energy,) = normal_variation_terms(topology, smoothing=0.1)
        return [replace(energy, element_weights=given["weights"]), near(vertices, 0.5)]

    weights = torch.linspace(0.5, 1.5, topology.num_interior_edges, dtype=DOUBLE)
    return Case({"vertices": vertices}, terms, {"weights": weights}, rim(topology))


def near_a_surface() -> Case:
    """Spheres about the origin as references: closest points that travel with the vertices, and with the radius."""
    vertices, topology = wavy_grid(4, 4)
    vertices = vertices - vertices.mean(0) + vertices.new_tensor([0.0, 0.0, 5.0])

    def terms(given):
        def planes(state):
            away = torch.nn.functional.normalize(state["vertices"], dim=1)
            return given["radius"] * away, away

        closeness = ElementTerm(
            "closeness",
            lambda x, foot, normal: ((x[0] - foot) * normal).sum(),
            [("vertices", torch.arange(len(vertices))[:, None])],
            weight=5.0,
            refresh=planes,
        )
        return [*normal_variation_terms(topology, smoothing=0.1), closeness, near(vertices, 0.2)]

    return Case({"vertices": vertices}, terms, {"radius": torch.tensor(5.0, dtype=DOUBLE)})


def boundary_points() -> Case:
    """C between boundaries: the fixed vertices are parameters of the start."""
    vertices, topology = wavy_grid(5, 5, triangles=True)

    def terms(given):
        return [*absolute_curvature_terms(topology, smoothing=0.3), near(vertices, 0.5)]

    return Case({"vertices": vertices}, terms, {}, rim(topology))


def planarity() -> Case:
    vertices, topology = wavy_grid(4, 4)

    def terms(given):
        every = torch.arange(topology.num_faces)
        pull = handle_terms(torch.arange(len(vertices)), given["places"], weight=1.0)
        return [*planarity_terms(topology, every, weight=20.0), *pull]

    return Case({"vertices": vertices}, terms, {"places": vertices})


def limits(most: float) -> Case:
    """Points drawn up, and a ceiling that is met or not."""
    start = torch.tensor([[0.1], [0.5], [0.9]], dtype=DOUBLE)

    def terms(given):
        pull = ElementTerm("pull", lambda x, t: x[0] - t, [("x", NODES)], data=(given["targets"],))
        ceiling = ElementTerm(
            "ceiling",
            lambda x, top: x[0].sinh() - top,
            [("x", NODES)],
            data=(given["tops"],),
            weight=3.0,
            loss=OneSided(),
        )
        return [pull, ceiling]

    return Case({"x": start}, terms, {"targets": start + 0.5, "tops": torch.full((3, 1), most, dtype=DOUBLE)})


def several_blocks() -> Case:
    points = torch.linspace(0.0, 1.0, 9, dtype=DOUBLE).view(3, 3).sin()
    blocks = {"points": points, "lengths": torch.ones(3, 1, dtype=DOUBLE)}

    def terms(given):
        both = [("points", NODES), ("lengths", NODES)]
        return [
            ElementTerm("length", lambda x, s: x[0].square().sum() - s[0, 0] ** 2, both, weight=2.0),
            ElementTerm("place", lambda x, t: x[0] - t, [("points", NODES)], data=(given["places"],)),
            ElementTerm("size", lambda s, t: s[0] - t, [("lengths", NODES)], data=(given["sizes"],)),
        ]

    return Case(blocks, terms, {"places": points + 0.3, "sizes": torch.ones(3, 1, dtype=DOUBLE)})


def principal_symmetric() -> Case:
    """Handles of a lattice whose stars lie on spheres: vertices, and normals and curvatures of the spheres."""
    mesh = principal_triangles(Catenoid(), 5, 6, ends="zigzag")
    principal = principal_edges_of_lattice(mesh, "u")
    stars, vertices = principal.stars(), mesh.vertices
    picked = torch.tensor([7, 16])
    blocks = {"vertices": vertices, **sphere_blocks(vertices, stars)}

    def terms(given):
        edges = between_stars(principal.topology.edges[principal.mask], stars)
        return [
            *cospherical_terms(stars, weight=10.0),
            *coplanar_terms(edges, stars, weight=10.0),
            *handle_terms(picked, given["targets"], weight=5.0),
            near(vertices, 0.3),
        ]

    return Case(blocks, terms, {"targets": vertices[picked] + 0.05}, {})


CASES: dict[str, Callable[[], Case]] = {
    "handles": handles,
    "edge weights": edge_weights,
    "near a surface": near_a_surface,
    "boundary points": boundary_points,
    "planarity": planarity,
    "limits met": lambda: limits(0.6),
    "limits not met": lambda: limits(9.0),
    "several blocks": several_blocks,
    "principal-symmetric": principal_symmetric,
}
every = pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())


def wave(like: Tensor, phase: float) -> Tensor:
    return torch.linspace(0.0, 5.0, like.numel(), dtype=like.dtype).add(phase).cos().view_as(like)


def judged(blocks: Mapping[str, Tensor]) -> Tensor:
    """Some number that depends on all unknowns, bent so that it differs from its linear part."""
    return sum(((wave(block, 0.3) * block).sum() + block.square().sum() for block in blocks.values()), torch.zeros(()))


def varied(case: Case, step: float) -> tuple[dict[str, Tensor], dict[str, Tensor]]:
    """Start and parameters moved: of the start only what is fixed."""
    fixed = case.fixed or {}
    blocks = {
        name: block + step * wave(block, 1.0) * fixed.get(name, torch.zeros(len(block), dtype=torch.bool))[:, None]
        for name, block in case.blocks.items()
    }
    return blocks, {name: value + step * wave(value, 2.0) for name, value in case.parameters.items()}


def slopes(case: Case, **options: object) -> tuple[Tensor, Any]:
    """The derivative along the variation by the backward pass."""
    blocks, parameters = varied(case, 0.0)
    leaves = [value.requires_grad_() for value in (*blocks.values(), *parameters.values())]
    found, info = case.layer(**options)(blocks, parameters)
    gradients = torch.autograd.grad(judged(found), leaves)
    ahead, behind = varied(case, 1.0), varied(case, -1.0)
    moved = [0.5 * (a - b) for part in (0, 1) for a, b in zip(ahead[part].values(), behind[part].values(), strict=True)]
    return sum((g * m).sum() for g, m in zip(gradients, moved, strict=True)), info


def solved_again(case: Case, step: float) -> Tensor:
    """The central difference of whole solves, polished."""
    layer, sides = case.layer(tolerance=1e-11), []
    for sign in (1.0, -1.0):
        blocks, parameters = varied(case, sign * step)
        for value in (*blocks.values(), *parameters.values()):
            value.requires_grad_()  # only then ends are polished
        found, _ = layer(blocks, parameters)
        sides.append(judged(found).detach())
    return (sides[0] - sides[1]) / (2 * step)


@every
def test_implicit_derivatives_are_those_of_solving_again(case: Callable[[], Case]) -> None:
    made = case()
    slope, info = slopes(made)
    torch.testing.assert_close(slope, solved_again(made, 1e-5), rtol=1e-5, atol=1e-7)
    assert info.adjoint.remainder < 1e-7


def test_the_gauss_newton_matrix_would_not_do() -> None:
    """What the exact second derivatives are there for: the model of E alone is far off."""
    made = handles()
    exact, rough = slopes(made)[0], slopes(made, backward="unroll", unrolled_steps=1)[0]
    assert abs(rough - exact) > 1e-3 * abs(exact)


@pytest.mark.parametrize("case", [handles, planarity, boundary_points, several_blocks])
def test_unrolled_steps_tend_to_the_implicit_derivative(case: Callable[[], Case]) -> None:
    made = case()
    exact = slopes(made)[0]
    errors = [float(abs(slopes(made, backward="unroll", unrolled_steps=n)[0] - exact)) for n in (2, 40)]
    assert errors[0] > 100.0 * errors[1]
    assert errors[1] < 1e-6 * abs(exact)


def test_unrolled_steps_that_move_away_are_refused() -> None:
    """The residual itself, not its slope, is what bends this merit: by more than twice what its model knows."""
    node = torch.tensor([[0]])

    def bowl(given):
        pull = ElementTerm("pull", lambda x, p: x[0] - p, [("x", node)], data=(given["p"],), weight=0.5)
        return [ElementTerm("bowl", lambda x: x[0].square() + 1.0, [("x", node)]), pull]

    made = Case({"x": torch.full((1, 1), 0.5, dtype=DOUBLE)}, bowl, {"p": torch.full((1, 1), 0.5, dtype=DOUBLE)})
    torch.testing.assert_close(slopes(made)[0], solved_again(made, 1e-5), rtol=1e-6, atol=1e-8)
    with pytest.raises(DerivativeError, match=r"Gauss-Newton steps move away.*'implicit'"):
        slopes(made, backward="unroll", unrolled_steps=40)


@pytest.mark.parametrize("case", [several_blocks, lambda: limits(0.6)])
def test_gradcheck(case: Callable[[], Case]) -> None:
    made = case()
    layer = made.layer(tolerance=1e-11)
    names, values = list(made.parameters), [value.clone().requires_grad_() for value in made.parameters.values()]

    def solve(*given: Tensor) -> tuple[Tensor, ...]:
        return tuple(layer(made.blocks, dict(zip(names, given, strict=True)))[0].values())

    assert torch.autograd.gradcheck(solve, values, atol=1e-6)


@pytest.mark.parametrize("solver", ["dense", "cg"])
def test_the_linear_solver_of_the_backward_pass_may_be_chosen(solver: str) -> None:
    made = handles()
    torch.testing.assert_close(slopes(made, solver=solver)[0], slopes(made)[0], rtol=1e-6, atol=1e-8)


def test_gradients_go_to_parameters_alone() -> None:
    """Free entries of the start have none: the minimum does not depend on them."""
    made = boundary_points()
    start = made.blocks["vertices"].clone().requires_grad_()
    found, info = made.layer()({"vertices": start})
    judged(found).backward()
    free = ~made.fixed["vertices"]
    assert not start.grad[free].any()
    assert start.grad[~free].all()
    quiet, info = made.layer()(made.blocks)
    assert not quiet["vertices"].requires_grad
    assert info.point is None
    torch.testing.assert_close(quiet["vertices"], found["vertices"].detach(), rtol=1e-4, atol=1e-4)


def test_units_are_part_of_the_terms() -> None:
    """The same problem in millimetres: derivatives of lengths with respect to lengths do not change."""
    made = several_blocks()

    def in_metres(given):
        return made.terms({name: value / 1000.0 for name, value in given.items()})

    big = {name: (1000.0 * value).requires_grad_() for name, value in made.parameters.items()}
    small = {name: value.clone().requires_grad_() for name, value in made.parameters.items()}
    layer = ProjectionLayer(made.blocks, in_metres, settings=SETTINGS)
    found = {name: 1000.0 * block for name, block in layer(made.blocks, big)[0].items()}
    (sum(block.square().sum() for block in found.values()) / 1000.0).backward()
    sum(block.square().sum() for block in made.layer()(made.blocks, small)[0].values()).backward()
    for name, value in small.items():
        torch.testing.assert_close(big[name].grad, value.grad)


def test_batches_are_members() -> None:
    made = several_blocks()
    scales = torch.tensor([1.0, 1.2, 0.7], dtype=DOUBLE)
    parameters = {name: (scales.view(-1, 1, 1) * value).requires_grad_() for name, value in made.parameters.items()}
    starts = {name: block.expand(3, -1, -1) for name, block in made.blocks.items()}
    layer = made.layer()
    found, infos = layer(starts, parameters)
    assert [info.result.status.converged for info in infos] == [True] * 3
    together = torch.autograd.grad(judged(found), list(parameters.values()))
    for member in range(3):
        single = {name: value[member].detach().requires_grad_() for name, value in parameters.items()}
        alone, _ = layer(made.blocks, single)
        for name, block in alone.items():
            torch.testing.assert_close(found[name][member], block)
    assert [slope.shape for slope in together] == [value.shape for value in parameters.values()]
    nothing, none = layer(
        {name: start[:0] for name, start in starts.items()}, {n: p[:0] for n, p in parameters.items()}
    )
    assert none == []
    assert {name: tuple(block.shape) for name, block in nothing.items()} == {"points": (0, 3, 3), "lengths": (0, 3, 1)}
    with pytest.raises(ShapeError, match="all with one leading batch dimension"):
        layer(starts, made.parameters | {"sizes": parameters["sizes"][:2]})


def well(given: Mapping[str, Tensor]) -> list[ElementTerm]:
    """A double well, at the top between both: least at -1 and 1."""
    return [
        ElementTerm(
            "well", lambda x, p: x[0] ** 2 - 1.0 + p, [("x", torch.tensor([[0]]))], data=(given["p"],), weight=1.0
        )
    ]


TOP = {"x": torch.zeros(1, 1, dtype=DOUBLE)}
NOTHING = torch.zeros(1, 1, dtype=DOUBLE)


def early(given: Mapping[str, Tensor]) -> list[ElementTerm]:
    return [replace(well(given)[0], residual=lambda x, p: x[0].exp() - 2.0 + p)]


def test_faults_name_the_condition_that_fails() -> None:
    ahead = {"x": torch.full((1, 1), 3.0, dtype=DOUBLE)}
    few = ProjectionSettings(max_iterations=1)
    with pytest.raises(DerivativeError, match=r"curvature of the merit is not positive.*weak term"):
        at_the_top()
    with pytest.raises(DerivativeError, match="gradient is not small: after 0 Newton steps"):
        ProjectionLayer(TOP, early, settings=few, newton_steps=0)(ahead, {"p": NOTHING.clone().requires_grad_()})
    found, info = ProjectionLayer(TOP, early, settings=few)(ahead, {"p": NOTHING.clone().requires_grad_()})
    assert info.point.steps > 1  # polished to the minimum
    assert found["x"].item() == pytest.approx(torch.tensor(2.0).log().item())


def at_the_top() -> None:
    """Not one step is taken, so that the solve stays at the top."""
    layer = ProjectionLayer(TOP, well, settings=ProjectionSettings(max_iterations=0))
    layer({"x": TOP["x"] + 1e-3}, {"p": NOTHING.clone().requires_grad_()})


def test_faults_may_be_warnings() -> None:
    layer = ProjectionLayer(TOP, well, settings=ProjectionSettings(max_iterations=0), on_fault="gauss-newton")
    p = NOTHING.clone().requires_grad_()
    with pytest.warns(UserWarning, match="not positive.*Gauss-Newton matrix is used"):
        found, info = layer({"x": TOP["x"] + 1e-3}, {"p": p})
    found["x"].sum().backward()
    # J = 2 x, so -(J^T J)^-1 J^T dr/dp = -1 / (2 x).
    assert float(p.grad) == pytest.approx(-500.0, rel=1e-6)
    assert info.point.fault


def test_second_derivatives_are_refused() -> None:
    made = several_blocks()
    given = {name: value.clone().requires_grad_() for name, value in made.parameters.items()}
    found, _ = made.layer()(made.blocks, given)
    slopes = torch.autograd.grad(judged(found), list(given.values()), create_graph=True)
    with pytest.raises(DerivativeError, match="differentiable once"):
        torch.autograd.grad(slopes[0].sum(), list(given.values()))


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"backward": "explicit"}, "'implicit' or 'unroll'"),
        ({"on_fault": "ignore"}, "'error' or 'gauss-newton'"),
        ({"unrolled_steps": 0}, "unrolled_steps"),
        ({"tolerance": 0.0}, "tolerance"),
    ],
)
def test_options_out_of_range(option: dict[str, object], message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        ProjectionLayer(TOP, well, **option)


def test_both_layers_take_the_options_of_one_rule() -> None:
    """A new one is known to type checkers as well, and reaches the rule."""
    kinds = {field.name: get_type_hints(BackwardRule)[field.name] for field in fields(BackwardRule)}
    assert get_type_hints(BackwardOptions) == kinds
    options: BackwardOptions = {"unrolled_steps": 3, "accuracy": 1e-3, "products": 7, "on_fault": "gauss-newton"}
    assert ProjectionLayer(TOP, well, **options).rule == BackwardRule(**options)
    mesh = wavy_grid(3, 3)
    assert JobLayer(FairRecipe(*mesh), **options).rule == BackwardRule(**options)
    with pytest.raises(TypeError, match="newton"):
        ProjectionLayer(TOP, well, newton=3)  # type: ignore[call-arg]
