"""Terms of principal-symmetric meshes: closed derivatives, zeros on exact meshes, three formulations of one thing."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE

from torchfair import ShapeError
from torchfair.constraints import (
    coplanar_terms,
    cospherical_terms,
    displacement_fairness_terms,
    even_star_terms,
)
from torchfair.constraints import principal_symmetric as ps
from torchfair.constraints.eliminated_principal_symmetric import eliminated_principal_symmetric_terms
from torchfair.constraints.lifted_principal_symmetric import (
    lifted_principal_symmetric_blocks,
    lifted_principal_symmetric_terms,
)
from torchfair.principal import PrincipalEdges, principal_edges_of_lattice
from torchfair.projection import ElementTerm, GuidedProjection, ProjectionSettings
from torchfair.projection.differentiation import differentiate
from torchfair.projection.layout import State
from torchfair.shapes import Catenoid, Cylinder, Enneper, Paraboloid, ShapeMesh, Torus, principal_triangles
from torchfair.shapes.principal_triangles import parameter_triangles

EXACT = ProjectionSettings(
    max_iterations=25, initial_damping=1e-3, damping_scale="identity", merit_tolerance=1e-20, step_tolerance=1e-14
)


def lattice(name: str) -> tuple[ShapeMesh, PrincipalEdges]:
    mesh = {
        "torus": lambda: principal_triangles(Torus(2.0, 1.0), 12, 16),
        "catenoid": lambda: principal_triangles(Catenoid(), 8, 14, ends="zigzag"),
        "cylinder": lambda: principal_triangles(Cylinder(), 8, 14, ends="zigzag"),
        "plane": lambda: parameter_triangles(Paraboloid(0.0, 0.0), 9, 9, ends="zigzag"),
        "enneper": lambda: principal_triangles(Enneper(0.7), 10, 10, ends="zigzag"),
    }[name]()
    return mesh, principal_edges_of_lattice(mesh, "u").check()


def problem(
    form: str, vertices: torch.Tensor, edges: PrincipalEdges, *, saddles: bool = False
) -> tuple[State, Sequence[ElementTerm]]:
    stars = edges.stars()
    between = ps.between_stars(edges.topology.edges[edges.mask], stars)
    if form == "spheres":
        terms = cospherical_terms(stars, weight=1.0) + coplanar_terms(between, stars, weight=1.0)
        return {"vertices": vertices, **ps.sphere_blocks(vertices, stars)}, terms
    if form == "eliminated":
        return {"vertices": vertices}, eliminated_principal_symmetric_terms(between, stars, weight=1.0)
    is_saddle = torch.full(stars.vertices.shape, saddles)
    terms = lifted_principal_symmetric_terms(between, stars, is_saddle, weight=1.0)
    return {"vertices": vertices, **lifted_principal_symmetric_blocks(vertices, between, stars)}, terms


def residuals(blocks: State, terms: Sequence[ElementTerm]) -> dict[str, float]:
    used = [term for term in terms if term.num_elements]
    return {term.name: float(term.values(term.arguments(blocks)).abs().max()) for term in used}


@pytest.mark.parametrize("form", ["spheres", "eliminated", "lifted"])
@pytest.mark.parametrize("name", ["torus", "catenoid", "cylinder"])
def test_terms_vanish_on_surfaces_of_revolution(form: str, name: str) -> None:
    mesh, edges = lattice(name)
    assert max(residuals(*problem(form, mesh.vertices, edges)).values()) < 1e-12


@pytest.mark.parametrize("form", ["spheres", "eliminated"])
def test_flat_meshes_are_exact_and_finite(form: str) -> None:
    mesh, edges = lattice("plane")
    blocks, terms = problem(form, mesh.vertices, edges)
    assert max(residuals(blocks, terms).values()) < 1e-14
    for term in terms:
        assert bool(torch.isfinite(term.jacobians(term.arguments(blocks))).all())
    if form == "spheres":
        assert float(blocks[ps.CURVATURES].abs().max()) < 1e-14


def test_saddle_slacks_of_the_paper_hold_on_a_saddle_and_not_on_a_cylinder() -> None:
    for name, right in (("catenoid", True), ("cylinder", False)):
        mesh, edges = lattice(name)
        values = residuals(*problem("lifted", mesh.vertices, edges, saddles=True))
        assert (values["saddle side"] < 1e-12) is right


@pytest.mark.parametrize("form", ["spheres", "eliminated", "lifted"])
def test_jacobians_equal_differences(form: str) -> None:
    mesh, edges = lattice("enneper")
    bumpy = mesh.vertices + 0.01 * torch.sin(torch.arange(mesh.vertices.numel(), dtype=DOUBLE)).view(-1, 3)
    blocks, terms = problem(form, bumpy, edges, saddles=True)
    for term in terms:
        arguments = term.arguments(blocks)
        count = len(term.stencil)
        flat = torch.cat([part.flatten(1) for part in arguments[:count]], dim=1)
        sizes = [part.shape[1:] for part in arguments[:count]]

        def split(
            rows: torch.Tensor, arguments: tuple[torch.Tensor, ...] = arguments, sizes: list[torch.Size] = sizes
        ) -> tuple[torch.Tensor, ...]:
            parts = rows.split([size.numel() for size in sizes], dim=1)
            local = [part.reshape(-1, *size) for part, size in zip(parts, sizes, strict=True)]
            return (*local, *arguments[len(sizes) :])

        step = 1e-6
        columns = []
        for i in range(flat.shape[1]):
            shift = torch.zeros_like(flat)
            shift[:, i] = step
            columns.append((term.values(split(flat + shift)) - term.values(split(flat - shift))) / (2 * step))
        torch.testing.assert_close(term.jacobians(arguments), torch.stack(columns, dim=2), rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("name", ["torus", "catenoid", "enneper"])
def test_formulations_meet_the_same_conditions(name: str) -> None:
    """A bumpy mesh goes to one that satisfies the conditions of all three, whichever is solved."""
    mesh, edges = lattice(name)
    scale = float(torch.linalg.vector_norm(mesh.vertices[edges.topology.edges].diff(dim=1), dim=2).mean())
    generator = torch.Generator().manual_seed(0)
    start = mesh.vertices / scale
    start = start + 0.02 * torch.randn(start.shape, generator=generator, dtype=DOUBLE)
    for form in ("spheres", "eliminated", "lifted"):
        blocks, terms = problem(form, start, edges)
        assert max(residuals(blocks, terms).values()) > 1e-3
        run = GuidedProjection(blocks, terms).solve(blocks, settings=EXACT)
        if form == "lifted" and not run.merit < 1e-16:
            continue  # documented: spheres far away slow the paper's form down
        for other in ("spheres", "eliminated"):
            assert max(residuals(*problem(other, run.blocks["vertices"], edges)).values()) < 1e-7


def test_a_flat_and_a_cylindrical_mesh_are_reached_from_bumpy_ones() -> None:
    for name in ("plane", "cylinder"):
        mesh, edges = lattice(name)
        generator = torch.Generator().manual_seed(1)
        start = mesh.vertices + 0.005 * torch.randn(mesh.vertices.shape, generator=generator, dtype=DOUBLE)
        blocks, terms = problem("spheres", start, edges)
        run = GuidedProjection(blocks, terms).solve(blocks, settings=EXACT)
        assert run.merit < 1e-18
        if name == "cylinder":  # noise on a plane has principal directions of its own
            assert float((run.blocks["vertices"] - start).abs().max()) < 0.1


def test_ends_that_are_no_stars_are_refused() -> None:
    edges = lattice("catenoid")[1]
    with pytest.raises(ShapeError, match="stars"):
        coplanar_terms(edges.topology.edges[edges.mask], edges.stars(), weight=1.0)


def test_unevenness_is_the_shear_of_a_star_and_falls_with_the_spacing() -> None:
    places = torch.tensor([[0.0, 0], [2, 0], [1, 1], [-1, 1], [-2, 0], [-1, -1], [1, -1]], dtype=DOUBLE)
    flat = torch.cat([places, torch.zeros(7, 1, dtype=DOUBLE)], dim=1)
    assert ps.unevenness(flat[None]).abs().max() == 0.0
    sheared = flat.clone()
    sheared[:, 0] += 0.3 * sheared[:, 1]
    torch.testing.assert_close(ps.unevenness(7.0 * sheared[None]), torch.tensor([[0.15, -0.15]], dtype=DOUBLE))
    largest = []
    for cells in (10, 20, 40):
        mesh = principal_triangles(Enneper(0.7), cells, cells, ends="zigzag")
        (term,) = even_star_terms(principal_edges_of_lattice(mesh, "u").stars(), weight=1.0)
        largest.append(float(term.values(term.arguments({"vertices": mesh.vertices})).abs().max()))
    assert largest[0] / largest[1] > 1.8
    assert largest[1] / largest[2] > 1.8


def test_displacement_fairness_is_zero_at_translations_and_feels_a_pulled_vertex() -> None:
    mesh, _ = lattice("enneper")
    terms = displacement_fairness_terms(mesh.vertices, mesh.topology, weight=1.0)
    moved = {"vertices": mesh.vertices + torch.tensor([0.3, -2.0, 5.0], dtype=DOUBLE)}
    assert max(residuals(moved, terms).values()) < 1e-14
    pulled = mesh.vertices.clone()
    vertex = int(torch.nonzero(~mesh.topology.is_boundary_vertex)[20])
    pulled[vertex] += torch.tensor([0.0, 0.0, 0.6], dtype=DOUBLE)
    values = torch.cat([term.values(term.arguments({"vertices": pulled})).norm(dim=1) for term in terms])
    assert float(values.max()) == pytest.approx(0.6)
    assert int((values > 1e-12).sum()) == 7  # the vertex, with 0.6, and its neighbours, with 0.1


def test_closed_derivatives_of_the_eliminated_conditions() -> None:
    mesh = principal_triangles(Torus(2.0, 1.0), 12, 16, along="u")
    generator = torch.Generator().manual_seed(3)
    vertices = mesh.vertices + 0.03 * torch.randn(mesh.vertices.shape, dtype=DOUBLE, generator=generator)
    edges = principal_edges_of_lattice(mesh, "u")
    stars = edges.stars()
    between = ps.between_stars(edges.topology.edges[edges.mask], stars)
    for other in eliminated_principal_symmetric_terms(between, stars, weight=1.0):
        term = replace(other, derivatives="closed form")
        arguments = term.arguments({"vertices": vertices})
        _, expected = differentiate(term.residual, arguments, 1, batched=True)
        assert float((term.jacobians(arguments) - expected).abs().max()) < 1e-11 * float(expected.abs().max())
        collapsed = term.arguments({"vertices": vertices * torch.tensor([1.0, 0.0, 0.0], dtype=DOUBLE)})
        for way in (term, other):
            assert float(way.jacobians(collapsed).abs().max()) == 0.0  # no sphere is determined
