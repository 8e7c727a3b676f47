"""Linear terms are condensed into one constant system: same results, checked declaration, nothing else needed."""

from __future__ import annotations

from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair import TorchfairError
from torchfair.projection import ElementTerm, GuidedProjection, ProjectionSettings, Status, affine, guided_projection


def spring(x: Tensor) -> Tensor:
    return x[1] - x[0]


def anchor(x: Tensor, place: Tensor) -> Tensor:
    return x[0] - place


def stretched(x: Tensor) -> Tensor:
    return torch.linalg.vector_norm(x[1] - x[0]) - 1.0


def springs_and_anchors(dtype: torch.dtype = DOUBLE) -> tuple[dict[str, Tensor], list[ElementTerm]]:
    """A net of springs with element weights, anchored at three vertices."""
    vertices, topology = wavy_grid(triangles=True)
    vertices = vertices.to(dtype)
    weights = torch.linspace(1.0, 2.0, topology.num_edges, dtype=dtype)
    held = torch.tensor([[0], [7], [29]])
    places = 3.0 * vertices[held[:, 0]] + 1.0
    terms = [
        ElementTerm("springs", spring, [("x", topology.edges)], weight=0.5, element_weights=weights, linear=True),
        ElementTerm("anchors", anchor, [("x", held)], data=(places,), weight=4.0, linear=True),
    ]
    return {"x": vertices}, terms


def dense_solution(blocks: dict[str, Tensor], terms: list[ElementTerm]) -> Tensor:
    """Minimiser of the two terms by dense linear algebra, written out by hand."""
    x, (springs, anchors) = blocks["x"], terms
    matrix, right = torch.zeros(30, 30, dtype=DOUBLE), torch.zeros(30, 3, dtype=DOUBLE)
    for (v, w), weight in zip(springs.stencil[0][1].tolist(), springs.element_weights.tolist(), strict=True):
        matrix[v, v] += 0.5 * weight
        matrix[w, w] += 0.5 * weight
        matrix[v, w] -= 0.5 * weight
        matrix[w, v] -= 0.5 * weight
    for v, place in zip(anchors.stencil[0][1][:, 0].tolist(), anchors.data[0], strict=True):
        matrix[v, v] += 4.0
        right[v] += 4.0 * place
    return torch.linalg.solve(matrix, right).to(x)


@pytest.mark.parametrize("solver", ["dense", "scipy", "cg", "auto"])
def test_linear_terms_alone_are_a_linear_system(solver: str) -> None:
    blocks, terms = springs_and_anchors()
    result = guided_projection(blocks, terms, settings=ProjectionSettings(solver=solver))
    assert result.blocks["x"].allclose(dense_solution(blocks, terms), atol=1e-6)
    assert sum(row.merit for row in result.residuals) == pytest.approx(result.merit, rel=1e-12)


def test_linear_terms_work_in_float32() -> None:
    blocks, terms = springs_and_anchors(torch.float32)
    for solver in ("dense", "scipy", "cg", "auto"):
        result = guided_projection(blocks, terms, settings=ProjectionSettings(solver=solver))
        assert result.blocks["x"].dtype == torch.float32
        assert result.blocks["x"].allclose(dense_solution(blocks, terms), atol=1e-2)


@pytest.mark.parametrize("solver", ["dense", "scipy", "cg"])
def test_declaring_a_term_linear_changes_nothing_but_speed(solver: str) -> None:
    blocks, linear = springs_and_anchors()
    edges = linear[0].stencil[0][1]
    bent = ElementTerm("length", stretched, [("x", edges)])
    mask = torch.zeros(30, 3, dtype=torch.bool)
    mask[3], mask[8, 1] = True, True
    settings = ProjectionSettings(max_iterations=4, solver=solver, accuracy=1e-10)
    fast = guided_projection(blocks, [bent, *linear], fixed={"x": mask}, settings=settings)
    plain = [replace(term, linear=False) for term in linear]
    slow = guided_projection(blocks, [bent, *plain], fixed={"x": mask}, settings=settings)
    assert fast.blocks["x"].allclose(slow.blocks["x"], atol=1e-8)
    assert torch.equal(fast.blocks["x"][mask], blocks["x"][mask])
    merits = [[record.merit for record in result.history] for result in (fast, slow)]
    assert merits[0] == pytest.approx(merits[1], rel=1e-9)


def test_term_that_is_not_linear_though_declared_so_is_named() -> None:
    blocks, terms = springs_and_anchors()
    bent = ElementTerm("bent", stretched, terms[0].stencil, linear=True)
    with pytest.raises(TorchfairError, match="'bent' is declared linear"):
        guided_projection(blocks, [*terms, bent])


def test_terms_without_elements_or_weight_count_for_nothing() -> None:
    blocks, terms = springs_and_anchors()
    none = torch.zeros(0, 2, dtype=torch.int64)
    empty = [ElementTerm("none", residual, [("x", none)], linear=linear)
             for residual, linear in ((stretched, False), (spring, True))]  # fmt: skip
    idle = replace(terms[0], name="idle", weight=0.0)
    assert guided_projection(blocks, [*empty, idle]).status is Status.ZERO_MERIT
    for solver in ("dense", "scipy", "cg"):
        settings = ProjectionSettings(solver=solver)
        alone = guided_projection(blocks, terms, settings=settings)
        among = guided_projection(blocks, [*empty, *terms, idle], settings=settings)
        assert torch.equal(alone.blocks["x"], among.blocks["x"])
        assert [row.elements for row in among.residuals[:1]] == [0]


@pytest.mark.parametrize("entries", [1, 7, 1 << 23])
def test_the_diagonal_is_summed_some_entries_at_a_time(entries: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(affine, "_ENTRIES", entries)
    part = GuidedProjection(*springs_and_anchors()).structure.affine
    assert part is not None
    assert part.jacobian.nnz > 7
    expected = torch.from_numpy(part.jacobian.toarray()).square().sum(0)
    torch.testing.assert_close(part.diagonal, expected, rtol=1e-14, atol=0)
