"""Symmetric positive definite matrices from anywhere: every solver, one and many right-hand sides, clear refusals."""

from __future__ import annotations

import copy
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import scipy.sparse as sp
import torch
from torch import Tensor

from torchfair import ShapeError, _memory
from torchfair.errors import SettingsError, SingularSystemError
from torchfair.linear import (
    BlockByBlock,
    BlockDense,
    ConjugateGradients,
    Descending,
    LinearSolver,
    MatrixSystem,
    RslabDirect,
    ScipyDirect,
    Solution,
    choose,
    choose_solver,
    factorise,
)

SOLVERS = ["dense", "scipy", "cg", "auto", *(["rslab"] if RslabDirect.available() else [])]


def grid_laplacian(side: int = 7) -> sp.csr_matrix:
    """Of a square grid with Dirichlet boundary: symmetric, positive definite."""
    chain = sp.diags([-np.ones(side - 1), 2 * np.ones(side), -np.ones(side - 1)], [-1, 0, 1])
    return sp.csr_matrix(sp.kronsum(chain, chain))


FORMS: dict[str, Callable[[sp.csr_matrix], object]] = {
    "csr": lambda m: m,
    "csc": lambda m: m.tocsc(),
    "coo array": sp.coo_array,
    "torch csr": lambda m: torch.from_numpy(m.toarray()).to_sparse_csr(),
    "torch coo": lambda m: torch.from_numpy(m.toarray()).to_sparse(),
    "torch dense": lambda m: torch.from_numpy(m.toarray()),
}


