"""Elements that name one node several times: they are elements of the function of that node."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair.projection import ElementTerm, ProjectionSettings, guided_projection

SOLVERS = ["dense", "scipy", "cg", "auto"]
NODES, WIDTH, ROWS = 4, 3, 5


def combined(x: Tensor, matrices: Tensor, offset: Tensor) -> Tensor:
    """Sum of matrices times the nodes of an element, which differentiates anew in every step."""
    return torch.einsum("sij,sj->i", matrices, x) - offset


def damped_step(stencil: Tensor, matrices: Tensor, offsets: Tensor, damping: float, solver: str) -> Tensor:
    """(NODES, WIDTH) after one step from 0."""
    settings = ProjectionSettings(
        initial_damping=damping, damping_scale="identity", solver=solver, max_iterations=1, accuracy=1e-13
    )
    term = ElementTerm("combined", combined, [("x", stencil)], data=(matrices, offsets))
    blocks = {"x": torch.zeros(NODES, matrices.shape[-1], dtype=DOUBLE)}
    return guided_projection(blocks, [term], settings=settings).blocks["x"]


@pytest.mark.parametrize("solver", SOLVERS)
def test_the_sum_of_a_node_with_itself_is_twice_the_node(solver: str) -> None:
    """x + x = 6 and x + x + x = 6 are solved by x = 3 and x = 2 in one step."""
    for times, expected in ((2, 3.0), (3, 2.0)):
        ones = torch.ones(NODES, times, 1, 1, dtype=DOUBLE)
        stencil = torch.arange(NODES)[:, None].repeat(1, times)
        step = damped_step(stencil, ones, torch.full((NODES, 1), 6.0, dtype=DOUBLE), 1e-10, solver)
        assert step.ravel().tolist() == pytest.approx([expected] * NODES, abs=1e-8)


@pytest.mark.parametrize("solver", SOLVERS)
def test_steps_are_those_of_dense_linear_algebra(solver: str) -> None:
    """Some elements name a node twice or three times, in every position; others do not."""
    generator = torch.Generator().manual_seed(2)
    stencil = torch.tensor([[0, 0, 1], [2, 1, 2], [3, 0, 0], [1, 1, 1], [0, 2, 3], [3, 3, 2]])
    count, size = stencil.shape
    matrices = torch.randn(count, size, ROWS, WIDTH, dtype=DOUBLE, generator=generator)
    offsets = torch.randn(count, ROWS, dtype=DOUBLE, generator=generator)
    dense = torch.zeros(count, ROWS, NODES, WIDTH, dtype=DOUBLE)
    for element in range(count):
        for place in range(size):
            dense[element, :, stencil[element, place]] += matrices[element, place]
    dense = dense.reshape(count * ROWS, NODES * WIDTH)
    normal = dense.T @ dense + 0.1 * torch.eye(NODES * WIDTH, dtype=DOUBLE)
    expected = torch.linalg.solve(normal, dense.T @ offsets.ravel())
    step = damped_step(stencil, matrices, offsets, 0.1, solver)
    assert float((step.ravel() - expected).abs().max()) < 1e-10 * float(expected.abs().max())
