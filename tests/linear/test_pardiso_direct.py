"""Pardiso behind the protocol: MKL itself where it is installed, and a stand-in that reads the same arguments."""

from __future__ import annotations

import ctypes
import gc
import threading
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp
import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair.errors import SingularSystemError
from torchfair.linear import PardisoDirect, ScipyDirect, factorise, pardiso_direct
from torchfair.projection import ElementTerm, GuidedProjection


class StandIn:
    """MKL's routine by dense factors: the upper triangle in compressed rows, indices from 0, positive definite."""

    def __init__(self) -> None:
        self.phases: list[int] = []
        self.factors: dict[int, np.ndarray] = {}
        self.threads: list[int] = []

    def MKL_Set_Num_Threads_Local(self, number: int) -> int:
        self.threads.append(number)
        return 0

    def pardiso(self, handle: Any, *rest: Any) -> None:
        one, one_, kind, phase, size, values, offsets, rows, _, number, settings, _, right, solution, error = rest
        phase, size, number = (argument._obj.value for argument in (phase, size, number))
        assert (one._obj.value, one_._obj.value, kind._obj.value) == (1, 1, 2)
        given = _read(settings, 64, np.int32)
        assert given[[0, 1, 34]].tolist() == [1, 2, 1]
        dtype = np.float32 if given[27] else np.float64
        self.phases.append(phase)
        if phase in (11, 22):
            starts = _read(offsets, size + 1, np.int32)
            entries = _read(values, starts[-1], dtype), _read(rows, starts[-1], np.int32), starts
            upper = sp.csr_matrix(entries, (size, size)).toarray()
            assert (np.tril(upper, -1) == 0).all()
            if phase == 22:
                try:
                    self.factors[handle.value] = np.linalg.cholesky(upper.T, upper=False)
                except np.linalg.LinAlgError:
                    error._obj.value = -4
        if phase == 33:
            factor = self.factors[handle.value]
            columns = _read(right, size * number, dtype).reshape(number, size).T
            answer = np.linalg.solve(factor.T, np.linalg.solve(factor, columns)).astype(dtype)
            _read(solution, size * number, dtype)[:] = answer.T.ravel()
        if phase == -1:
            self.factors.pop(handle.value, None)


def _read(pointer: ctypes.c_void_p, count: int, dtype: type) -> np.ndarray:
    kind = {np.int32: ctypes.c_int32, np.float32: ctypes.c_float, np.float64: ctypes.c_double}[dtype]
    return np.ctypeslib.as_array(ctypes.cast(pointer, ctypes.POINTER(kind)), (int(count),))


@pytest.fixture(params=["MKL", "stand-in"])
def library(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> StandIn | None:
    """The stand-in, None where MKL itself is used."""
    if request.param == "MKL":
        if not PardisoDirect.available():
            pytest.skip("mkl is an extra")
        return None
    stand_in = StandIn()
    monkeypatch.setattr(pardiso_direct, "_library", lambda: stand_in)
    return stand_in


def random_matrix(size: int = 60, seed: int = 0) -> sp.csr_matrix:
    root = sp.random(size, size, 0.05, random_state=seed, data_rvs=np.random.default_rng(seed).standard_normal)
    return sp.csr_matrix(root @ root.T + 0.1 * sp.identity(size))


def random_right(*shape: int) -> Tensor:
    return torch.randn(*shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))


def remainder(matrix: sp.csr_matrix, solution: Tensor, right: Tensor) -> float:
    return float(np.linalg.norm(matrix @ solution.numpy() - right.numpy()) / np.linalg.norm(right.numpy()))


@pytest.mark.parametrize("shape", [(60,), (60, 3), (60, 1)])
def test_solutions(library: StandIn | None, shape: tuple[int, ...]) -> None:
    matrix, right = random_matrix(), random_right(*shape)
    solver = PardisoDirect()
    solution = factorise(matrix, solver=solver).solve(right).values
    assert solution.shape == right.shape
    assert remainder(matrix, solution, right) < 2e-12
    assert solver.single


def test_no_right_hand_side(library: StandIn | None) -> None:
    assert factorise(random_matrix(), solver=PardisoDirect()).solve(random_right(60, 0)).values.shape == (60, 0)


def test_zero_is_solved_by_zero(library: StandIn | None) -> None:
    assert not factorise(random_matrix(), solver=PardisoDirect()).solve(torch.zeros(60, dtype=DOUBLE)).values.any()


@pytest.mark.parametrize("size", [1e-120, 1e-30, 1e60, 1e120])
def test_single_precision_holds_matrices_and_right_hand_sides_of_any_size(library: StandIn | None, size: float) -> None:
    scale = size ** np.linspace(-1.0, 1.0, 60)  # the condition of the scaled matrix is what counts
    matrix = sp.csr_matrix(sp.diags(scale) @ random_matrix() @ sp.diags(scale))
    solver = PardisoDirect()
    factor = factorise(random_matrix() * size, solver=solver)
    right = size * random_right(60)
    assert remainder(random_matrix() * size, factor.solve(right).values, right) < 2e-12
    known = random_right(60) / torch.from_numpy(scale)
    right = torch.from_numpy(matrix @ known.numpy())
    solution = factorise(matrix, solver=solver).solve(right).values * torch.from_numpy(scale)
    torch.testing.assert_close(solution, random_right(60), rtol=1e-3, atol=1e-3)


