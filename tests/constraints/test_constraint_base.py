"""Terms of any kind as a module: blocks, data, errors, and both uses of a constraint that a user writes."""

from __future__ import annotations

import re
from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from term_cases import CASES, moved
from torch import Tensor, nn

from torchfair import ShapeError, constraints
from torchfair.constraints import Closeness, Constraint, Handles, Planarity, TangentPlanes
from torchfair.geometry import ReferenceSurface, SplineCurves
from torchfair.projection import ElementTerm, OneSided, guided_projection
from torchfair.projection.problem import Problem
from torchfair.projection.steps import init

VERTICES, TOPOLOGY = wavy_grid(5, 5, triangles=True)
EDGES = TOPOLOGY.edges


def stretched(x: Tensor, length: Tensor) -> Tensor:
    return torch.linalg.vector_norm(x[1] - x[0]) - length


def lengths(**options: object) -> ElementTerm:
    return ElementTerm("length", stretched, [("vertices", EDGES)], (torch.ones(len(EDGES), dtype=DOUBLE),), **options)


def test_a_constraint_of_a_user_is_a_term_and_a_loss() -> None:
    """The solver and an optimiser of torch lead to edges of length one."""
    module = Constraint([lengths()])
    start = module(VERTICES).item()
    solved = guided_projection({"vertices": VERTICES}, module.terms(weight=5.0)).blocks["vertices"]
    parameter = nn.Parameter(VERTICES.clone())
    optimiser = torch.optim.Adam([parameter], lr=1e-2)
    for _ in range(200):
        optimiser.zero_grad()
        module(parameter).backward()
        optimiser.step()
    assert module(solved).item() < 1e-2 * start
    assert module(parameter).item() < 2e-2 * start


def test_weights_of_terms_and_elements_and_losses_count() -> None:
    shares = torch.linspace(0.0, 2.0, len(EDGES), dtype=DOUBLE)
    away = torch.linalg.vector_norm(VERTICES[EDGES[:, 0]] - VERTICES[EDGES[:, 1]], dim=1) - 1.0
    module = Constraint([lengths(weight=3.0, element_weights=shares), lengths(loss=OneSided())])
    first, second = 1.5 * shares * away**2, 0.5 * away.clamp_min(0.0) ** 2
    torch.testing.assert_close(module.per_element(VERTICES), torch.cat([first, second]))
    assert [residual.shape for residual in module.residuals(VERTICES)] == [(len(EDGES), 1)] * 2
    torch.testing.assert_close(module.residuals(VERTICES)[1][:, 0], away)
    assert [term.weight for term in module.terms(weight=2.0)] == [6.0, 2.0]
    assert list(module.state_dict()) == ["parts.0.length", "parts.0.element_weights", "parts.1.length"]


def test_a_merit_of_its_own_stands_for_the_loss() -> None:
    term = lengths(merit=lambda x, length: stretched(x, length).abs())
    module = Constraint([term])
    away = torch.linalg.vector_norm(VERTICES[EDGES[:, 0]] - VERTICES[EDGES[:, 1]], dim=1) - 1.0
    torch.testing.assert_close(module(VERTICES), away.abs().sum())


def test_any_block_of_any_width() -> None:
    heights = constraints.along_directions(lengths(), VERTICES, VERTICES.roll(1, 1))
    module = Constraint([heights])
    values = VERTICES[:, :1]
    torch.testing.assert_close(module(values), Constraint([lengths()])(VERTICES + values * VERTICES.roll(1, 1)))
    assert module(values.expand(2, -1, -1)).shape == (2,)


def test_no_terms_cost_nothing_and_can_be_differentiated() -> None:
    variable = VERTICES.clone().requires_grad_()
    for module in (
        Constraint(),
        Planarity(TOPOLOGY),
        Constraint([replace(lengths(), stencil=[("x", EDGES[:0])], data=())]),
    ):
        value = module(variable.expand(2, -1, -1))
        assert value.tolist() == [0.0, 0.0]
        value.sum().backward()
        assert module.per_element(variable).shape == (0,)
        assert module.residuals(variable) == module.terms() == []
    assert not variable.grad.any()


