"""Elements that are silent take no part in linear systems of large problems; nothing else changes."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair.constraints import corner_angle_terms, distance_limit_terms, face_area_terms
from torchfair.constraints.barrier import barrier, barrier_slope
from torchfair.constraints.closeness import TangentPlanes
from torchfair.errors import TorchfairError
from torchfair.geometry import ReferenceSurface, corner_angles, face_areas
from torchfair.projection import (
    ElementTerm,
    IterationRecord,
    OneSided,
    ProjectionSettings,
    evaluate,
    guided_projection,
    portions,
)
from torchfair.projection.layout import Layout
from torchfair.projection.linear_system import LinearSystem
from torchfair.projection.steps import _linearise
from torchfair.projection.system import Structure


def long_enough(x: Tensor, least: Tensor) -> Tensor:
    """(n, 2): of pairs (n, 2, 3), barriers at their length and at half of it; in most of them silent."""
    margin = torch.linalg.vector_norm(x[:, 1] - x[:, 0], dim=1) - least
    return torch.stack([barrier(margin, 0.3 + 0.0 * margin), barrier(margin + 0.2, 0.3 + 0.0 * margin)], 1)


def slopes(x: Tensor, least: Tensor) -> Tensor:
    along = x[:, 1] - x[:, 0]
    size = torch.linalg.vector_norm(along, dim=1)
    steep = [barrier_slope(size - least + shift, 0.3 + 0.0 * size)[:, None] for shift in (0.0, 0.2)]
    rows = [s * along / size[:, None] for s in steep]
    return torch.stack([torch.cat([-row, row], 1) for row in rows], 1)


def high(x: Tensor) -> Tensor:
    return torch.stack([x[0, 2] - 0.1, x[0, 0] - 2.2])


def spring(x: Tensor) -> Tensor:
    return x[1] - x[0]


def nearly_equal(x: Tensor) -> Tensor:
    return (x[1] - x[0]) * (x[1] - x[0])


def problem(*, silent: bool) -> tuple[dict[str, Tensor], list[ElementTerm]]:
    """A grid with a silent term of two components, inequalities, a linear term, and a term that is none of these."""
    vertices, topology = wavy_grid(6, 5)
    edges = topology.edges
    lengths = torch.linalg.vector_norm(vertices[edges[:, 1]] - vertices[edges[:, 0]], dim=1)
    least = lengths - torch.linspace(2.0, 0.05, len(edges), dtype=DOUBLE)
    every, weights = torch.arange(len(vertices))[:, None], torch.linspace(0.5, 2.0, len(edges), dtype=DOUBLE)
    terms = [
        ElementTerm("equal", nearly_equal, [("vertices", edges[::3])]),
        ElementTerm("long", long_enough, [("vertices", edges)], (least,), 0.7, weights, jacobian=slopes,
                    batched=True, silent=silent),
        ElementTerm("high", high, [("vertices", every)], weight=20.0, loss=OneSided()),
        ElementTerm("spring", spring, [("vertices", edges[:6])], weight=3.0, linear=True),
    ]  # fmt: skip
    return {"vertices": vertices}, terms


def system_of(terms: list[ElementTerm], state: dict[str, Tensor], *, fix: bool, heeded: bool) -> LinearSystem:
    layout = Layout.of(state)
    fixed = {"vertices": torch.arange(len(state["vertices"])) < 7} if fix else {}
    structure = Structure(layout, terms, layout.free_mask(fixed, torch.device("cpu")), DOUBLE)
    if not heeded:
        return structure.linearise(state)
    holder = type("Holder", (), {"layout": layout, "structure": structure})()
    return _linearise(holder, structure.evaluate(state), ProjectionSettings())[0].system


@pytest.fixture
def many(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every number of elements above four is large."""
    monkeypatch.setattr(portions, "_PORTION", 2)


