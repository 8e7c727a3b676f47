"""Behaviour of the damped iteration: monotone merit, statuses, fixed parts, interruption, batches."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair import ShapeError, Topology, TorchfairError
from torchfair.errors import SingularSystemError
from torchfair.linear import Factor, LowerTriangle, ScipyDirect, System
from torchfair.projection import (
    ElementTerm,
    GuidedProjection,
    IterationRecord,
    ProjectionSettings,
    SmoothAbsolute,
    Status,
    guided_projection,
)


def stretched(x: Tensor, length: Tensor) -> Tensor:
    return torch.linalg.vector_norm(x[1] - x[0]) - length


def length_term(topology: Topology, length: float = 1.0, **options: object) -> ElementTerm:
    lengths = torch.full((topology.num_edges,), length, dtype=DOUBLE)
    return ElementTerm("edge length", stretched, [("vertices", topology.edges)], (lengths,), **options)


@pytest.mark.parametrize("solver", ["dense", "scipy", "cg", "auto"])
def test_constraints_are_met_and_merit_never_rises(solver: str) -> None:
    vertices, topology = wavy_grid(triangles=True)
    result = guided_projection(
        {"vertices": vertices}, [length_term(topology)], settings=ProjectionSettings(solver=solver)
    )
    assert result.status.converged
    assert result.residuals[0].largest < 1e-6
    merits = [record.merit for record in result.history]
    assert merits == sorted(merits, reverse=True)
    assert result.history[0].merit > 1e-2


def test_fixed_unknowns_do_not_move_at_all() -> None:
    vertices, topology = wavy_grid(triangles=True)
    mask = torch.zeros(vertices.shape, dtype=torch.bool)
    mask[:5] = True
    mask[7, 2] = True
    result = guided_projection({"vertices": vertices}, [length_term(topology, 1.1)], fixed={"vertices": mask})
    moved = result.blocks["vertices"]
    assert torch.equal(moved[mask], vertices[mask])
    assert not torch.equal(moved[~mask], vertices[~mask])


def test_start_is_not_modified() -> None:
    vertices, topology = wavy_grid(triangles=True)
    copy = vertices.clone()
    guided_projection({"vertices": vertices}, [length_term(topology)])
    assert torch.equal(vertices, copy)


def test_result_does_not_depend_on_units() -> None:
    """Diagonal damping makes the iteration equivariant under scaling."""
    vertices, topology = wavy_grid(triangles=True)
    settings = ProjectionSettings(max_iterations=5)
    small = guided_projection({"vertices": vertices}, [length_term(topology)], settings=settings)
    large = guided_projection({"vertices": 1e3 * vertices}, [length_term(topology, 1e3)], settings=settings)
    assert (large.blocks["vertices"] / 1e3).allclose(small.blocks["vertices"], rtol=1e-9)


def test_smooth_absolute_loss_finds_the_median() -> None:
    """The minimiser of sum |x - a_i| is the median, of sum (x - a_i)^2 the mean."""
    places = torch.tensor([[0.0], [1.0], [2.0], [10.0], [50.0]], dtype=DOUBLE)
    stencil = [("x", torch.zeros(5, 1, dtype=torch.int64))]

    def off(x: Tensor, place: Tensor) -> Tensor:
        return x[0] - place

    start = {"x": torch.full((1, 1), 30.0, dtype=DOUBLE)}
    settings = ProjectionSettings(max_iterations=300, merit_tolerance=1e-14)
    absolute = ElementTerm("place", off, stencil, (places,), loss=SmoothAbsolute(1e-6))
    squares = ElementTerm("place", off, stencil, (places,))
    assert float(guided_projection(start, [absolute], settings=settings).blocks["x"]) == pytest.approx(2.0, abs=1e-4)
    assert float(guided_projection(start, [squares], settings=settings).blocks["x"]) == pytest.approx(12.6)


def test_refreshed_data_make_the_merit_a_function_of_the_state() -> None:
    """Closest points on the unit circle, refreshed at every state: the merit is the true distance."""

    def off(x: Tensor, foot: Tensor) -> Tensor:
        return x[0] - foot

    def feet(state: dict[str, Tensor]) -> tuple[Tensor]:
        return (state["x"] / torch.linalg.vector_norm(state["x"], dim=1, keepdim=True),)

    start = torch.tensor([[3.0, 1.0], [0.1, -0.2]], dtype=DOUBLE)
    term = ElementTerm("circle", off, [("x", torch.arange(2)[:, None])], refresh=feet)
    result = guided_projection({"x": start}, [term])
    assert torch.linalg.vector_norm(result.blocks["x"], dim=1).allclose(torch.ones(2, dtype=DOUBLE))
    radius = torch.linalg.vector_norm(start, dim=1)
    assert result.history[0].merit == pytest.approx(float(0.5 * (radius - 1).square().sum()))


def test_custom_merit_decides_acceptance() -> None:
    """A reweighted model with its own merit: the history holds that merit."""

    def model(x: Tensor) -> Tensor:
        return x[0]

    def true(x: Tensor) -> Tensor:
        return 0.5 * torch.log1p(x[0].square().sum())

    term = ElementTerm("log", model, [("x", torch.zeros(1, 1, dtype=torch.int64))], merit=true)
    result = guided_projection({"x": torch.full((1, 1), 2.0, dtype=DOUBLE)}, [term])
    assert result.history[0].merit == pytest.approx(0.5 * torch.log(torch.tensor(5.0)).item())
    assert result.merit < 1e-12


def test_infinite_residual_acts_as_a_wall() -> None:
    def toward(x: Tensor) -> Tensor:
        return x[0] + 5.0

    def wall(x: Tensor) -> Tensor:
        return torch.where(x[0] < 1.0, torch.inf, 0.0 * x[0])

    stencil = [("x", torch.zeros(1, 1, dtype=torch.int64))]
    result = guided_projection(
        {"x": torch.full((1, 1), 3.0, dtype=DOUBLE)},
        [ElementTerm("toward", toward, stencil), ElementTerm("wall", wall, stencil)],
    )
    assert 1.0 <= float(result.blocks["x"]) < 1.05


def test_guard_refuses_states() -> None:
    vertices, topology = wavy_grid(triangles=True)
    result = guided_projection({"vertices": vertices}, [length_term(topology)], guard=lambda state, trial: False)
    assert torch.equal(result.blocks["vertices"], vertices)
    assert not any(record.accepted for record in result.history[1:])


def test_callback_stops_and_sees_every_step() -> None:
    vertices, topology = wavy_grid(triangles=True)
    seen: list[IterationRecord] = []

    def stop_at_three(record: IterationRecord) -> bool:
        seen.append(record)
        return record.iteration == 3

    result = guided_projection(
        {"vertices": vertices},
        [length_term(topology)],
        callback=stop_at_three,
        observe=lambda state: {"height": float(state["vertices"][:, 2].max())},
    )
    assert result.status is Status.CALLBACK
    assert [record.iteration for record in seen] == [0, 1, 2, 3]
    assert seen == result.history
    assert seen[0].quantities["height"] == pytest.approx(float(vertices[:, 2].max()))
    assert "height" in seen[-1].as_dict()


def test_interruption_returns_the_best_state() -> None:
    vertices, topology = wavy_grid(triangles=True)

    def interrupt(record: IterationRecord) -> None:
        if record.iteration == 8:
            raise KeyboardInterrupt

    result = guided_projection({"vertices": vertices}, [length_term(topology)], callback=interrupt)
    assert result.status is Status.INTERRUPTED
    assert result.merit == min(record.merit for record in result.history) < result.history[0].merit
    assert sum(row.merit for row in result.residuals) == pytest.approx(result.merit)


def test_zero_residual_start_ends_at_once() -> None:
    vertices, topology = wavy_grid(triangles=True)
    lengths = torch.linalg.vector_norm(vertices[topology.edges[:, 1]] - vertices[topology.edges[:, 0]], dim=1)
    term = ElementTerm("edge length", stretched, [("vertices", topology.edges)], (lengths,))
    assert guided_projection({"vertices": vertices}, [term]).status is Status.ZERO_MERIT


def test_limits_end_the_iteration() -> None:
    vertices, topology = wavy_grid(triangles=True)
    few = ProjectionSettings(max_iterations=1)
    none = ProjectionSettings(time_limit=0.0)
    assert (
        guided_projection({"vertices": vertices}, [length_term(topology)], settings=few).status is Status.MAX_ITERATIONS
    )
    result = guided_projection({"vertices": vertices}, [length_term(topology)], settings=none)
    assert result.status is Status.TIME_LIMIT
    assert "time_limit" in result.message


def test_unknowns_no_term_feels_stay_and_do_no_harm() -> None:
    vertices, topology = wavy_grid(triangles=True)
    more = torch.cat([vertices, torch.ones(2, 3, dtype=DOUBLE)])
    for solver in ("dense", "scipy", "cg"):
        result = guided_projection(
            {"vertices": more}, [length_term(topology)], settings=ProjectionSettings(solver=solver)
        )
        assert result.residuals[0].largest < 1e-6
        assert torch.equal(result.blocks["vertices"][-2:], more[-2:])


class Reluctant(ScipyDirect):
    """Claims that the system is singular until the damping is large."""

    def __init__(self, needed: float) -> None:
        self.needed = needed

    def factorise(self, system: System, damping: Tensor) -> Factor:
        if float(damping.max()) < self.needed:
            raise SingularSystemError("singular")
        return super().factorise(system, damping)


def test_singular_system_raises_damping() -> None:
    vertices, topology = wavy_grid(triangles=True)
    settings = ProjectionSettings(solver=Reluctant(1.0), max_iterations=2)
    result = guided_projection({"vertices": vertices}, [length_term(topology)], settings=settings)
    assert result.history[1].accepted
    assert result.history[1].damping > settings.initial_damping


def test_hopeless_singular_system_names_the_term() -> None:
    vertices, topology = wavy_grid(triangles=True)
    settings = ProjectionSettings(solver=Reluctant(float("inf")))
    result = guided_projection({"vertices": vertices}, [length_term(topology)], settings=settings)
    assert result.status is Status.SINGULAR
    assert "edge length" in result.message
    assert torch.equal(result.blocks["vertices"], vertices)


def test_jacobian_that_is_not_finite_names_term_and_elements() -> None:
    """|x| has the derivative NaN under sqrt(x^2) at zero: the residual is finite, the Jacobian is not."""
    stencil = [("x", torch.tensor([[0], [1]]))]
    term = ElementTerm("root", lambda x: torch.sqrt(x[0] ** 2) + 1.0, stencil)
    with pytest.raises(TorchfairError, match=r"derivative of term 'root' is not finite at the start, elements \[1\]"):
        guided_projection({"x": torch.tensor([[1.0], [0.0]], dtype=DOUBLE)}, [term])


def test_start_that_is_not_finite_is_an_error() -> None:
    vertices, topology = wavy_grid(triangles=True)
    vertices[3, 1] = float("nan")
    with pytest.raises(TorchfairError, match=r"block 'vertices' is not finite in rows \[3\]"):
        guided_projection({"vertices": vertices}, [length_term(topology)])


def test_residual_that_is_not_finite_at_the_start_is_an_error() -> None:
    term = ElementTerm("log", lambda x: torch.log(x[0]), [("x", torch.tensor([[0], [1]]))])
    with pytest.raises(TorchfairError, match=r"term 'log' is not finite at the start, elements \[1\]"):
        guided_projection({"x": torch.tensor([[1.0], [-1.0]], dtype=DOUBLE)}, [term])


class Counting(ScipyDirect):
    """Counts symbolic analyses, of its copies too."""

    analyses = 0

    def analyse(self, lower: LowerTriangle) -> None:
        Counting.analyses += 1
        super().analyse(lower)


def test_starts_and_batches_share_the_analysis() -> None:
    vertices, topology = wavy_grid(10, 9, triangles=True)
    batch = torch.stack([vertices, vertices + 0.1 * torch.sin(vertices), 1.2 * vertices])
    problem = GuidedProjection({"vertices": vertices}, [length_term(topology)], solver=Counting())
    Counting.analyses = 0
    alone = [problem.solve({"vertices": member}) for member in batch]
    assert Counting.analyses == 1
    together = problem.solve_batch({"vertices": batch}, settings=ProjectionSettings(max_iterations=2))
    assert Counting.analyses == 1  # one member's is that of all
    assert [result.iterations for result in together] == [2, 2, 2]
    for member, result in zip(batch, alone, strict=True):
        fresh = guided_projection(
            {"vertices": member}, [length_term(topology)], settings=ProjectionSettings(solver="scipy")
        )
        assert torch.equal(fresh.blocks["vertices"], result.blocks["vertices"])


def test_float32_states_are_solved_in_float32() -> None:
    vertices, topology = wavy_grid(triangles=True)
    lengths = torch.ones(topology.num_edges)
    term = ElementTerm("edge length", stretched, [("vertices", topology.edges)], (lengths,))
    for solver in ("dense", "scipy", "cg", "auto"):
        result = guided_projection({"vertices": vertices.float()}, [term], settings=ProjectionSettings(solver=solver))
        assert result.blocks["vertices"].dtype == torch.float32
        assert result.residuals[0].largest < 1e-3


BAD_TERMS = {
    "unknown block": ({"stencil": [("points", torch.zeros(2, 2, dtype=torch.int64))]}, "blocks among"),
    "index outside": ({"stencil": [("vertices", torch.tensor([[0, 99]]))]}, "indices in 0..29"),
    "negative index": ({"stencil": [("vertices", torch.tensor([[0, -1]]))]}, "indices in 0..29"),
    "data of wrong length": ({"data": (torch.ones(3),)}, "data"),
    "negative weight": ({"weight": -1.0}, "weight"),
    "nan weight": ({"weight": float("nan")}, "weight"),
    "linear with refresh": ({"linear": True, "refresh": lambda state: ()}, "linear term"),
}


@pytest.mark.parametrize("name", BAD_TERMS)
def test_bad_terms_are_refused(name: str) -> None:
    vertices, _ = wavy_grid()
    change, message = BAD_TERMS[name]
    stencil = [("vertices", torch.zeros(2, 2, dtype=torch.int64))]
    options = {"name": "bad", "residual": lambda x: x[1] - x[0], "stencil": stencil}
    with pytest.raises(ShapeError, match=message):
        guided_projection({"vertices": vertices}, [ElementTerm(**{**options, **change})])


def test_bad_masks_blocks_and_settings_are_refused() -> None:
    vertices, topology = wavy_grid(triangles=True)
    term = length_term(topology)
    with pytest.raises(ShapeError, match="bool mask"):
        guided_projection({"vertices": vertices}, [term], fixed={"vertices": torch.ones(3, dtype=torch.bool)})
    with pytest.raises(ShapeError, match="block names"):
        guided_projection({"vertices": vertices}, [term], fixed={"normals": torch.ones(3, dtype=torch.bool)})
    with pytest.raises(ShapeError, match="at least one block and one term"):
        guided_projection({"vertices": vertices}, [])
    with pytest.raises(ShapeError, match="float64"):
        guided_projection({"vertices": vertices, "x": torch.zeros(2, 1)}, [term])
    with pytest.raises(ValueError, match="choose auto"):
        guided_projection({"vertices": vertices}, [term], settings=ProjectionSettings(solver="magic"))
    with pytest.raises(ValueError, match="damping_scale"):
        ProjectionSettings(damping_scale="none")
