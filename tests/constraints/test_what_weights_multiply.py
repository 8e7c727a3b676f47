"""What a weight multiplies: the table of the page on the printed method, by plain sums over vertices and edges."""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Callable
from fractions import Fraction
from pathlib import Path

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from term_cases import mixed, moved, rim, triangles
from torch import Tensor

from torchfair import Topology
from torchfair import constraints as c
from torchfair.energies import normal_variation, polyline_fairness, umbrella_fairness
from torchfair.formfinding import DenoiseSettings, FairSettings, FormSettings, SymmetricSettings
from torchfair.geometry import ReferenceSurface, dual_edge_lengths, edge_lengths
from torchfair.polylines import straight_triples
from torchfair.projection import ElementTerm
from torchfair.projection.layout import State
from torchfair.settings import fields_of

CPU = torch.device("cpu")
WEIGHT = 2.5
PAGE = Path(__file__).resolve().parents[2] / "docs" / "printed.md"

Whole = tuple[list[ElementTerm], State, float]
ROWS: dict[str, list[Callable[[], Whole]]] = {}


def row(start: str) -> Callable[[Callable[[], Whole]], None]:
    """Registers terms of :data:`WEIGHT`, a state, and the sum that the row of the table that starts so names."""

    def register(make: Callable[[], Whole]) -> None:
        ROWS.setdefault(start, []).append(make)

    return register


def corners_none(topology: Topology) -> Tensor:
    return torch.zeros(topology.num_vertices, dtype=torch.bool)


def factors() -> dict[str, float]:
    """Third column of the table by its first."""
    section = PAGE.read_text().partition("## What a weight multiplies")[2]
    cells = [
        [cell.strip() for cell in re.split(r"(?<!\\)\|", line)[1:-1]] for line in re.findall(r"^\|.*\|$", section, re.M)
    ]
    return {first: float(Fraction(factor)) for first, _, factor, _ in cells[2:]}


@row("`constraint_weight`")
def _() -> Whole:
    vertices, topology = triangles(CPU)
    state = {"vertices": moved(vertices), **c.lifted_normal_variation_blocks(vertices, topology)}
    planar = torch.ones(topology.num_faces, dtype=torch.bool)
    terms = c.lifted_normal_variation_terms(vertices, topology, planar, weight=0.0, constraint_weight=WEIGHT)
    return terms, state, sum(float(t.values(t.arguments(state)).square().sum()) for t in terms[:-1])


@row("`fairness_weight`, quads, boundary, `second_differences`")
def _() -> Whole:
    vertices, topology = triangles(CPU)
    state = {"vertices": moved(vertices)}
    return (
        c.polyline_fairness_terms(topology, weight=WEIGHT),
        state,
        float(polyline_fairness(state["vertices"], topology)),
    )


@row("`fairness_weight`, quads, boundary, `second_differences`")
def _() -> Whole:
    vertices, topology = wavy_grid(6, 5)
    triples = straight_triples(topology)
    inner = triples[~topology.is_boundary_vertex[triples[:, 1]]]
    total = float(polyline_fairness(vertices, topology, inner))
    return c.interior_fairness_terms(topology, weight=WEIGHT), {"vertices": vertices}, total


@row("`fairness_weight`, quads, boundary, `second_differences`")
def _() -> Whole:
    vertices, topology = mixed(CPU)
    triples = straight_triples(topology)
    outer = triples[topology.is_boundary_vertex[triples[:, 1]]]
    terms = c.boundary_fairness_terms(topology, corners_none(topology), weight=WEIGHT)
    return terms, {"vertices": vertices}, float(polyline_fairness(vertices, topology, outer))


@row("`fairness_weight`, `umbrella_weight`, elsewhere")
def _() -> Whole:
    vertices, topology = triangles(CPU)
    terms = c.interior_fairness_terms(topology, weight=WEIGHT)
    return terms, {"vertices": vertices}, float(umbrella_fairness(vertices, topology))


@row("`energy_weight`")
def _() -> Whole:
    vertices, topology = mixed(CPU)
    terms = c.normal_variation_terms(topology, smoothing=1e-13, weight=WEIGHT)
    return terms, {"vertices": vertices}, float(normal_variation(vertices, topology))


@row("`energy_weight`")
def _() -> Whole:
    vertices, topology = triangles(CPU)
    state = {"vertices": vertices, **c.lifted_normal_variation_blocks(vertices, topology)}
    planar = torch.ones(topology.num_faces, dtype=torch.bool)
    terms = c.lifted_normal_variation_terms(vertices, topology, planar, weight=WEIGHT, constraint_weight=0.0)
    return terms, state, float(normal_variation(vertices, topology))


@row("`curvature_weight`")
def _() -> Whole:
    vertices, topology = triangles(CPU)
    state = {"vertices": vertices, **c.lifted_absolute_curvature_blocks(vertices, topology)}
    terms = c.lifted_absolute_curvature_terms(topology, smoothing=1e-13, weight=WEIGHT, constraint_weight=0.0)
    return terms, state, float(state["curvatures"].abs().sum())