def test_gradients_flow_to_data_that_require_them() -> None:
    """Offsets from places that something else makes, that are learned, or that are replaced for each member."""
    chosen = torch.arange(3)
    targets = torch.zeros(3, 3, dtype=DOUBLE, requires_grad=True)
    Handles(chosen, 2.0 * targets)(VERTICES).backward()
    torch.testing.assert_close(targets.grad, -2.0 * VERTICES[:3])
    module = Handles(chosen, nn.Parameter(torch.zeros(3, 3, dtype=DOUBLE)))
    assert [name for name, _ in module.named_parameters()] == ["parts.0.target"]
    assert not module.terms()[0].arguments({"vertices": VERTICES})[1].requires_grad

    def value(target: Tensor) -> Tensor:
        return torch.func.functional_call(module, {"parts.0.target": target}, (VERTICES,))

    several = torch.stack([VERTICES[:3], VERTICES[:3] + 1.0])
    torch.testing.assert_close(torch.func.vmap(value)(several), torch.tensor([0.0, 4.5], dtype=DOUBLE))
    torch.testing.assert_close(torch.func.grad(value)(several[1]), torch.ones(3, 3, dtype=DOUBLE))


def test_data_whose_names_cannot_be_told_are_numbered() -> None:
    term = replace(lengths(), residual=lambda x, *data: stretched(x, *data))
    assert list(Constraint([term]).state_dict()) == ["parts.0.data0"]
    term = replace(
        lengths(), residual=lambda x, training: stretched(x, training)
    )  # a module has an attribute of that name
    assert list(Constraint([term]).state_dict()) == ["parts.0.data0"]


def test_states_replace_data() -> None:
    module, other = (Handles(torch.arange(3), scale * VERTICES[:3]) for scale in (1.0, 2.0))
    other.load_state_dict(module.state_dict())
    assert other(VERTICES).item() == 0.0
    assert torch.equal(other.terms()[0].data[0], VERTICES[:3])


def test_single_precision_data_serve_double_vertices_and_the_other_way() -> None:
    module = Constraint([lengths()])
    assert module(VERTICES.float()).dtype == torch.float32
    assert module.float()(VERTICES).dtype == DOUBLE
    assert module.state_dict()["parts.0.length"].dtype == torch.float32


@pytest.mark.parametrize("kind", [torch.float16, torch.bfloat16])
def test_half_precision_is_computed_in_single(kind: torch.dtype) -> None:
    module, rough = Constraint([lengths()]), VERTICES.to(kind)
    torch.testing.assert_close(module(rough), module(rough.float()), rtol=0.0, atol=0.0)


def test_overflow_is_no_degenerate_element() -> None:
    """In single precision products of four lengths of 1e13 are beyond its range."""
    vertices, topology = wavy_grid(4, 4)
    value = Planarity(topology)((1e13 * vertices).float())
    assert not (value.isfinite() and value < 1e20)


def test_anomaly_mode_finds_nothing_in_degenerate_elements() -> None:
    variable = torch.zeros(16, 3, dtype=DOUBLE, requires_grad=True)
    with pytest.warns(UserWarning, match="Anomaly Detection"), torch.autograd.detect_anomaly():
        Planarity(wavy_grid(4, 4)[1])(variable).backward()
    assert not variable.grad.any()


def test_one_degenerate_element_takes_none_along() -> None:
    vertices, topology = wavy_grid(4, 4)
    module = Planarity(topology)
    sound = module.per_element(vertices)
    vertices[topology.corners[:4]] = 0.0  # the corners of the first face
    variable = vertices.requires_grad_()
    found = module.per_element(variable)
    touched = torch.isin(topology.corners.view(-1, 4), topology.corners[:4]).any(1)
    torch.testing.assert_close(found[~touched], sound[~touched])
    assert found[0] == 0.0
    found[0].backward(retain_graph=True)
    assert not variable.grad.any()
    found.sum().backward()
    assert variable.grad.isfinite().all()
    assert variable.grad.any()


