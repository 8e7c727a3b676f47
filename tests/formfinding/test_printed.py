"""The printed method: half of the paper's functional with its own weights, and steps that nothing holds back."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair import Topology
from torchfair.energies import normal_variation, polyline_fairness, umbrella_fairness
from torchfair.formfinding import (
    FairRecipe,
    FairSettings,
    FormRecipe,
    FormSettings,
    JobResult,
    Session,
    SymmetricRecipe,
    SymmetricSettings,
    job_report,
    minimise_absolute_curvature,
    minimise_normal_variation,
    principal_symmetric,
)
from torchfair.formfinding.symmetric.problem import Aim
from torchfair.io import plain
from torchfair.polylines import straight_triples
from torchfair.principal import PrincipalEdges, principal_edges_of_lattice
from torchfair.projection import ElementTerm, Status
from torchfair.projection.layout import State
from torchfair.settings import settings_from
from torchfair.shapes import Enneper, Torus, hybrid_roof, irregular_triangles, principal_triangles
from torchfair.triangulation import triangulate

W_FAIR, W_TARGET, W_PROX, W_HANDLE, W_REG = 0.7, 0.3, 0.9, 2.5, 1e-3
WEIGHTS = {"w_reg": W_REG, "w_fair": W_FAIR, "w_target": W_TARGET, "w_handle": W_HANDLE}


def merit(terms: list[ElementTerm], state: State) -> float:
    data = [(term, term.arguments(state)) for term in terms]
    return sum(float(term.contributions(given, term.values(given)).sum()) for term, given in data)


def shaken(blocks: State, seed: int = 0) -> State:
    """Nothing fits anything."""
    generator = torch.Generator().manual_seed(seed)
    return {
        name: block + 0.05 * torch.randn(block.shape, dtype=DOUBLE, generator=generator)
        for name, block in blocks.items()
    }


def constraints_of_the_energy(state: State, topology: Topology) -> float:
    """Sum of squares of the constraints of section 5.1, edge by edge and side by side."""
    x, n, s = state["vertices"], state["normals"], state["lengths"]
    total = 0.0
    for edge in range(topology.num_interior_edges):
        (v, w), (f, g) = topology.interior_edges[edge].tolist(), topology.interior_edge_faces[edge].tolist()
        length, dual, delta, mu = s[edge].tolist()
        total += (float((x[v] - x[w]).square().sum()) - length**2) ** 2 + (length - delta**2) ** 2
        total += (float((n[f] - n[g]).square().sum()) - dual**2) ** 2 + (dual - mu**2) ** 2
    for face, corners in enumerate(topology.face_lists()):
        total += (float(n[face].square().sum()) - 1.0) ** 2
        for v, w in zip(corners, (*corners[1:], corners[0]), strict=True):
            total += float(n[face] @ (x[v] - x[w])) ** 2
    return total


def torus(noise: float = 0.03) -> tuple[Tensor, PrincipalEdges]:
    mesh = principal_triangles(Torus(2.0, 0.8), 10, 18)
    shake = noise * torch.randn(mesh.vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(1))
    return mesh.vertices + shake, principal_edges_of_lattice(mesh, "u")


def test_fair_lowers_half_the_papers_functional() -> None:
    """``|F(X)|^2 + w_fair E_fair + w_target E + w_prox (squared distances) + handles``, and nothing else."""
    vertices, topology = wavy_grid(6, 5, triangles=True)
    settings = replace(FairSettings.paper(**WEIGHTS, w_prox=W_PROX), boundary="free", flat="none")
    recipe = FairRecipe(vertices, topology, handles={7: (0.3, 0.1, 0.2)}, settings=settings)
    (stage,) = [recipe.plan(recipe.state()).stages().send(None)]
    state = shaken(stage.blocks)
    x, s = state["vertices"], state["lengths"]
    triples = straight_triples(topology, corners=recipe.problem.corners)
    expected = constraints_of_the_energy(state, topology)
    expected += W_FAIR * float(polyline_fairness(x, topology, triples))
    expected += W_TARGET * float((s[:, 2] ** 2 * s[:, 3] ** 2).sum())
    expected += W_PROX * float(recipe.problem.near.surface.closest(x).distances.square().sum())
    expected += W_HANDLE * float((x[7] - recipe.pulls.targets[7]).square().sum())
    assert merit(list(stage.terms()), state) == pytest.approx(0.5 * expected, rel=1e-9)
    assert stage.settings.initial_damping == W_REG


def test_on_feasible_variables_the_target_is_e() -> None:
    vertices, topology = wavy_grid(6, 5, triangles=True)
    settings = replace(FairSettings.paper(w_fair=0.0, w_target=1.0, w_prox=0.0), boundary="free", flat="none")
    recipe = FairRecipe(vertices, topology, settings=settings)
    terms = list(recipe.plan(recipe.state()).stages().send(None).terms())
    found = merit(terms, recipe.problem.blocks(recipe.start))
    assert found == pytest.approx(0.5 * float(normal_variation(recipe.start, topology)), rel=1e-12)


def test_form_lowers_half_the_papers_functional_by_its_reweighting() -> None:
    mesh = irregular_triangles(Enneper(), 60)
    settings = FormSettings.paper(**WEIGHTS)
    recipe = FormRecipe(mesh.vertices, mesh.topology, settings=settings)
    stages = list_of_stages(recipe)
    assert len(stages) == 1
    terms, state = list(stages[0].terms()), shaken(stages[0].blocks)
    (target,) = (term for term in terms if term.name == "absolute curvature")
    constraints = [term for term in terms if set(dict(term.stencil)) != {"vertices"} and term is not target]
    others = [term for term in terms if set(dict(term.stencil)) == {"vertices"}]
    assert {term.weight for term in constraints} == {1.0}
    fairness = float(umbrella_fairness(state["vertices"], mesh.topology))
    assert merit(others, state) == pytest.approx(0.5 * W_FAIR * fairness, rel=1e-9)
    # The model is half of w_target lambda^2 / (|lambda_prev| + epsilon).
    values = target.values(target.arguments(state))
    epsilon = recipe.problem.smoothing(recipe.start, settings.smoothing)
    torch.testing.assert_close(target.roots(values).square(), W_TARGET / (values[:, 0].abs() + epsilon))


def list_of_stages(recipe: FormRecipe) -> list:
    """All stages of a plan, each answered by nothing done."""
    plan = recipe.plan(recipe.state())
    found, stages = [], plan.stages()
    stage = next(stages, None)
    while stage is not None:
        found.append(stage)
        try:
            stage = stages.send(None)
        except StopIteration:
            break
    return found


def test_symmetric_lowers_half_the_papers_functional() -> None:
    vertices, principal = torus()
    settings = SymmetricSettings.paper(**WEIGHTS, w_prox=W_PROX)
    recipe = SymmetricRecipe(
        vertices, principal, handles={3: (3.0, 0.2, 0.1)}, reference=(vertices, principal.topology), settings=settings
    )
    stage = recipe.plan(recipe.state()).stages().send(None)
    state, problem = shaken(stage.blocks), recipe.problem
    x, s, topology = state["vertices"], state["lengths"], principal.topology
    expected = constraints_of_the_energy(state, topology) + W_FAIR * float(polyline_fairness(x, topology))
    expected += W_TARGET * float((s[:, 2] ** 2 * s[:, 3] ** 2).sum())
    expected += W_PROX * float(problem._reference.closest(x).distances.square().sum())
    expected += W_HANDLE * float((x[3] - recipe.pulls.targets[3]).square().sum())
    centres, planes, slacks = state["sphere centres"], state["edge planes"], state["slacks"]
    place = {int(v): number for number, v in enumerate(recipe.stars.vertices)}
    for number, v in enumerate(recipe.stars.vertices.tolist()):
        away = x[v] - centres[number]
        for w in recipe.stars.cospherical[number].tolist():
            expected += float(away.square().sum() - (x[w] - centres[number]).square().sum()) ** 2
        if bool(problem.sides.is_saddle[number]):
            for which, w in enumerate(recipe.stars.principal[number].tolist()):
                expected += float(away @ (x[v] - x[w]) + slacks[number, which] ** 2) ** 2
    for normal, (v, w) in zip(planes, problem.edges.tolist(), strict=True):
        rows = torch.stack([x[v] - x[w], centres[place[v]] - x[v], centres[place[w]] - x[w]])
        expected += float((rows @ normal).square().sum()) + (float(normal @ normal) - 1.0) ** 2
    assert merit(list(stage.terms()), state) == pytest.approx(0.5 * expected, rel=1e-9)
    assert stage.settings.initial_damping == W_REG
    assert {name: block.shape[0] * block.shape[1] for name, block in state.items()} == {
        "vertices": 3 * 180,
        "sphere centres": 3 * 180,
        "edge planes": 3 * 180,
        "slacks": 2 * 180,
        "normals": 3 * 360,
        "lengths": 4 * 540,
    }


def test_variables_of_e_fit_the_vertices_after_every_stage_also_where_none_of_its_terms_asks_them_to() -> None:
    vertices, principal = torus()
    settings = SymmetricSettings(formulation="lifted", energy_weight=0.1)
    problem = SymmetricRecipe(vertices, principal, settings=settings).problem
    stage = problem.stage(problem.blocks(problem.base), Aim.EXACT, settings.projection)
    assert {name for term in stage.terms() for name, _ in term.stencil}.isdisjoint({"normals", "lengths"})
    after = stage.result({**stage.blocks, "vertices": problem.base + 0.01 * problem.base.sin()})
    assert constraints_of_the_energy(after, principal.topology) < 1e-20


def test_without_a_target_the_variables_of_e_are_left_out() -> None:
    vertices, principal = torus()
    recipe = SymmetricRecipe(vertices, principal, settings=SymmetricSettings.paper())
    assert recipe.state().keys() == {"vertices", "sphere centres", "edge planes", "slacks"}


def runs() -> dict[str, JobResult]:
    sheet, open_one = wavy_grid(7, 6, triangles=True), irregular_triangles(Enneper(), 60)
    return {
        "fair": minimise_normal_variation(*sheet, settings=FairSettings.paper(steps=4)),
        "form": minimise_absolute_curvature(open_one.vertices, open_one.topology, settings=FormSettings.paper(steps=4)),
        "symmetric": principal_symmetric(*torus(), settings=SymmetricSettings.paper(w_target=1e-9, steps=4)),
    }


def test_one_run_takes_every_step_with_the_same_damping() -> None:
    damping = {"fair": 1e-6, "form": 1e-3, "symmetric": 1e-6}
    for job, result in runs().items():
        assert len(result.runs) == 1
        records = result.projection.history
        assert [record.damping for record in records[1:]] == [damping[job]] * 4, job
        assert all(record.accepted for record in records)
        assert result.projection.status is Status.MAX_ITERATIONS


def test_panels_are_kept_flat_as_the_paper_says_in_one_run() -> None:
    """A roof whose quads arrive as coplanar triangles; without the constraint they fold."""
    vertices, quads = hybrid_roof(4, 9)
    mesh = vertices, Topology.from_faces(triangulate(vertices, quads).triangles, quads.num_vertices)
    settings = FairSettings.paper(w_fair=0.02, w_target=0.1, w_reg=1e-2, steps=15)
    kept, free = (
        minimise_normal_variation(*mesh, settings=chosen) for chosen in (settings, replace(settings, flat="none"))
    )
    assert len(kept.runs) == 1
    assert "edges between coplanar triangles are kept flat" in " ".join(kept.notes)
    problem = FairRecipe(*mesh, settings=settings).problem
    folds = [float(problem.panels.folds(problem_unit(result, mesh)).mean()) for result in (kept, free)]
    assert folds[0] < 0.3 * folds[1]


def problem_unit(result: JobResult, mesh: tuple[Tensor, Topology]) -> Tensor:
    """Vertices of a result as the problem sees them."""
    return FairRecipe(*mesh).unit.apply(result.vertices)


def test_what_is_not_kept_is_said() -> None:
    """Nothing holds the printed method; its promises are measured as those of any result."""
    result = principal_symmetric(*torus(), settings=SymmetricSettings.paper(steps=4))
    assert not result.holds
    assert any("largest relative residual" in str(promise) for promise in result.promises if not promise.holds)


def test_a_mesh_that_shrinks_to_a_point_is_returned_and_its_promises_fail() -> None:
    """Nothing holds a closed mesh against fairness of weight 1."""
    cube = torch.tensor([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=DOUBLE)
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    triangles = [half for a, b, c, d in quads for half in ([a, b, c], [a, c, d])]
    result = minimise_normal_variation(cube, Topology.from_faces(triangles), settings=FairSettings.paper())
    assert result.after["mean_edge_length"] < 1e-6
    assert not result.holds


def test_a_report_gives_the_settings_back() -> None:
    sheet = wavy_grid(7, 6, triangles=True)
    settings = FairSettings.paper(w_fair=0.2, w_target=0.1, steps=3)
    result = minimise_normal_variation(*sheet, settings=settings)
    report = json.loads(json.dumps(plain(job_report(result, settings))))
    again = settings_from(report["settings"], FairSettings)
    assert again == settings
    assert torch.equal(minimise_normal_variation(*sheet, settings=again).vertices, result.vertices)


def test_live_sessions_settle_without_rounds() -> None:
    vertices, principal = torus(0.0)
    session = Session(SymmetricRecipe(vertices, principal, settings=SymmetricSettings.paper(w_prox=0.0, steps=3)))
    session.move({0: (1.02 * vertices[0]).tolist()})
    assert session.step().accepted
    before = len(session.runs)
    assert not session.settle()
    assert len(session.runs) == before + 1


def test_second_differences_are_an_option_of_ours_too() -> None:
    vertices, topology = wavy_grid(7, 6, triangles=True)
    result = minimise_normal_variation(vertices, topology, settings=FairSettings(second_differences=True))
    assert result.holds
    assert result.after["normal_variation"] < result.before["normal_variation"]
    names = [row.name for row in result.projection.residuals if row.merit > 0.0]
    assert "boundary fairness" not in names
    assert "fairness" in names