def test_double_precision_takes_over_for_bad_matrices(library: StandIn | None) -> None:
    chain = sp.diags([[-1.0] * 399, [2.0] * 400, [-1.0] * 399], [-1, 0, 1])
    matrix = sp.csr_matrix(chain @ chain + 1e-10 * sp.identity(400))
    solver = PardisoDirect()
    factor, right = factorise(matrix, solver=solver), random_right(400)
    assert remainder(matrix, factor.solve(right).values, right) < 1e-6
    assert not solver.single
    assert remainder(matrix, factorise(matrix, solver=solver).solve(right).values, right) < 1e-6


@pytest.mark.parametrize("shift", [-1.0, -100.0])
def test_indefinite_matrices_are_refused(library: StandIn | None, shift: float) -> None:
    damping = torch.full((60,), shift, dtype=DOUBLE)
    with pytest.raises(SingularSystemError, match="not positive definite"):
        factorise(random_matrix(), damping, solver=PardisoDirect())


def test_an_indefinite_matrix_with_a_positive_diagonal_is_refused(library: StandIn | None) -> None:
    with pytest.raises(SingularSystemError, match="pardiso: the matrix is not positive definite"):
        factorise(sp.csr_matrix(np.array([[1.0, 2.0], [2.0, 1.0]])), solver=PardisoDirect())


def test_an_older_factor_still_solves_its_own_matrix(library: StandIn | None) -> None:
    first, second, right = random_matrix(), 3.0 * random_matrix() + sp.identity(60), random_right(60)
    solver = PardisoDirect()
    old = factorise(first, solver=solver)
    new = factorise(sp.csr_matrix(second), solver=solver)
    for factor, matrix in ((new, second), (old, first), (new, second)):
        assert remainder(matrix, factor.solve(right).values, right) < 2e-12


def test_the_analysis_is_kept_and_given_back(monkeypatch: pytest.MonkeyPatch) -> None:
    stand_in, solver = StandIn(), PardisoDirect()
    monkeypatch.setattr(pardiso_direct, "_library", lambda: stand_in)
    right = random_right(60)
    for factor in (1.0, 2.0):
        factorise(factor * random_matrix(), solver=solver).solve(right)
    assert stand_in.phases.count(11) == 1
    assert stand_in.phases.count(22) == 2
    assert set(stand_in.threads) == {torch.get_num_threads(), 0}  # as many as torch has, then as before
    factorise(random_matrix(50), solver=solver)  # another pattern
    gc.collect()
    assert stand_in.phases.count(11) == 2
    assert stand_in.phases.count(-1) == 1
    del solver
    gc.collect()
    assert stand_in.phases.count(-1) == 2
    assert not stand_in.factors


def test_threads_do_not_take_each_others_factors(library: StandIn | None) -> None:
    solver, right, worst = PardisoDirect(), random_right(60), []
    matrices = [sp.csr_matrix(scale * random_matrix() + sp.identity(60)) for scale in (1.0, 2.0, 5.0)]
    factors = [factorise(matrix, solver=solver) for matrix in matrices]

    def solve(number: int) -> None:
        for _ in range(5):
            worst.append(remainder(matrices[number], factors[number].solve(right).values, right))

    threads = [threading.Thread(target=solve, args=(number,)) for number in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(worst) == 15
    assert max(worst) < 2e-12


def test_steps_are_those_of_other_solvers(library: StandIn | None) -> None:
    def bend(x: Tensor) -> Tensor:
        return x[0, 0] - 2.0 * x[1, 0] + x[2, 0] + 0.1 * x[1, 0] ** 2

    triples, every = torch.arange(38)[:, None] + torch.arange(3), torch.arange(40)[:, None]
    terms = [
        ElementTerm("bend", bend, [("x", triples)]),
        ElementTerm("held", lambda x: x[0, 0] - 1.0, [("x", every)], weight=0.1),
    ]
    start = {"x": random_right(40, 1)}
    results = [
        GuidedProjection(start, terms, solver=solver).solve(start) for solver in (PardisoDirect(), ScipyDirect())
    ]
    assert len(results[0].history) == len(results[1].history) > 2
    for one, other in zip(results[0].history, results[1].history, strict=True):
        assert one.merit == pytest.approx(other.merit, rel=1e-9)
    torch.testing.assert_close(*(result.blocks["x"] for result in results), rtol=0.0, atol=1e-9)


def test_without_the_library_the_remedy_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(pardiso_direct, "_library", lambda: None)
    assert not PardisoDirect.available()
    with pytest.raises(RuntimeError, match=r"pip install 'torchfair\[mkl\]'"):
        factorise(random_matrix(), solver=PardisoDirect())


def test_the_library_is_looked_for_in_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    class Place:
        def __init__(self, name: str) -> None:
            self.name = name

        def locate(self) -> str:
            return f"/nowhere/{self.name}"

    look = pardiso_direct._library.__wrapped__
    monkeypatch.setattr(pardiso_direct, "files", lambda name: [Place("mkl.txt"), Place("libmkl_rt.so.2")])
    assert look() is None  # cannot be loaded
    opened: list[str] = []
    monkeypatch.setattr(pardiso_direct.ctypes, "CDLL", lambda path: opened.append(path) or "library")
    assert look() == "library"
    assert opened == ["/nowhere/libmkl_rt.so.2"]

    def missing(name: str) -> None:
        raise pardiso_direct.PackageNotFoundError(name)

    monkeypatch.setattr(pardiso_direct, "files", missing)
    assert look() is None
