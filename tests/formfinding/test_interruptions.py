"""Jobs interrupted in any phase: what was found until then comes back, whole and measured."""

from __future__ import annotations

import importlib
import signal
import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE, grid_faces
from interruptions import WAYS, nth, stop
from torch import Tensor

from torchfair import Topology
from torchfair.formfinding import (
    FairSettings,
    FormSettings,
    JobResult,
    Level,
    SymmetricDesign,
    SymmetricLevel,
    SymmetricSettings,
    job_report,
    minimise_absolute_curvature,
    minimise_normal_variation,
    principal_symmetric,
)
from torchfair.formfinding.form.plan import FormPlan
from torchfair.principal import PrincipalEdges, principal_edges_of_lattice
from torchfair.projection import IterationRecord, Status, unbegun
from torchfair.shapes import Cylinder, Torus, principal_triangles

Act = Callable[[], None]


@pytest.fixture(autouse=True)
def handler_is_put_back() -> Iterator[None]:
    before = signal.getsignal(signal.SIGINT)
    yield
    assert signal.getsignal(signal.SIGINT) is before


def disturb(monkeypatch: pytest.MonkeyPatch, place: str, n: int, act: Act) -> None:
    """Does ``act()`` within the n-th call of a function, such as ``form.problem:FormProblem.terms``."""
    module, path = place.split(":")
    owner: object = importlib.import_module(f"torchfair.formfinding.{module}")
    *owners, name = path.split(".")
    for part in owners:
        owner = getattr(owner, part)
    monkeypatch.setattr(owner, name, nth(getattr(owner, name), n, act, after=True))


def count_calls(monkeypatch: pytest.MonkeyPatch, place: str) -> list[int]:
    """One entry for each call of a function from now on."""
    calls: list[int] = []
    module, name = place.split(":")
    owner = importlib.import_module(f"torchfair.formfinding.{module}")
    function = getattr(owner, name)
    monkeypatch.setattr(owner, name, lambda *given, **named: (calls.append(1), function(*given, **named))[1])
    return calls