@row("`closeness_weight`, `boundary_weight`")
def _() -> Whole:
    vertices, topology = triangles(CPU)
    surface, state = ReferenceSurface(vertices, topology), {"vertices": moved(vertices)}
    terms = c.closeness_terms(c.TangentPlanes(surface), torch.arange(topology.num_vertices), weight=WEIGHT)
    return terms, state, float(surface.closest(state["vertices"]).distances.square().sum())


@row("`handle_weight`, `anchor_weight`")
def _() -> Whole:
    vertices, topology = triangles(CPU)
    chosen, state = rim(topology), {"vertices": moved(vertices)}
    terms = c.handle_terms(chosen, vertices[chosen], weight=WEIGHT)
    return terms, state, float((state["vertices"] - vertices)[chosen].square().sum())


@row("`planarity_weight`")
def _() -> Whole:
    corners = torch.tensor([[0.0, 0, 0], [1, 0, 0.3], [1, 1, 0], [0, 1, 0.3]], dtype=DOUBLE)  # diagonals 0.3 apart
    topology = Topology.from_faces([[0, 1, 2, 3]])
    return c.planarity_terms(topology, torch.tensor([0]), weight=WEIGHT), {"vertices": corners}, 0.3**2


@row("`flat_weight`")
def _() -> Whole:
    vertices, topology = triangles(CPU)
    chosen, count = torch.arange(0, topology.num_interior_edges, 3), topology.num_interior_edges
    products = edge_lengths(vertices, topology)[:count] * dual_edge_lengths(vertices, topology)
    terms = c.flat_edge_terms(topology, chosen, weight=WEIGHT)
    return terms, {"vertices": vertices}, float(products[chosen].square().sum())


@row("`flat_weight`")
def _() -> Whole:
    vertices, topology = triangles(CPU)
    state = {"vertices": vertices, **c.lifted_normal_variation_blocks(vertices, topology)}
    chosen = torch.arange(0, topology.num_interior_edges, 3)
    terms = c.lifted_flat_edge_terms(topology, chosen, weight=WEIGHT)
    return terms, state, 2.0 * float(dual_edge_lengths(vertices, topology)[chosen].square().sum())


@row("`quality_weight`")
def _() -> Whole:
    vertices, topology = triangles(CPU)
    terms = c.corner_angle_terms(
        topology, 0.05, torch.full((topology.corners.shape[0],), 2.0, dtype=DOUBLE), weight=WEIGHT
    )
    (term,) = terms
    state = {"vertices": vertices}
    return terms, state, float(term.values(term.arguments(state)).square().sum())


@row("`tangent_weight`")
def _() -> Whole:
    vertices, topology = triangles(CPU)
    flat, chosen, angle = vertices * vertices.new_tensor([1.0, 1.0, 0.0]), rim(topology), 1e-4
    tilted = vertices.new_tensor([0.0, math.sin(angle), math.cos(angle)]).expand(chosen.shape[0], 3)
    terms = c.tangent_plane_terms(topology, chosen, tilted, weight=WEIGHT)
    return terms, {"vertices": flat}, chosen.shape[0] * angle**2


def merit(terms: list[ElementTerm], state: State) -> float:
    """Of those that have a weight."""
    chosen = [(term, term.arguments(state)) for term in terms if term.weight]
    return sum(float(term.contributions(data, term.values(data)).sum()) for term, data in chosen)


@pytest.mark.parametrize("name", ROWS)
def test_the_factor_of_the_table_is_what_the_weight_multiplies(name: str) -> None:
    for make in ROWS[name]:
        terms, state, whole = make()
        assert whole > 0.0
        assert merit(terms, state) == pytest.approx(WEIGHT * factors()[name] * whole, rel=1e-6)


def test_every_row_of_the_table_is_tested() -> None:
    """Damping multiplies no term: its row is that of the steps, see ``test_every_step.py``."""
    assert factors().keys() - ROWS.keys() == {"`projection.initial_damping` (constant)"}


# ---- what docstrings say -----------------------------------------------------------------------------------

SAID = re.compile(r"\b(half|eighth|counts? once)\b")


@pytest.mark.parametrize("kind", [FairSettings, FormSettings, SymmetricSettings, DenoiseSettings])
def test_every_weight_of_settings_says_what_it_multiplies(kind: type) -> None:
    weights = {name: field.help for name, field in fields_of(kind).items() if name.endswith("_weight")}
    assert weights
    silent = {name for name, text in weights.items() if not SAID.search(text) and "Weight of the same" not in text}
    assert silent == set()


@pytest.mark.parametrize("name", sorted(name for name in vars(c) if name.endswith("_terms")))
def test_every_function_of_terms_says_what_its_weight_multiplies(name: str) -> None:
    assert SAID.search(inspect.getdoc(getattr(c, name)) or "")
