"""What holds for every constraint as a module: the same laws as for energies, and the same merit as its terms."""

from __future__ import annotations

import copy
import inspect
import io
import math
import pickle

import pytest
import torch
from constraint_cases import CASES, Case
from helpers import DOUBLE, random_rotation
from torch import Tensor

from torchfair import MeshError, constraints
from torchfair.projection import OneSided, SmoothAbsolute, SmoothNuclearNorm, Squares
from torchfair.projection import symmetric_matrix as matrix_of
from torchfair.projection.problem import Problem
from torchfair.projection.steps import init

every = pytest.mark.parametrize("case", CASES.values(), ids=CASES.keys())


def test_there_is_a_case_for_every_public_module() -> None:
    public = {v for v in vars(constraints).values() if inspect.isclass(v) and issubclass(v, constraints.Constraint)}
    assert {type(case.module()) for case in CASES.values()} == public - {constraints.Constraint}


def cost_of(loss: object, residual: list[float]) -> float:
    """By the definitions of the losses."""
    if isinstance(loss, OneSided):
        return sum(max(r, 0.0) ** 2 for r in residual) / 2
    if isinstance(loss, SmoothAbsolute):
        return math.sqrt(sum(r * r for r in residual) + loss.epsilon**2) - loss.epsilon
    if isinstance(loss, SmoothNuclearNorm):
        values = torch.linalg.eigvalsh(matrix_of(torch.tensor(residual, dtype=DOUBLE)))
        return sum(math.sqrt(k * k + loss.epsilon**2) - loss.epsilon for k in values.tolist())
    assert isinstance(loss, Squares)
    return sum(r * r for r in residual) / 2


@every
def test_value_is_that_of_a_loop_over_elements(case: Case) -> None:
    vertices = case.vertices()
    total, costs = 0.0, []
    for term in case.terms(*case.mesh()):
        data = term.data if term.refresh is None else term.refresh({"vertices": vertices})
        for i in range(term.num_elements):
            one = slice(i, i + 1) if term.batched else i
            residual = term.residual(*(vertices[index[one]] for _, index in term.stencil), *(d[one] for d in data))
            costs.append(term.weight * cost_of(term.loss, residual.reshape(-1).tolist()))
        total = sum(costs)
    module = case.module()
    assert total > 1e-4  # or nothing is tried
    assert float(module(vertices)) == pytest.approx(total, rel=1e-9)
    assert module.per_element(vertices).tolist() == pytest.approx(costs, rel=1e-9, abs=1e-12)
    shapes = [values.shape[0] for values in module.residuals(vertices)]
    assert sum(shapes) == len(costs)


@every
def test_gradcheck(case: Case) -> None:
    module, variable = case.module(), case.vertices().requires_grad_()
    assert torch.autograd.gradcheck(module, variable, fast_mode=True, check_forward_ad=True)
    if not case.refreshed:
        assert torch.autograd.gradgradcheck(module, variable, fast_mode=True)


@every
def test_a_batch_is_a_loop_over_its_members(case: Case) -> None:
    module, vertices = case.module(), case.vertices()
    steps = torch.linspace(0.0, 0.04, 6, dtype=DOUBLE).view(2, 3, 1, 1)
    batch = vertices + steps * vertices.roll(1, 0).sin()
    for dtype in (torch.float32, DOUBLE):
        found = module(batch.to(dtype))
        assert found.shape == (2, 3)
        assert found.dtype == dtype
        expected = torch.stack([torch.stack([module(member) for member in row]) for row in batch.to(dtype)])
        torch.testing.assert_close(found, expected)
        torch.testing.assert_close(torch.func.vmap(torch.func.vmap(module))(batch.to(dtype)), expected)
    torch.testing.assert_close(module(batch.float()), module(batch).float(), rtol=2e-3, atol=1e-4)
    torch.testing.assert_close(module.per_element(batch).sum(-1), module(batch))
    assert module(batch[:, :0]).shape == (2, 0)
    for whole, one in zip(module.residuals(batch), module.residuals(batch[1, 2]), strict=True):
        torch.testing.assert_close(whole[1, 2], one)
        assert one.ndim == 2


