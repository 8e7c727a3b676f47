"""The assembled sparse system against dense linear algebra on the whole residual."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair.linear import ConjugateGradients, DenseQR, LinearSolver, PardisoDirect, RslabDirect, ScipyDirect
from torchfair.projection import ElementTerm, SmoothAbsolute, portions
from torchfair.projection.layout import Layout
from torchfair.projection.linear_system import LinearSystem
from torchfair.projection.system import Structure


def stretched(x: Tensor, length: Tensor) -> Tensor:
    return torch.linalg.vector_norm(x[1] - x[0]) - length


def aligned(x: Tensor, n: Tensor) -> Tensor:
    return torch.stack([torch.dot(n[0], x[1] - x[0]), torch.dot(n[0], n[0]) - 1.0])


def spring(x: Tensor) -> Tensor:
    return x[1] - x[0]


def coupled(s: Tensor, x: Tensor) -> Tensor:
    return s[0, 0] * s[1, 1] + x[0, 2]


def mixed_problem(fix: bool = False) -> tuple[dict[str, Tensor], list[ElementTerm], Structure]:
    """Three blocks of widths 3, 3 and 2, shared and repeated nodes, linear and reweighted terms."""
    vertices, topology = wavy_grid(5, 4)
    generator = torch.Generator().manual_seed(1)
    state = {
        "vertices": vertices,
        "normals": torch.randn(topology.num_faces, 3, dtype=DOUBLE, generator=generator),
        "slacks": torch.randn(7, 2, dtype=DOUBLE, generator=generator),
    }
    edges = topology.edges
    owners = torch.arange(topology.corners.shape[0]) % topology.num_faces
    pairs = torch.stack([torch.arange(7), torch.arange(7).roll(1)], 1)
    repeated = torch.tensor([[0, 0], [3, 5]])
    weights = torch.rand(edges.shape[0], dtype=DOUBLE, generator=generator)
    terms = [
        ElementTerm("length", stretched, [("vertices", edges)], (torch.ones_like(weights),), 2.0, weights),
        ElementTerm("normal", aligned, [("vertices", edges[owners % 9]), ("normals", owners[:, None])], weight=0.5),
        ElementTerm("spring", spring, [("vertices", edges[:6])], weight=3.0, linear=True),
        ElementTerm("flat", stretched, [("vertices", edges)], (torch.zeros_like(weights),), 1.5,
                    loss=SmoothAbsolute(0.1)),
        ElementTerm("coupled", coupled, [("slacks", pairs), ("vertices", pairs[:, :1])]),
        ElementTerm("repeated", coupled, [("slacks", repeated), ("vertices", repeated[:, :1])]),
    ]  # fmt: skip
    layout = Layout.of(state)
    fixed = {"vertices": torch.arange(20) < 4, "slacks": torch.rand(7, 2, generator=generator) < 0.3} if fix else {}
    return state, terms, Structure(layout, terms, layout.free_mask(fixed, torch.device("cpu")), DOUBLE)


def naive_system(state: dict[str, Tensor], terms: list[ElementTerm], free: Tensor) -> tuple[Tensor, Tensor]:
    """Residual vector and dense Jacobian by a Python loop over elements and whole-state autograd."""
    layout = Layout.of(state)
    flat = layout.flatten(state)

    def everything(x: Tensor) -> Tensor:
        blocks = layout.unflatten(x)
        rows = []
        for term in terms:
            for i in range(term.num_elements):
                local = [blocks[name][index[i]] for name, index in term.stencil]
                value = term.residual(*local, *(data[i] for data in term.data)).reshape(-1)
                weight = term.weight * (1.0 if term.element_weights is None else term.element_weights[i])
                with torch.no_grad():
                    root = term.loss.root(value[None])[0]
                rows.append(torch.as_tensor(weight).sqrt() * (root @ value if root.ndim else root * value))
        return torch.cat(rows)

    jacobian = torch.autograd.functional.jacobian(everything, flat)
    return everything(flat), jacobian * free


@pytest.mark.parametrize("fix", [False, True])
def test_system_equals_naive_assembly(fix: bool) -> None:
    state, terms, structure = mixed_problem(fix)
    system = structure.linearise(state)
    residual, jacobian = naive_system(state, terms, structure.free)
    normal = jacobian.T @ jacobian
    assert system.gradient.allclose(jacobian.T @ residual, atol=1e-12)
    assert system.diagonal.allclose(normal.diagonal(), atol=1e-12)
    pattern = structure.lower
    columns = np.repeat(np.arange(structure.num_unknowns), np.diff(pattern.offsets))
    lower = torch.zeros_like(normal)
    lower[pattern.rows, columns] = system.lower_values
    assert lower.allclose(normal.tril(), atol=1e-12)
    assert (system.jacobian.to_dense().T @ system.jacobian.to_dense()).allclose(normal, atol=1e-12)
    assert system.jacobian_transpose.to_dense().allclose(system.jacobian.to_dense().T)
    assert float(system.residual_vector.square().sum()) == pytest.approx(float(residual.square().sum()))
    vectors = torch.sin(torch.arange(2.0 * structure.num_unknowns, dtype=DOUBLE)).view(-1, 2)
    assert system.product(vectors).allclose(normal @ vectors, atol=1e-12)
    assert system.product(vectors[:, 0]).allclose(normal @ vectors[:, 0], atol=1e-12)


def test_elements_in_portions_are_all_elements(monkeypatch: pytest.MonkeyPatch) -> None:
    """No element is lost or counted twice where a portion ends."""
    state, _, _ = mixed_problem()
    systems = []
    for size in (10**6, 1):
        monkeypatch.setattr(portions, "_PORTION", size)
        with torch.no_grad():
            structure = mixed_problem(fix=True)[2]
            at = structure.evaluate(state)
            systems.append((at, structure.linearise(at)))
    (whole, one), (apart, other) = systems
    assert whole.merits.allclose(apart.merits, rtol=1e-14)
    torch.testing.assert_close(apart.values, whole.values, rtol=1e-13, atol=1e-14)
    torch.testing.assert_close(other.jacobians, one.jacobians, rtol=1e-13, atol=1e-14)
    torch.testing.assert_close(other.gradient, one.gradient, rtol=1e-12, atol=1e-13)
    step = torch.cos(torch.arange(1.0 * one.gradient.shape[0], dtype=DOUBLE))
    with torch.no_grad():
        torch.testing.assert_close(other.changes(step), one.changes(step), rtol=1e-12, atol=1e-13)


def test_diagonal_blocks_are_those_of_the_normal_matrix() -> None:
    state, terms, _ = mixed_problem()
    terms = [term for term in terms if term.name != "repeated"]
    layout = Layout.of(state)
    structure = Structure(layout, terms, layout.free_mask({}, torch.device("cpu")), DOUBLE)
    system = structure.linearise(state)
    _, jacobian = naive_system(state, terms, structure.free)
    normal = jacobian.T @ jacobian
    for name, blocks in system.diagonal_blocks.items():
        first, (count, width) = structure.layout.offset(name), structure.layout.sizes[name]
        for i in range(count):
            piece = slice(first + i * width, first + (i + 1) * width)
            assert blocks[i].allclose(normal[piece, piece], atol=1e-12)


def test_normal_pattern_is_sorted_lower_triangle_with_diagonal_first() -> None:
    _, _, structure = mixed_problem()
    pattern = structure.lower
    assert (pattern.rows[pattern.offsets[:-1]] == np.arange(structure.num_unknowns)).all()
    for start, end in zip(pattern.offsets[:-1], pattern.offsets[1:], strict=True):
        assert (np.diff(pattern.rows[start:end]) > 0).all()


SOLVERS = [DenseQR(), ScipyDirect(), ConjugateGradients(max_iterations=2000)]
SOLVERS += [solver() for solver in (RslabDirect, PardisoDirect) if solver.available()]


@pytest.mark.parametrize("solver", SOLVERS, ids=lambda s: s.name)
@pytest.mark.parametrize("fix", [False, True])
def test_every_solver_solves_the_damped_normal_equations(solver: LinearSolver, fix: bool) -> None:
    state, terms, structure = mixed_problem(fix)
    residual, jacobian = naive_system(state, terms, structure.free)
    damping = torch.linspace(0.1, 1.0, structure.num_unknowns, dtype=DOUBLE)
    expected = torch.linalg.solve(jacobian.T @ jacobian + torch.diag(damping), -jacobian.T @ residual)
    solver.prepare(structure)
    system = structure.linearise(state)
    solution = solver.factorise(system, damping).solve(-system.gradient, accuracy=1e-12)
    assert solution.values.allclose(expected, atol=1e-9)
    assert float((solution.values[~structure.free]).abs().sum()) == 0.0


def test_linear_terms_are_differentiated_once_and_stay_right() -> None:
    state, terms, structure = mixed_problem()
    structure.linearise(state)
    moved = {name: block + 0.1 for name, block in state.items()}
    system: LinearSystem = structure.linearise(moved)
    residual, jacobian = naive_system(moved, terms, structure.free)
    assert system.gradient.allclose(jacobian.T @ residual, atol=1e-12)


def test_closed_form_jacobian_replaces_differentiation() -> None:
    vertices, topology = wavy_grid()

    def derivative(x: Tensor, length: Tensor) -> Tensor:
        unit = (x[1] - x[0]) / torch.linalg.vector_norm(x[1] - x[0])
        return torch.cat([-unit, unit])

    lengths = torch.ones(topology.num_edges, dtype=DOUBLE)
    plain = ElementTerm("length", stretched, [("vertices", topology.edges)], (lengths,))
    closed = ElementTerm("length", stretched, [("vertices", topology.edges)], (lengths,), jacobian=derivative)
    for mine, other in zip(
        closed.linearised(closed.arguments({"vertices": vertices})),
        plain.linearised(plain.arguments({"vertices": vertices})),
        strict=True,
    ):
        assert mine.allclose(other, atol=1e-14)


def test_forward_mode_is_used_for_long_residuals_and_agrees() -> None:
    x = torch.randn(5, 1, 2, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))

    def powers(row: Tensor) -> Tensor:
        return torch.cat([row[0], row[0] ** 2, row[0] ** 3])

    from torchfair.projection.differentiation import differentiate

    values, jacobians = differentiate(powers, (x,), 1)
    assert values.shape == (5, 6)
    assert jacobians.shape == (5, 6, 2)
    assert jacobians.allclose(torch.func.vmap(torch.func.jacrev(powers))(x).flatten(2))
