"""Solving in threads that come and go: a crash would end the process, so each test is one of its own."""

from __future__ import annotations

import os
import subprocess
import sys

import pytest
import torch

from torchfair._threads import allowed_threads, threads_for

PROGRAM = """
import threading
import torch
{before}

def solve(seed, results):
    import scipy.sparse as sp
    from torchfair.linear import choose_solver, factorise, MatrixSystem
    chain = MatrixSystem(sp.diags([[-1.0] * 999, [2.1] * 1000, [-1.0] * 999], [-1, 0, 1], format="csr"))
    right = torch.randn(1000, dtype=torch.float64, generator=torch.Generator().manual_seed(seed))
    solver = choose_solver("auto", chain)
    left = right - chain.product(factorise(chain, solver=solver).solve(right).values)
    results.append((solver.name, float(left.abs().max())))

results = []
for seed in range(3):
    thread = threading.Thread(target=solve, args=(seed, results))
    thread.start()
    thread.join()
together = [threading.Thread(target=solve, args=(seed, results)) for seed in range(3)]
for thread in together:
    thread.start()
for thread in together:
    thread.join()
assert len(results) == 6 and max(size for _, size in results) < 1e-10, results
print(*{{name for name, _ in results}})
"""


def run(before: str, **environment: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM.format(before=before)],
        capture_output=True,
        text=True,
        env={**os.environ, "OMP_NUM_THREADS": "1", **environment},
        check=False,
    )
    assert done.returncode == 0, (done.returncode, done.stderr[-2000:])
    return done.stdout.strip()


def test_threads_one_after_the_other_and_at_once() -> None:
    assert run("import torchfair.linear") in ("rslab", "scipy")


def test_a_library_that_is_first_imported_in_a_thread_takes_scipy() -> None:
    """The package rslab must be imported in the main thread; where it was not, it is left alone."""
    assert run("") == "scipy"


@pytest.mark.parametrize("unknowns", [10, 10**6])
def test_small_problems_run_on_one_thread_and_remember_how_many_are_allowed(unknowns: int) -> None:
    before = torch.get_num_threads()
    torch.set_num_threads(2)
    try:
        with threads_for(unknowns, torch.device("cpu")):
            assert torch.get_num_threads() == (1 if unknowns == 10 else 2)
            assert allowed_threads() == 2
            with threads_for(10, torch.device("cpu")):
                assert allowed_threads() == 2
        assert torch.get_num_threads() == 2
        torch.set_num_threads(1)
        assert allowed_threads() == 1
    finally:
        torch.set_num_threads(before)
