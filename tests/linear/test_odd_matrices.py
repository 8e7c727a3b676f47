"""Matrices and right-hand sides at the edge of what a linear solver is asked for."""

import numpy as np
import pytest
import scipy.sparse as sp
import torch

from torchfair.errors import ShapeError, SingularSystemError
from torchfair.linear import factorise

SOLVERS = ["dense", "scipy", "rslab", "cg"]


@pytest.fixture(params=SOLVERS)
def solver(request):
    if request.param == "rslab":
        pytest.importorskip("rslab")
    return request.param


def test_no_right_hand_side_has_no_solution(solver):
    right = torch.zeros(4, 0, dtype=torch.float64)
    assert factorise(sp.identity(4, format="csr"), solver=solver).solve(right).values.shape == (4, 0)


def test_a_matrix_without_entries_is_singular(solver):
    with pytest.raises(SingularSystemError):
        factorise(sp.csr_matrix((4, 4)), solver=solver).solve(torch.ones(4, dtype=torch.float64))


def test_a_matrix_without_entries_is_its_damping(solver):
    damping = torch.tensor([1.0, 2.0, 4.0], dtype=torch.float64)
    solution = factorise(sp.csr_matrix((3, 3)), damping, solver=solver).solve(damping).values
    torch.testing.assert_close(solution, torch.ones(3, dtype=torch.float64))


@pytest.mark.parametrize("matrix", [np.eye(3), [[1.0]], None, "identity"])
def test_what_is_no_matrix_is_refused(matrix):
    with pytest.raises(ShapeError, match="matrix"):
        factorise(matrix)