@every
def test_motions_and_scales(case: Case) -> None:
    """With all data moved along; numbers of the value are then those of the scale alone."""
    vertices, *others = case.mesh()
    expected = case.make(vertices, *others)(case.vertices())
    scale, shift = 2.5, torch.tensor([0.3, -0.1, 0.2], dtype=DOUBLE)

    def move(points: Tensor) -> Tensor:
        return scale * points @ random_rotation(7).T + shift

    with pytest.MonkeyPatch.context() as patch:
        # What the cases disturb is disturbed as before.
        import constraint_cases

        still = constraint_cases.moved
        patch.setattr(
            constraint_cases, "moved", lambda points: move(still((points - shift) @ random_rotation(7) / scale))
        )
        module = case.make(move(vertices), *others)
    torch.testing.assert_close(module(move(case.vertices())), scale**case.power * expected, rtol=1e-7, atol=1e-9)


DEGENERATE = {
    "in one place": torch.zeros_like,
    "on a line": lambda v: v[:, :1] * torch.tensor([1.0, 2.0, -1.0], dtype=DOUBLE),
    "in a plane": lambda v: v * torch.tensor([1.0, 1.0, 0.0], dtype=DOUBLE),
    "on a lattice": lambda v: v.round(),
    "in pairs": lambda v: v[torch.arange(len(v)) // 2],
}


@every
@pytest.mark.parametrize("squeeze", DEGENERATE.values(), ids=DEGENERATE.keys())
def test_nothing_is_nan_where_elements_are_degenerate(case: Case, squeeze) -> None:
    module, variable = case.module(), squeeze(case.vertices()).requires_grad_()
    value = module(variable)
    (gradient,) = torch.autograd.grad(value, variable)
    _, along = torch.func.jvp(module, (variable.detach(),), (variable.detach().sin(),))
    assert not torch.isnan(value)
    assert gradient.isfinite().all()
    assert not torch.isnan(along)
    assert not any(residual.isnan().any() for residual in module.residuals(variable))


@every
def test_coordinates_that_are_nan_do_not_pass(case: Case) -> None:
    module, vertices = case.module(), case.vertices()
    vertices[module.parts[0].indices[0][0, 0]] = torch.nan
    if case.refreshed and not isinstance(module, constraints.Gliding | constraints.GoodSaddles):
        with pytest.raises(MeshError, match="finite"):  # by the search for closest points
            module(vertices)
    else:
        assert torch.isnan(module(vertices))


@every
def test_module_and_function_have_the_same_terms_and_merit(case: Case) -> None:
    vertices, module, terms = case.vertices(), case.module(), case.terms(*case.mesh())
    assert len(module.terms()) == len(terms)
    for term, other in zip(module.terms(weight=3.0), terms, strict=True):
        assert (term.name, term.weight, term.loss) == (other.name, 3.0 * other.weight, other.loss)
        assert all(map(torch.equal, (i for _, i in term.stencil), (i for _, i in other.stencil)))
    torch.testing.assert_close(constraints.Constraint(terms)(vertices), module(vertices))


@every
def test_merit_and_gradient_of_the_solver_are_those_of_the_module(case: Case) -> None:
    """And both are those that finite differences of the merit see."""
    module, vertices = case.module(), case.vertices()
    problem = Problem({"vertices": vertices}, module.terms(weight=2.0))
    structure = problem.structure

    def merit(points: Tensor) -> Tensor:
        return structure.evaluate({"vertices": points}).merits[0]

    torch.testing.assert_close(merit(vertices), 2.0 * module(vertices))
    gradient = init(problem, {"vertices": vertices}).linearised.system.gradient.view_as(vertices)
    used = module(vertices.requires_grad_()).mul(2.0)
    torch.testing.assert_close(gradient, torch.autograd.grad(used, vertices)[0], rtol=1e-6, atol=1e-8)
    for seed in range(3):
        way = torch.randn(vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(seed))
        step = 1e-6 * way
        slope = (merit(vertices.detach() + step) - merit(vertices.detach() - step)) / 2e-6
        torch.testing.assert_close(slope, (gradient * way).sum(), rtol=1e-5, atol=1e-6)


@every
def test_gradients_under_transforms(case: Case) -> None:
    module, vertices = case.module(), case.vertices()
    gradient = torch.func.grad(module)(vertices)
    batch = torch.stack([vertices, 1.01 * vertices])
    torch.testing.assert_close(torch.func.vmap(torch.func.grad(module))(batch)[0], gradient)
    torch.testing.assert_close(torch.func.jvp(module, (vertices,), (gradient,))[1], gradient.square().sum())


@pytest.mark.parametrize("case", [CASES[name] for name in ("handles", "planarity", "corner angles", "gliding")])
@pytest.mark.filterwarnings("ignore:Attempted to insert a get_attr Node:UserWarning")  # by torch itself
def test_transforms_nest(case: Case) -> None:
    module, vertices = case.module(), case.vertices()
    gradient = torch.func.grad(module)(vertices)
    torch.testing.assert_close(torch.func.jacfwd(module)(vertices), gradient)
    way = vertices.cos()
    forward_over_reverse = torch.func.jvp(torch.func.grad(module), (vertices,), (way,))[1]
    reverse = torch.func.grad(lambda v: (torch.func.grad(module)(v) * way).sum())(vertices)
    torch.testing.assert_close(forward_over_reverse, reverse)
    linear = torch.func.linearize(module, vertices)[1]
    torch.testing.assert_close(linear(way), (gradient * way).sum())
    hessian = torch.func.hessian(module)(vertices).flatten(2).flatten(0, 1)
    torch.testing.assert_close(hessian, torch.func.jacfwd(torch.func.jacfwd(module))(vertices).view_as(hessian))
    torch.testing.assert_close(hessian @ way.flatten(), reverse.flatten())


@every
def test_gradients_do_not_depend_on_what_was_asked_before(case: Case) -> None:
    """Nothing that is kept holds a graph or a gradient."""
    vertices = case.vertices()
    fresh = torch.func.grad(case.module())(vertices)
    module, variable = case.module(), vertices.clone().requires_grad_()
    (first,) = torch.autograd.grad(module(variable), variable)
    (second,) = torch.autograd.grad(module(variable), variable)
    with torch.no_grad():
        module(variable)
    (third,) = torch.autograd.grad(module(variable), variable)
    used = case.module()
    with torch.inference_mode():
        used(vertices)
    used(vertices)
    constant = torch.func.grad(used)(vertices)
    for gradient in (first, second, third, constant):
        torch.testing.assert_close(gradient, fresh, rtol=1e-12, atol=0.0)


@every
def test_copies_pickles_and_states(case: Case) -> None:
    module, vertices = case.module(), case.vertices()
    value = module(vertices)
    buffer = io.BytesIO()
    torch.save(module, buffer)
    buffer.seek(0)
    others = [copy.deepcopy(module), pickle.loads(pickle.dumps(module)), torch.load(buffer, weights_only=False)]
    for other in others:
        assert other(vertices).item() == value.item()
    state = module.state_dict()
    assert all(tensor.is_floating_point() for tensor in state.values())
    other = case.make(1.1 * case.mesh()[0], *case.mesh()[1:])
    if all(tensor.shape == other.state_dict()[key].shape for key, tensor in state.items()) and state:
        assert list(other.state_dict()) == list(state)
        other.load_state_dict(state)
        assert other.state_dict().keys() == state.keys()


@every
def test_dtype_conversions_leave_indices_alone(case: Case) -> None:
    module, vertices = case.module(), case.vertices()
    value = module(vertices)
    for convert in (lambda m: m.float(), lambda m: m.double(), lambda m: m.type(DOUBLE), lambda m: m.share_memory()):
        convert(module)
        torch.testing.assert_close(module(vertices), value, rtol=1e-5, atol=1e-6)
        assert module(vertices).dtype == DOUBLE
    assert module(vertices.half()).dtype == torch.float32


@every
def test_follows_to_a_device(case: Case, device: torch.device) -> None:
    module, vertices = case.module(), case.vertices()
    value = module(vertices)
    module.to(device)
    found = module(vertices.to(device))
    assert found.device == device
    torch.testing.assert_close(found.cpu(), value)


@pytest.mark.parametrize("case", [CASES[name] for name in ("handles", "planarity", "cospherical", "gliding")])
@pytest.mark.filterwarnings("ignore:The .grad attribute of a Tensor:UserWarning")  # torch, where a graph breaks
def test_compiles_with_its_backward(case: Case) -> None:
    """To one graph, but for data that are refreshed."""
    torch._dynamo.reset()
    module, variable = case.module(), case.vertices().requires_grad_()
    compiled = torch.compile(module, fullgraph=not case.refreshed, backend="aot_eager")
    value = compiled(variable)
    torch.testing.assert_close(value, module(variable))
    (gradient,) = torch.autograd.grad(value, variable)
    torch.testing.assert_close(gradient, torch.func.grad(module)(variable.detach()))