@pytest.mark.parametrize("fix", [False, True])
@pytest.mark.parametrize("heeded", [False, True])
def test_the_system_is_that_of_all_elements(monkeypatch: pytest.MonkeyPatch, fix: bool, heeded: bool) -> None:
    state, terms = problem(silent=True)
    whole = system_of(terms, state, fix=fix, heeded=heeded)
    assert whole.felt == [None] * 3
    monkeypatch.setattr(portions, "_PORTION", 2)
    some = system_of(terms, state, fix=fix, heeded=heeded)
    count = len(terms[1].stencil[0][1])
    assert some.felt[0] is None
    assert 0 < len(some.felt[1]) < count
    assert (some.felt[2] is not None) == heeded
    step = torch.sin(torch.arange(1.0, 3.0 * len(state["vertices"]) + 1.0, dtype=DOUBLE))
    damping = torch.full_like(step, 0.3)

    def numbers(system: LinearSystem) -> dict[str, Tensor]:
        terms_of_step, affine = system.changes(step)
        other = system.structure.evaluate({"vertices": state["vertices"] * 1.01})
        return {
            "gradient": system.gradient,
            "gradient with": system.gradient_with(other),
            "diagonal": system.diagonal,
            "blocks": system.diagonal_blocks["vertices"],
            "product": system.product(step),
            "products": system.product(torch.stack([step, damping], 1)),
            "fall": system.predicted_fall(step),
            "changes": torch.cat([c.flatten() for c in terms_of_step] + [affine]),
            "jacobian": system.jacobian.to_dense(),
            "residuals": system.residual_vector,
            "lower": system.lower_values,
            "preconditioner": system.preconditioner(damping).to_dense(),
        }

    expected = numbers(whole)
    for name, found in numbers(some).items():
        torch.testing.assert_close(found, expected[name], rtol=1e-12, atol=1e-12, msg=lambda m, n=name: f"{n}: {m}")


def test_what_is_felt_is_what_has_residuals(many: None) -> None:
    state, terms = problem(silent=True)
    system = system_of(terms, state, fix=False, heeded=True)
    loud = [r.abs().amax(0) > 0.0 for r in system.residuals]
    for number in (1, 2):
        torch.testing.assert_close(system.felt[number], torch.nonzero(loud[number]).squeeze(1))
        assert system.jacobians[number].shape[2] == int(loud[number].sum()) < len(loud[number])
    partly = (system.residuals[2] > 0.0).sum(0)
    assert bool((partly == 1).any())
    assert system.whole_jacobians[1].shape[2] == len(loud[1])


@pytest.mark.parametrize("solver", ["cg", "scipy", "dense"])
def test_runs_go_the_same_way(monkeypatch: pytest.MonkeyPatch, solver: str) -> None:
    state, terms = problem(silent=True)
    fixed = {"vertices": torch.arange(len(state["vertices"])) < 4}
    settings = ProjectionSettings(max_iterations=12, solver=solver)
    expected = guided_projection(state, terms, fixed=fixed, settings=settings)
    monkeypatch.setattr(portions, "_PORTION", 2)
    found = guided_projection(state, terms, fixed=fixed, settings=settings)
    assert expected.iterations > 3
    assert [r.accepted for r in found.history] == [r.accepted for r in expected.history]
    torch.testing.assert_close(found.blocks["vertices"], expected.blocks["vertices"], rtol=1e-7, atol=1e-7)


def test_a_term_of_which_all_is_silent_costs_nothing(many: None) -> None:
    state, terms = problem(silent=True)
    quiet = replace(terms[1], data=(torch.full_like(terms[1].data[0], -9.0),))
    settings = ProjectionSettings(max_iterations=3, solver="cg")
    with_it = guided_projection(state, [terms[0], quiet, *terms[2:]], settings=settings)
    without = guided_projection(state, [terms[0], *terms[2:]], settings=settings)
    assert with_it.merit == pytest.approx(without.merit, rel=1e-12)


def test_terms_become_partial_and_whole_again_with_their_loss(many: None) -> None:
    state, terms = problem(silent=True)
    layout = Layout.of(state)
    structure = Structure(layout, terms, layout.free_mask({}, torch.device("cpu")), DOUBLE)
    assert structure.partial == [False, True, True]
    structure.linearise(state).gradient  # noqa: B018
    louder = structure.with_terms([terms[0], replace(terms[1], silent=False), *terms[2:]])
    assert louder.partial == [False, False, True]
    torch.testing.assert_close(louder.linearise(state).gradient, structure.linearise(state).gradient)


