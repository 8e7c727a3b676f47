"""Solves as differentiable functions: gradients against finite differences of solving again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from layer_cases import NODES, SETTINGS, Case, judged, several_blocks, slopes, solved_again
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
from torchfair.errors import ShapeError
from torchfair.principal import principal_edges_of_lattice
from torchfair.projection import ElementTerm, OneSided, ProjectionLayer
from torchfair.shapes import Catenoid, principal_triangles


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