@pytest.mark.filterwarnings("ignore:Sparse CSR tensor support")
@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("solver", SOLVERS)
def test_solutions_solve_whatever_form_the_matrix_has(form: str, solver: str) -> None:
    matrix = grid_laplacian()
    damping = torch.linspace(0.0, 1.0, 49, dtype=torch.float64)
    right = torch.randn(49, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    factor = factorise(FORMS[form](matrix), damping, solver=solver)
    dense = torch.from_numpy(matrix.toarray()) + torch.diag(damping)
    many, one = factor.solve(right), factor.solve(right[:, 0])
    torch.testing.assert_close(many.values, torch.linalg.solve(dense, right), atol=1e-8, rtol=0)
    torch.testing.assert_close(one.values, many.values[:, 0], atol=1e-8, rtol=0)
    assert one.remainder.shape == (49,)
    torch.testing.assert_close(dense @ many.values + many.remainder, right, atol=1e-8, rtol=0)


@pytest.mark.parametrize("solver", SOLVERS)
def test_diagonal_entries_that_are_not_stored_may_be_damped(solver: str) -> None:
    matrix = sp.csr_matrix(np.array([[0.0, 0.0], [0.0, 2.0]]))
    matrix.eliminate_zeros()
    solution = factorise(matrix, torch.tensor([4.0, 0.0], dtype=torch.float64), solver=solver)
    assert solution.solve(torch.tensor([1.0, 1.0], dtype=torch.float64)).values.tolist() == pytest.approx([0.25, 0.5])


def test_lower_triangle_and_its_full_matrix_agree() -> None:
    system = MatrixSystem(grid_laplacian(4))
    lower, values = system.lower, system.lower_values.numpy()
    full = lower.matrix(values) + sp.triu(lower.matrix(values).T, k=1)
    assert (full != grid_laplacian(4)).nnz == 0
    offsets, rows, source = lower.full
    difference = sp.csc_matrix((values[source], rows, offsets)) - grid_laplacian(4)
    assert abs(difference).sum() == 0.0
    assert (lower.rows[lower.diagonal] == np.arange(16)).all()


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("diagonal", [[1.0, -1.0, 2.0], [1.0, float("nan"), 1.0]], ids=["indefinite", "nan"])
def test_what_is_not_positive_definite_is_refused(solver: str, diagonal: list[float]) -> None:
    if solver == "scipy" and diagonal[1] == -1.0:
        pytest.skip("SuperLU does not tell the signs of its pivots")
    matrix = np.diag(diagonal)
    matrix[0, 2] = matrix[2, 0] = 0.5
    with pytest.raises(SingularSystemError):
        factorise(torch.from_numpy(matrix), solver=solver).solve(torch.ones(3, dtype=torch.float64))


@pytest.mark.parametrize("matrix", [torch.ones(2, 3), torch.ones(2, 2, dtype=torch.int64), sp.identity(2, dtype=int)])
def test_other_things_than_square_floating_matrices_are_refused(matrix: object) -> None:
    with pytest.raises(ShapeError, match="square matrix of floating numbers"):
        factorise(matrix)


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize(
    ("right", "given"),
    [
        (torch.ones(48, dtype=torch.float64), r"\(49,\) or \(49, k\).*\(49, 49\), got \(48,\)"),
        (torch.ones(1, 49, dtype=torch.float64), r"got \(1, 49\)"),
        (torch.ones(49, 1, 1, dtype=torch.float64), r"got \(49, 1, 1\)"),
        (torch.ones(49, dtype=torch.int64), r"floating numbers .* torch.int64"),
        (np.ones(49), "NumPy array"),
    ],
)
def test_other_right_hand_sides_are_refused_with_both_lengths(solver: str, right: object, given: str) -> None:
    factor = factorise(grid_laplacian(), solver=solver)
    with pytest.raises(ShapeError, match=f"right-hand side.*{given}"):
        factor.solve(right)


@pytest.mark.parametrize("solver", SOLVERS)
def test_right_hand_sides_in_single_precision_have_solutions_in_single_precision(solver: str) -> None:
    right = torch.linspace(0.0, 1.0, 49)
    values = factorise(grid_laplacian(), solver=solver).solve(right, 1e-8).values
    assert values.dtype == torch.float32
    expected = torch.linalg.solve(torch.from_numpy(grid_laplacian().toarray()).float(), right)
    torch.testing.assert_close(values, expected, atol=1e-5, rtol=0)


@pytest.mark.parametrize("damping", [torch.ones(48), torch.ones(49, dtype=torch.int64), 1.0])
def test_other_dampings_are_refused(damping: object) -> None:
    with pytest.raises(ShapeError, match=r"damping: expected .*\(49,\)"):
        factorise(grid_laplacian(), damping)


def test_unknown_solvers_are_refused_with_the_known_ones() -> None:
    with pytest.raises(SettingsError, match="choose auto, dense, scipy"):
        factorise(grid_laplacian(), solver="magic")


def test_columns_of_conjugate_gradients_are_as_accurate_as_asked_each() -> None:
    """One easy and one hard right-hand side: neither stops the other early, the easy one is not spoilt."""
    matrix = grid_laplacian()
    eigenvector = torch.from_numpy(np.linalg.eigh(matrix.toarray())[1][:, 0].copy())
    hard = torch.randn(49, dtype=torch.float64, generator=torch.Generator().manual_seed(1))
    right = torch.stack([eigenvector, torch.zeros_like(hard), hard], 1)
    for accuracy in (1e-2, 1e-6):
        solution = factorise(matrix, solver="cg").solve(right, accuracy)
        sizes, bounds = solution.remainder.norm(dim=0), accuracy * right.norm(dim=0)
        assert (sizes <= bounds).all()
        exact = right - torch.from_numpy(matrix.toarray()) @ solution.values
        torch.testing.assert_close(exact, solution.remainder, atol=1e-12, rtol=0)
    assert 1 < factorise(matrix, solver="cg").solve(hard, 1e-6).iterations < 49


class Counting(ConjugateGradients):
    """An own solver: knows nothing but the protocol."""

    prepared = 0

    def prepare(self, pattern: object) -> None:
        self.prepared += 1


def test_an_own_solver_is_used() -> None:
    solver = Counting()
    right = torch.ones(49, dtype=torch.float64)
    values: Tensor = factorise(grid_laplacian(), solver=solver).solve(right, 1e-10).values
    torch.testing.assert_close(torch.from_numpy(grid_laplacian().toarray()) @ values, right, atol=1e-8, rtol=0)
    assert solver.prepared == 1


BLOCK_SOLVERS: dict[str, Callable[[Tensor], LinearSolver]] = {
    "dense": BlockDense,
    "scipy": lambda unknowns: BlockByBlock(unknowns, ScipyDirect()),
}
if RslabDirect.available():
    BLOCK_SOLVERS["rslab"] = lambda unknowns: BlockByBlock(unknowns, RslabDirect())


@pytest.mark.parametrize("blocks", BLOCK_SOLVERS)
def test_blocks_are_solved_as_the_whole_matrix_is(blocks: str) -> None:
    """Two blocks whose unknowns alternate, in another order in each."""
    solver = BLOCK_SOLVERS[blocks]
    generator = torch.Generator().manual_seed(0)
    unknowns = torch.tensor([[0, 2, 4, 6], [5, 1, 7, 3]])
    matrix = torch.zeros(8, 8, dtype=torch.float64)
    for rows in unknowns:
        half = torch.randn(4, 4, dtype=torch.float64, generator=generator)
        matrix[rows[:, None], rows] = half @ half.T
    damping = torch.linspace(0.1, 0.8, 8, dtype=torch.float64)
    right = torch.randn(8, 3, dtype=torch.float64, generator=generator)
    factor = factorise(matrix, damping, solver=solver(unknowns))
    expected = torch.linalg.solve(matrix + torch.diag(damping), right)
    torch.testing.assert_close(factor.solve(right).values, expected, atol=1e-10, rtol=0)
    torch.testing.assert_close(factor.solve(right[:, 1]).values, expected[:, 1], atol=1e-10, rtol=0)
    if blocks == "scipy":
        return  # SuperLU does not tell the signs of its pivots
    with pytest.raises(SingularSystemError, match="2 blocks of the matrix are not positive definite"):
        factorise(matrix, -100.0 * damping, solver=solver(unknowns))
    damping[unknowns[1]] *= -100.0
    with pytest.raises(SingularSystemError) as caught:
        factorise(matrix, damping, solver=solver(unknowns))
    assert caught.value.blocks == (1,)


def test_factors_of_dense_blocks_that_are_still_used_keep_their_numbers() -> None:
    """Memory is taken again only when the factor is gone, also by a copy of the solver."""
    solver, right = BlockDense(torch.arange(4).view(2, 2)), torch.ones(4, dtype=torch.float64)
    first = factorise(2.0 * torch.eye(4, dtype=torch.float64), solver=solver)
    for other in (solver, copy.copy(solver)):
        factorise(8.0 * torch.eye(4, dtype=torch.float64), solver=other)
        assert first.solve(right).values.tolist() == pytest.approx([0.5] * 4)


@pytest.mark.parametrize("solver", SOLVERS)
def test_a_solver_that_is_used_again_sees_that_entries_are_elsewhere(solver: str) -> None:
    """Two patterns with as many entries: couplings (0, 1) and (0, 2)."""
    matrices = [2.0 * torch.eye(3, dtype=torch.float64) for _ in range(2)]
    matrices[0][0, 1] = matrices[0][1, 0] = matrices[1][0, 2] = matrices[1][2, 0] = 1.0
    chosen = choose_solver(solver, MatrixSystem(matrices[0]))
    right = torch.tensor([1.0, 2.0, 3.0], dtype=torch.float64)
    for matrix in (*matrices, matrices[0]):
        values = factorise(matrix, solver=chosen).solve(right, 1e-12).values
        torch.testing.assert_close(matrix @ values, right, atol=1e-10, rtol=0)


@pytest.mark.parametrize(
    ("size", "device", "rslab", "name"),
    [
        (120, "cpu", True, "dense"),
        (120, "cuda", True, "dense"),
        (121, "cpu", True, "rslab"),
        (121, "cpu", False, "scipy"),
        (121, "cuda", True, "conjugate gradients"),
        (200_000, "cpu", True, "rslab"),
        (200_001, "cpu", True, "conjugate gradients"),
        (30_000, "cpu", False, "scipy"),
        (30_001, "cpu", False, "conjugate gradients"),
    ],
)
def test_the_choice_follows_size_device_and_what_is_installed(
    monkeypatch: pytest.MonkeyPatch, size: int, device: str, rslab: bool, name: str
) -> None:
    monkeypatch.setattr(RslabDirect, "available", staticmethod(lambda: rslab))
    monkeypatch.setattr(choose, "available_memory", lambda: None)
    pattern = SimpleNamespace(num_unknowns=size, device=torch.device(device))
    assert choose_solver("auto", pattern).name == name


@pytest.mark.parametrize(("rslab", "size", "gigabytes"), [(True, 200_000, 5.7), (False, 30_000, 1.8)])
def test_no_factorisation_is_chosen_that_does_not_fit_in_memory(
    monkeypatch: pytest.MonkeyPatch, rslab: bool, size: int, gigabytes: float
) -> None:
    """Half of what is left has to be enough; below it the matrix is never formed."""
    monkeypatch.setattr(RslabDirect, "available", staticmethod(lambda: rslab))
    pattern = SimpleNamespace(num_unknowns=size, device=torch.device("cpu"))
    for share, name in ((1.0, "rslab" if rslab else "scipy"), (0.98, "conjugate gradients")):
        monkeypatch.setattr(choose, "available_memory", lambda share=share: int(share * gigabytes * 1e9))
        assert choose_solver("auto", pattern).name == name


def test_memory_that_is_left_is_less_than_there_is(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    """In a container what that leaves counts; a limit that is none, or no files at all, count for nothing."""
    files = {name: tmp_path / name for name in ("system", "most", "taken")}
    monkeypatch.setattr(_memory, "_SYSTEM", files["system"])
    monkeypatch.setattr(_memory, "_GROUP", (files["most"], files["taken"]))
    files["system"].write_text("MemTotal: 9000 kB\nMemAvailable:  5000 kB\n")
    assert _memory.available_memory() == 5000 * 1024
    files["most"].write_text("4000000\n")
    files["taken"].write_text("1000000\n")
    assert _memory.available_memory() == 3_000_000
    files["most"].write_text("max\n")
    assert _memory.available_memory() == 5000 * 1024


def test_descending_stops_where_the_quadratic_hardly_falls_any_more() -> None:
    """On a damped chain nine tenths of the fall take half the iterations of a remainder as small as asked for."""
    size = 400
    matrix = sp.diags([[-1.0] * (size - 1), [2.0] * size, [-1.0] * (size - 1)], [-1, 0, 1]).tocsr()
    factor = factorise(matrix, torch.full((size,), 1e-2, dtype=torch.float64), solver="cg")
    assert isinstance(factor, Descending)
    right = torch.from_numpy(np.random.default_rng(3).standard_normal((size, 2)))
    rough, whole, exact = factor.descend(right, 0.01), factor.solve(right, 0.01), factor.solve(right, 1e-10)
    assert rough.iterations < 0.5 * whole.iterations
    torch.testing.assert_close(rough.remainder.norm(dim=0) > 0.01 * right.norm(dim=0), torch.ones(2, dtype=torch.bool))

    def falls(solution: Solution) -> torch.Tensor:
        return 0.5 * (solution.values * (right + solution.remainder)).sum(0)

    assert bool((falls(rough) > 0.8 * falls(exact)).all())
    torch.testing.assert_close(falls(factor.descend(right, 1e-8)), falls(exact), rtol=1e-6, atol=0.0)