@pytest.mark.parametrize(
    ("terms", "message"),
    [
        (lengths(), "terms: expected a list of ElementTerm, got an ElementTerm"),
        ([[lengths()]], "terms[0]: expected an ElementTerm (unpack lists of them with *)"),
        ([lengths(), replace(lengths(), stencil=[("other", EDGES)])], "blocks among ['vertices'], got 'other'"),
        ([replace(lengths(), stencil=[("vertices", -EDGES)])], "indices in 0.."),
        ([replace(lengths(), stencil=EDGES)], "stencil: expected pairs of block name and indices"),
        ([replace(lengths(), data=(torch.ones(3),))], "data[0]: expected (56, ...), a row for each element"),
        ([lengths(weight=-1.0)], "weight: expected a finite number of at least 0"),
        ([lengths(element_weights=torch.ones(56))], "element_weights: expected torch.float64"),
    ],
)
def test_refuses_terms_that_make_no_constraint(terms: object, message: str) -> None:
    with pytest.raises(ShapeError, match=re.escape(message)):
        Constraint(terms)


@pytest.mark.parametrize("vertices", [VERTICES[:24], VERTICES[0], VERTICES.long(), [[0.0, 0.0, 0.0]]])
def test_refuses_vertices_that_do_not_fit(vertices: object) -> None:
    with pytest.raises(ShapeError, match="vertices: expected"):
        Constraint([lengths()])(vertices)


def test_errors_of_a_residual_name_the_term() -> None:
    with pytest.raises(ValueError, match="term 'length': its residual fails"):
        Constraint([replace(lengths(), residual=lambda x, length: x @ x)])(VERTICES)


def test_a_batch_is_nothing_for_a_term() -> None:
    with pytest.raises(ShapeError, match=r"term 'length', block 'vertices': expected \(n, 3\), of one member"):
        lengths().arguments({"vertices": VERTICES.expand(30, -1, -1)})


def test_tangent_planes_keep_no_graph() -> None:
    """Of a tensor that requires gradients nothing is kept, and what is found is constant."""
    planes = TangentPlanes(ReferenceSurface(VERTICES, TOPOLOGY))
    variable = moved(VERTICES).requires_grad_()
    assert not any(part.requires_grad for part in planes({"vertices": variable}))
    assert planes._asked is None
    planes({"vertices": variable.detach()})
    module = Constraint(constraints.closeness_terms(planes, torch.arange(25), weight=1.0))
    (gradient,) = torch.autograd.grad(module(variable), variable)
    feet = ReferenceSurface(VERTICES, TOPOLOGY).closest(variable.detach()).positions
    torch.testing.assert_close(gradient, variable.detach() - feet)


def test_feet_on_curves_keep_no_graph() -> None:
    feet = constraints.CurveFeet(
        SplineCurves([VERTICES[:5]], [False]), torch.arange(5), torch.zeros(5, dtype=torch.int64)
    )
    assert not feet({"vertices": moved(VERTICES).requires_grad_()}).positions.requires_grad
    assert feet._kept == []
    state = {"vertices": moved(VERTICES)}
    assert feet(state) is feet(state)


def test_every_member_of_a_batch_has_its_own_closest_points() -> None:
    surface = ReferenceSurface(VERTICES, TOPOLOGY)
    batch = torch.stack([moved(VERTICES), VERTICES + 3.0, VERTICES])
    distances = surface.closest(batch.flatten(0, 1)).distances.view(3, 25)
    torch.testing.assert_close(Closeness(surface, torch.arange(25))(batch), 0.5 * distances.square().sum(1))


@pytest.mark.parametrize("name", CASES)
def test_merit_and_model_agree_to_first_order(name: str) -> None:
    """For all terms, those with several blocks too: finite differences of the merit along random directions."""
    for state, terms in CASES[name](torch.device("cpu")):
        for term in terms:
            problem = Problem(state, [term])
            gradient = init(problem, state).linearised.system.gradient
            flat = problem.layout.flatten(state)

            def merit(unknowns: Tensor, problem: Problem = problem) -> Tensor:
                return problem.structure.evaluate(problem.layout.unflatten(unknowns)).merits[0]

            for seed in range(2):
                way = torch.randn(flat.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(seed))
                slope = (merit(flat + 1e-6 * way) - merit(flat - 1e-6 * way)) / 2e-6
                scale = 1.0 + gradient.norm()
                torch.testing.assert_close(slope, gradient @ way, rtol=1e-5, atol=1e-6 * float(scale))
