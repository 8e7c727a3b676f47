"""Whether all residuals are zero: against the formula, with all elements at once and portion by portion."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair.projection import ElementTerm, GuidedProjection, SmoothAbsolute, portions
from torchfair.projection.vanishing import vanishing


def stretch(x: Tensor, length: Tensor) -> Tensor:
    return torch.stack([(x[1] - x[0]).square().sum() - length**2, (x[1] - x[0]).sum()])


def least_tolerance(vertices: Tensor, edges: Tensor, lengths: Tensor) -> float:
    """Relative change of all unknowns that makes residuals as large as they are, edge by edge."""
    size, residuals, changes = float(vertices.square().mean()), 0.0, 0.0
    for (a, b), length in zip(edges.tolist(), lengths, strict=True):
        pair = vertices[[a, b]]
        residuals += float(stretch(pair, length).square().sum())
        jacobian = torch.func.jacrev(lambda x, length=length: stretch(x, length))(pair)
        changes += size * float(jacobian.square().sum())
    return (residuals / changes) ** 0.5


@pytest.mark.parametrize("portion", [None, 2])
@pytest.mark.parametrize("loss", [None, SmoothAbsolute(0.1)])
def test_the_tolerance_at_which_residuals_count_as_zero(
    monkeypatch: pytest.MonkeyPatch, portion: int | None, loss: SmoothAbsolute | None
) -> None:
    if portion is not None:
        monkeypatch.setattr(portions, "_PORTION", portion)
    vertices, topology = wavy_grid(7, 6, triangles=True)
    edges = topology.edges
    lengths = torch.linspace(0.5, 1.5, len(edges), dtype=DOUBLE)
    weights = torch.linspace(0.1, 3.0, len(edges), dtype=DOUBLE)
    given = {} if loss is None else {"loss": loss}
    term = ElementTerm(
        "edges", stretch, [("vertices", edges)], data=(lengths,), weight=1e6, element_weights=weights, **given
    )
    state = {"vertices": vertices}
    with torch.no_grad():
        system = GuidedProjection(state, [term]).structure.linearise(state)
        least = least_tolerance(vertices, edges, lengths)
        assert vanishing(system, state, least * (1 + 1e-9)).tolist() == [True]
        assert vanishing(system, state, least * (1 - 1e-9)).tolist() == [False]


def too_long(x: Tensor, length: Tensor) -> Tensor:
    """Barriers that are silent at short edges."""
    return ((x[1] - x[0]).square().sum() - length**2).relu().square()[None]


def test_elements_that_are_not_felt_change_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(portions, "_PORTION", 2)
    vertices, topology = wavy_grid(7, 6, triangles=True)
    edges = topology.edges
    lengths = torch.linspace(0.5, 1.5, len(edges), dtype=DOUBLE)
    weights = torch.linspace(0.1, 3.0, len(edges), dtype=DOUBLE)
    term = ElementTerm(
        "long", too_long, [("vertices", edges)], data=(lengths,), element_weights=weights, silent=True, batched=False
    )
    state = {"vertices": vertices}
    with torch.no_grad():
        system = GuidedProjection(state, [term]).structure.linearise(state)
        assert system.felt[0] is not None
        assert 2 < len(system.felt[0]) < len(edges)
        chosen = edges[system.felt[0]]
        pairs = vertices[chosen]
        long = torch.func.vmap(too_long)(pairs, lengths[system.felt[0]])
        slopes = torch.func.vmap(torch.func.jacrev(too_long))(pairs, lengths[system.felt[0]])
        least = float((long.square().sum() / (vertices.square().mean() * slopes.square().sum())).sqrt())
        assert vanishing(system, state, least * (1 + 1e-9)).tolist() == [True]
        assert vanishing(system, state, least * (1 - 1e-9)).tolist() == [False]


def test_every_member_of_a_batch_is_looked_at_by_itself(monkeypatch: pytest.MonkeyPatch) -> None:
    """With portions that end within members."""
    monkeypatch.setattr(portions, "_PORTION", 5)
    vertices, topology = wavy_grid(7, 6, triangles=True)
    edges = topology.edges
    lengths = torch.linspace(0.5, 1.5, len(edges), dtype=DOUBLE)
    problem = GuidedProjection(
        {"vertices": vertices}, [ElementTerm("edges", stretch, [("vertices", edges)], data=(lengths,))]
    )
    members = [vertices, vertices * torch.tensor([5.0, 1.0, 1.0]), vertices * torch.tensor([1.0, 0.2, 3.0])]
    state, batch = {"vertices": torch.cat(members)}, problem.batched(len(members)).structure
    with torch.no_grad():
        system = batch.linearise(state)
        for number, member in enumerate(members):
            least = least_tolerance(member, edges, lengths)
            assert bool(vanishing(system, state, least * (1 + 1e-9))[number])
            assert not bool(vanishing(system, state, least * (1 - 1e-9))[number])
