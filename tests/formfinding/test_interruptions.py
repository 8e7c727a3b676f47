"""Jobs interrupted in any phase: what was found until then comes back, whole and measured."""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import replace

import pytest
import torch
from helpers import DOUBLE, grid_faces
from interruptions import WAYS, nth
from torch import Tensor

from torchfair import Topology
from torchfair.formfinding import FairSettings, minimise_normal_variation
from torchfair.projection import Status

Act = Callable[[], None]


def disturb(monkeypatch: pytest.MonkeyPatch, place: str, n: int, act: Act) -> None:
    """Does ``act()`` within the n-th call of a function, such as ``form_problem:FormProblem.terms``."""
    module, path = place.split(":")
    owner: object = importlib.import_module(f"torchfair.formfinding.{module}")
    *owners, name = path.split(".")
    for part in owners:
        owner = getattr(owner, part)
    monkeypatch.setattr(owner, name, nth(getattr(owner, name), n, act, after=True))


def quads(n: int = 5) -> tuple[Tensor, Topology]:
    """Warped quads over a bent grid."""
    x, y = torch.meshgrid(*(torch.arange(n, dtype=DOUBLE) - n // 2,) * 2, indexing="ij")
    x, y = x + 0.1 * torch.sin(2.0 * y), y + 0.1 * torch.sin(3.0 * x)
    vertices = torch.stack([x, y, 0.15 * (x**2 - y**2)], dim=-1).reshape(-1, 3)
    return vertices, Topology.from_faces(grid_faces(n, n))


FAIR = replace(FairSettings(), planar="none", projection=replace(FairSettings().projection, max_iterations=3))
FAIR_PHASES = {
    "start": ("normal_variation:one_start", 1, 0),
    "problem": ("fair_problem:boundary_corners", 1, 0),
    "plan": ("fair_problem:FairProblem.shares", 1, 0),
    "first terms": ("fair_problem:FairProblem.terms", 1, 0),
    "first compiled": ("fair_stages:GuidedProjection", 1, 0),
    "second terms": ("fair_problem:FairProblem.terms", 2, 1),
    "third compiled": ("fair_stages:GuidedProjection.with_terms", 2, 2),
    "blocks in between": ("fair_problem:FairProblem.blocks", 2, 1),
    "measuring the result": ("normal_variation:fair_measures", 1, 3),
    "measuring the start": ("normal_variation:fair_measures", 2, 3),
}


@WAYS
@pytest.mark.parametrize("phase", FAIR_PHASES)
def test_lowering_e_keeps_the_stages_done(phase: str, act: Act, monkeypatch: pytest.MonkeyPatch) -> None:
    vertices, topology = quads()
    whole = minimise_normal_variation(vertices, topology, settings=FAIR)
    place, n, stages = FAIR_PHASES[phase]
    disturb(monkeypatch, place, n, act)
    result = minimise_normal_variation(vertices, topology, settings=FAIR)
    if stages == len(whole.preparation) + 1:  # it came too late to stop anything
        assert torch.equal(result.vertices, whole.vertices)
        assert (result.before, result.after) == (whole.before, whole.after)
        assert result.projection.status is whole.projection.status
        return
    runs = [*result.preparation, result.projection]
    done = [run for run in runs if run.iterations]
    assert len(done) == stages
    assert result.projection.status is Status.INTERRUPTED
    for run, other in zip(done, [*whole.preparation, whole.projection], strict=False):
        assert torch.equal(run.blocks["vertices"], other.blocks["vertices"])
    if not stages:
        torch.testing.assert_close(result.vertices, vertices, atol=1e-12, rtol=0)
        assert result.after["normal_variation"] == pytest.approx(result.before["normal_variation"])
    assert result.before == whole.before
    assert result.after["normal_variation"] <= result.before["normal_variation"] * (1.0 + 1e-12)
    assert result.projection.residuals[0].elements > 0