def test_a_term_that_is_not_silent_where_it_says_so_is_refused() -> None:
    def kinked(x: Tensor) -> Tensor:
        return x[0, :1]

    state = {"x": torch.zeros(3, 1, dtype=DOUBLE)}
    term = ElementTerm("kinked", kinked, [("x", torch.arange(3)[:, None])], silent=True)
    with pytest.raises(TorchfairError, match="term 'kinked' is declared silent, but in element 0"):
        guided_projection(state, [term])


def test_a_bad_derivative_is_named_by_the_number_of_its_element(many: None) -> None:
    state, terms = problem(silent=True)
    system = system_of(terms, state, fix=False, heeded=False)
    felt = system.felt[1]
    assert felt is not None
    assert int(felt[2]) != 2
    system.jacobians[1][0, 3, 2] = torch.nan
    with pytest.raises(TorchfairError, match=rf"term 'long'.*elements \[{int(felt[2])}\]"):
        evaluate.check_linearised(system.structure, system)


def test_barriers_of_the_library_are_silent_where_they_are_zero() -> None:
    """Moved about, each is felt somewhere and silent elsewhere, where its derivative is zero."""
    vertices, topology = wavy_grid(6, 5)
    surface = ReferenceSurface(vertices, topology)
    moved = vertices + 0.05 * torch.sin(40.0 * vertices.flip(1))
    angles, areas = corner_angles(vertices, topology), face_areas(vertices, topology)
    terms = [
        *corner_angle_terms(topology, 0.1, angles.clamp_min(0.2), weight=1.0),
        *face_area_terms(topology, areas, safe=0.99, weight=1.0),
        *distance_limit_terms(TangentPlanes(surface), torch.full_like(vertices[:, 0], 0.06), weight=1.0),
    ]
    assert all(term.silent for term in terms)
    for term in terms:
        values, jacobians = term.linearised(term.arguments({"vertices": moved}))
        loud = (values != 0.0).any(1)
        assert 0 < int(loud.sum()) < len(loud)
        assert not bool(jacobians[~loud].any())
        assert bool(jacobians[loud].any())


def test_a_run_keeps_no_jacobians_of_its_start() -> None:
    state, terms = problem(silent=True)
    systems: list[weakref.ref[LinearSystem]] = []
    alive: list[bool] = []

    def look(record: IterationRecord) -> None:
        assert record.state is not None
        if not systems:
            systems.append(weakref.ref(record.state.linearised.system))
        elif record.accepted:
            gc.collect()
            alive.append(systems[0]() is not None)

    guided_projection(state, terms, settings=ProjectionSettings(max_iterations=4), callback=look)
    assert alive
    assert not any(alive)


@pytest.mark.parametrize("far", [5.0, 1.9])
def test_solves_end_as_with_all_elements_also_where_none_is_felt(monkeypatch: pytest.MonkeyPatch, far: float) -> None:
    """Up to the certificate of a minimum, which looks at every term."""
    state, terms = problem(silent=True)
    long = replace(terms[1], data=(terms[1].data[0] - far,))
    high_up = replace(terms[2], residual=lambda x: torch.stack([x[0, 2] - 50.0, x[0, 0] - 50.0]))
    held = ElementTerm("held", lambda x, at: x[0] - at, [("vertices", torch.arange(30)[:, None])], (state["vertices"],))
    chosen = [terms[0], long, high_up, terms[3], held]
    settings = ProjectionSettings(max_iterations=200, when_settled="judge")
    whole = guided_projection(state, chosen, settings=settings)
    monkeypatch.setattr(portions, "_PORTION", 2)
    some = guided_projection(state, chosen, settings=settings)
    assert some.status is whole.status
    assert whole.status.at_rest
    torch.testing.assert_close(some.blocks["vertices"], whole.blocks["vertices"], rtol=1e-6, atol=1e-6)