def quads(n: int = 5) -> tuple[Tensor, Topology]:
    """Warped quads over a bent grid."""
    x, y = torch.meshgrid(*(torch.arange(n, dtype=DOUBLE) - n // 2,) * 2, indexing="ij")
    x, y = x + 0.1 * torch.sin(2.0 * y), y + 0.1 * torch.sin(3.0 * x)
    vertices = torch.stack([x, y, 0.15 * (x**2 - y**2)], dim=-1).reshape(-1, 3)
    return vertices, Topology.from_faces(grid_faces(n, n))


def mostly_slow(phases: Iterable[str], *quick: str) -> list[object]:
    """Phases as parameters: all but the quick ones are marked slow."""
    return [pytest.param(phase, marks=() if phase in quick else pytest.mark.slow) for phase in phases]


FAIR = replace(FairSettings(), planar="none", projection=replace(FairSettings().projection, max_iterations=3))
FAIR_PHASES = {
    "start": ("job.recipe:one_start", 1, 0),
    "measuring the start": ("fair.recipe:fair_measures", 1, 0),
    "problem": ("fair.feature_curves:boundary_corners", 1, 0),
    "plan": ("fair.problem:FairProblem.shares", 1, 0),
    "first terms": ("fair.problem:FairProblem.terms", 1, 0),
    "first compiled": ("job.compiled_problems:GuidedProjection", 1, 0),
    "second terms": ("fair.problem:FairProblem.terms", 2, 1),
    "third compiled": ("job.compiled_problems:GuidedProjection.with_terms", 2, 2),
    "blocks in between": ("fair.problem:FairProblem.blocks", 2, 1),
    "measuring the result": ("fair.recipe:fair_measures", 2, 3),
}


@WAYS
@pytest.mark.parametrize("phase", FAIR_PHASES)
def test_lowering_e_keeps_the_stages_done(phase: str, act: Act, monkeypatch: pytest.MonkeyPatch) -> None:
    vertices, topology = quads()
    whole = minimise_normal_variation(vertices, topology, settings=FAIR)
    place, n, stages = FAIR_PHASES[phase]
    disturb(monkeypatch, place, n, act)
    result = minimise_normal_variation(vertices, topology, settings=FAIR)
    if stages == len(whole.preparation) + 1:  # it came too late to stop anything
        assert torch.equal(result.vertices, whole.vertices)
        assert (result.before, result.after) == (whole.before, whole.after)
        assert result.projection.status is whole.projection.status
        return
    runs = [*result.preparation, result.projection]
    done = [run for run in runs if run.iterations]
    assert len(done) == stages
    assert result.projection.status is Status.INTERRUPTED
    for run, other in zip(done, [*whole.preparation, whole.projection], strict=False):
        assert torch.equal(run.blocks["vertices"], other.blocks["vertices"])
    if not stages:
        torch.testing.assert_close(result.vertices, vertices, atol=1e-12, rtol=0)
        assert result.after["normal_variation"] == pytest.approx(result.before["normal_variation"])
    assert result.before == whole.before
    assert result.after["normal_variation"] <= result.before["normal_variation"] * (1.0 + 1e-12)
    assert result.projection.residuals[0].elements > 0


@WAYS
def test_an_interrupt_while_the_start_is_measured_does_again_just_that(
    act: Act, monkeypatch: pytest.MonkeyPatch
) -> None:
    """On large meshes every part takes seconds: the mesh is not prepared again, and a start that stays not measured."""
    counts = {place: count_calls(monkeypatch, place) for place in ("job.recipe:one_start", "fair.recipe:fair_measures")}
    disturb(monkeypatch, "fair.recipe:fair_measures", 1, act)
    vertices, topology = quads()
    result = minimise_normal_variation(vertices, topology, settings=replace(FAIR, boundary="fixed"))
    assert result.projection.status is Status.INTERRUPTED
    assert torch.equal(result.vertices, vertices)
    assert result.after == result.before
    measured = 1 + (act is stop)  # Ctrl-C waits until it is measured
    assert [len(calls) for calls in counts.values()] == [1, measured]


@WAYS
@pytest.mark.parametrize("boundary", ["fixed", "glide", "free"])
@pytest.mark.parametrize("phase", ["start", "measuring the start", "plan"])
def test_a_large_job_that_is_interrupted_before_its_first_step_is_not_set_up(
    phase: str, boundary: str, act: Act, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The start comes back as it was given, with its own measures, also where vertices would be put on curves."""
    vertices, topology = quads()
    settings = replace(FAIR, boundary=boundary)
    whole = minimise_normal_variation(vertices, topology, settings=settings)
    monkeypatch.setattr(unbegun, "_LARGE", vertices.numel())
    compiled = count_calls(monkeypatch, "job.compiled_problems:GuidedProjection")
    measured = count_calls(monkeypatch, "fair.recipe:fair_measures")
    disturb(monkeypatch, *FAIR_PHASES[phase][:2], act)
    result = minimise_normal_variation(vertices, topology, settings=settings)
    assert (len(compiled), len(measured)) == (0, 1 + (act is stop and phase == "measuring the start"))
    assert torch.equal(result.vertices, vertices)
    assert result.after == result.before == whole.before
    assert result.stopped
    assert result.holds
    assert result.steps == 0
    assert result.projection.status is Status.INTERRUPTED
    assert "not evaluated" in result.message
    assert result.projection.solver == "none"
    assert job_report(result, settings)["status"] is Status.INTERRUPTED


@WAYS
def test_a_large_job_that_is_interrupted_between_stages_keeps_those_done(
    act: Act, monkeypatch: pytest.MonkeyPatch
) -> None:
    vertices, topology = quads()
    whole = minimise_normal_variation(vertices, topology, settings=FAIR)
    monkeypatch.setattr(unbegun, "_LARGE", vertices.numel())
    compiled = count_calls(monkeypatch, "job.compiled_problems:GuidedProjection")
    disturb(monkeypatch, *FAIR_PHASES["blocks in between"][:2], act)
    result = minimise_normal_variation(vertices, topology, settings=FAIR)
    assert len(compiled) == 1
    done = [run for run in result.runs if run.iterations]
    assert torch.equal(done[-1].blocks["vertices"], whole.runs[0].blocks["vertices"])
    assert result.projection.status is Status.INTERRUPTED
    assert result.after["normal_variation"] < result.before["normal_variation"]


def test_in_another_thread_interrupts_that_are_raised_keep_the_stages_done(monkeypatch: pytest.MonkeyPatch) -> None:
    place, n, stages = FAIR_PHASES["third compiled"]
    disturb(monkeypatch, place, n, stop)
    results = []
    thread = threading.Thread(target=lambda: results.append(minimise_normal_variation(*quads(), settings=FAIR)))
    thread.start()
    thread.join()
    (result,) = results
    assert result.projection.status is Status.INTERRUPTED
    assert sum(run.iterations > 0 for run in [*result.preparation, result.projection]) == stages


def barrel() -> tuple[Tensor, Topology]:
    """A cylinder, bulged; the surface of least C is the cylinder."""
    mesh = principal_triangles(Cylinder(1.0, 2.0), 5, 12)
    x, y, z = mesh.vertices.unbind(1)
    t = (z - z.min()) / (z.max() - z.min())
    bulge = 1.0 + t * (1.0 - t)
    return torch.stack([x * bulge, y * bulge, z], 1), mesh.topology


FORM = replace(FormSettings(), boundary="glide", projection=replace(FormSettings().projection, max_iterations=3))
FORM_PHASES = {  # function, call, stages of the coarse level that are done (-1: all), whether the fine level is
    "start": ("job.recipe:one_start", 1, 0, False),
    "measuring the start": ("form.recipe:form_measures", 1, 0, False),
    "problem": ("form.recipe:FormProblem", 1, 0, False),
    "directions": ("form.problem:FormProblem.directions", 1, 0, False),
    "first terms": ("form.problem:FormProblem.height_terms", 1, 0, False),
    "first compiled": ("job.compiled_problems:GuidedProjection", 1, 0, False),
    "doubt": ("form.plan:FormPlan._is_doubtful", 1, 1, False),
    "second compiled": ("job.compiled_problems:GuidedProjection", 2, 1, False),
    "third compiled": ("job.compiled_problems:GuidedProjection.with_terms", 1, 2, False),
    "measuring the level": ("form.recipe:form_measures", 2, -1, False),
    "refinement": ("form.recipe:loop", 1, -1, False),
    "finer problem": ("form.recipe:FormProblem", 2, -1, False),
    "measuring the finer start": ("form.recipe:form_measures", 3, -1, False),
    "finer compiled": ("job.compiled_problems:GuidedProjection", 3, -1, False),
    "measuring the result": ("form.recipe:form_measures", 4, -1, True),
}


@pytest.fixture(scope="module")
def surfaces() -> list[JobResult[Level]]:
    """Of the barrel, undisturbed, without and with refinement."""
    return [minimise_absolute_curvature(*barrel(), levels=levels, settings=FORM) for levels in (0, 1)]


@WAYS
@pytest.mark.parametrize("phase", mostly_slow(FORM_PHASES, "start", "finer compiled", "measuring the level"))
def test_lowering_c_keeps_the_stages_and_levels_done(
    phase: str, act: Act, monkeypatch: pytest.MonkeyPatch, surfaces: list[JobResult[Level]]
) -> None:
    place, n, stages, fine = FORM_PHASES[phase]
    disturb(monkeypatch, place, n, act)
    vertices, topology = barrel()
    result = minimise_absolute_curvature(vertices, topology, levels=1, settings=FORM)
    assert result.before == surfaces[0].before
    if fine:  # it came too late to stop anything
        assert torch.equal(result.vertices, surfaces[1].vertices)
        assert (result.after, result.message) == (surfaces[1].after, surfaces[1].message)
        return
    assert result.projection.status is Status.INTERRUPTED
    assert result.topology.num_vertices == topology.num_vertices
    (level,) = result.levels
    done = [run for run in level.runs if run.iterations]
    assert len(done) == (len(surfaces[0].runs) if stages < 0 else stages)
    if stages < 0:
        assert torch.equal(result.vertices, surfaces[0].vertices)
        assert result.after == surfaces[0].after
    elif stages == 0:
        torch.testing.assert_close(result.vertices, vertices, atol=1e-12, rtol=0)
    else:
        assert result.after["total_absolute_curvature"] < result.before["total_absolute_curvature"]


@pytest.mark.parametrize("at", [0, 1])
def test_a_second_start_that_is_interrupted_does_not_replace_the_better_surface(
    at: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the coarse smoothings are in doubt, the last one is tried from the start."""
    vertices, topology = barrel()
    monkeypatch.setattr(FormPlan, "_is_doubtful", lambda *_: True)
    undisturbed = minimise_absolute_curvature(vertices, topology, settings=FORM)
    second = len(FORM.smoothings()) - 1  # stages with coarser smoothings
    starts: list[int] = []

    def stop_in_the_second(record: IterationRecord) -> None:
        starts.extend([1] * (record.iteration == 0))
        if len(starts) == second + 1 and record.iteration == at:
            raise KeyboardInterrupt

    result = minimise_absolute_curvature(vertices, topology, settings=FORM, callback=stop_in_the_second)
    assert len(result.runs) == second + 1
    assert result.projection.status is Status.INTERRUPTED
    assert len(undisturbed.runs) > second + 1
    found = result.after["total_absolute_curvature"]
    assert found < 0.9 * result.before["total_absolute_curvature"]


def torus() -> tuple[Tensor, PrincipalEdges, dict[int, list[float]]]:
    """A principal-symmetric mesh that is not quite one, with a handle far enough to be pulled in portions."""
    mesh = principal_triangles(Torus(2.0, 1.0), 10, 14, along="u")
    edges = principal_edges_of_lattice(mesh, "u").check()
    vertices = mesh.vertices + 0.02 * torch.sin(7.0 * mesh.vertices.roll(1, 1))
    return vertices, edges, {3: (1.9 * vertices[3]).tolist()}


def contents(design: SymmetricDesign) -> dict[str, object]:
    """Everything that an edit may change."""
    session = design.session
    pulls, sides = vars(session.recipe.pulls), vars(session.recipe.problem.sides)
    state = {"places": design.vertices, **session.state, **pulls, **sides}
    copies = {name: value.clone() if isinstance(value, Tensor) else value for name, value in state.items()}
    return {**copies, "runs": len(design.runs)}


def assert_equal(found: dict[str, object], expected: dict[str, object]) -> None:
    assert found.keys() == expected.keys()
    for name, value in found.items():
        other = expected[name]
        if isinstance(value, Tensor) and isinstance(other, Tensor):
            assert torch.equal(value, other), name
        elif isinstance(value, tuple) and isinstance(other, tuple):
            assert all(torch.equal(*pair) for pair in zip(value, other, strict=True)), name
        else:
            assert value == other, name


def edited() -> SymmetricDesign:
    """A design after its first edit, of a handle that is moved a little."""
    vertices, edges, handles = torus()
    design = SymmetricDesign(vertices, edges, handles=list(handles), settings=SymmetricSettings(rounds=1))
    design.move({3: (1.1 * vertices[3]).tolist()})
    return design


@pytest.fixture(scope="module")
def undisturbed() -> tuple[dict[str, object], dict[str, object]]:
    """What is in a design before and after its second edit."""
    design = edited()
    before = contents(design)
    design.move(torus()[2])
    return before, contents(design)


@pytest.mark.parametrize("at", [0, 1, 8, 18])
def test_a_callback_that_raises_leaves_a_design_as_it_was(
    at: int, undisturbed: tuple[dict[str, object], dict[str, object]]
) -> None:
    """Bit for bit, also in the next edit."""
    design, handles, records = edited(), torus()[2], []

    def fail(record: IterationRecord) -> None:
        records.append(record)
        if len(records) == at + 1:
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        design.move(handles, fail)
    assert_equal(contents(design), undisturbed[0])
    design.move(handles)
    assert_equal(contents(design), undisturbed[1])


SYMMETRIC = SymmetricSettings(rounds=2, most_steps=30)
SYMMETRIC_PHASES = {
    "handles": ("job.recipe:read_handles", 1, 0),
    "measuring the start": ("symmetric.recipe:symmetric_measures", 1, 0),
    "snapshot": ("symmetric.problem:SymmetricProblem.snapshot", 1, 0),
    "first decision": ("symmetric.plan:SymmetricPlan._decide", 1, 0),
    "first compiled": ("job.compiled_problems:GuidedProjection", 1, 0),
    "second compiled": ("job.compiled_problems:GuidedProjection", 2, 1),
    "second decision": ("symmetric.plan:SymmetricPlan._decide", 2, 1),
    "score": ("symmetric.plan:SymmetricPlan._score", 1, 1),
    "measuring the result": ("symmetric.recipe:symmetric_measures", 2, 1),
    "normals": ("symmetric.recipe:strip_normals", 1, 1),
    "refinement": ("symmetric.refinement:loop", 1, 1),
    "finer problem": ("symmetric.recipe:SymmetricProblem", 2, 1),
    "measuring the finer start": ("symmetric.recipe:symmetric_measures", 3, 1),
    "finer snapshot": ("symmetric.problem:SymmetricProblem.snapshot", 2, 1),
    "measuring the finer result": ("symmetric.recipe:symmetric_measures", 5, 2),
}


@pytest.fixture(scope="module")
def whole() -> JobResult[SymmetricLevel]:
    """Of the design below, undisturbed."""
    vertices, edges, handles = torus()
    return principal_symmetric(vertices, edges, handles=handles, levels=1, settings=SYMMETRIC)


@WAYS
@pytest.mark.parametrize(
    "phase", mostly_slow(SYMMETRIC_PHASES, "first compiled", "finer problem", "measuring the result")
)
def test_a_design_keeps_the_levels_done(
    phase: str, act: Act, monkeypatch: pytest.MonkeyPatch, whole: JobResult[SymmetricLevel]
) -> None:
    vertices, edges, handles = torus()
    place, n, done = SYMMETRIC_PHASES[phase]
    disturb(monkeypatch, place, n, act)
    result = principal_symmetric(vertices, edges, handles=handles, levels=1, settings=SYMMETRIC)
    assert len(result.levels) == max(done, 1)
    if done == 2:  # it came too late to stop anything
        assert not result.stopped
        assert torch.equal(result.vertices, whole.vertices)
        return
    assert result.stopped
    assert result.projection.status is Status.INTERRUPTED
    (level,) = result.levels
    if not done:
        torch.testing.assert_close(result.vertices, vertices, atol=1e-12, rtol=0)
        assert level.steps == 0
    assert result.before == whole.before
    (target,) = (torch.tensor(place, dtype=DOUBLE) for place in handles.values())
    away, at_first = (float((x[3] - target).norm()) for x in (result.vertices, vertices))
    assert away < at_first if done else away == pytest.approx(at_first)
    assert level.after["largest_handle_distance"] == pytest.approx(away)  # from the target asked for, not a portion
    if phase not in ("second compiled", "second decision", "score"):  # the level was finished
        assert not done or torch.equal(result.vertices, whole.levels[0].vertices)
