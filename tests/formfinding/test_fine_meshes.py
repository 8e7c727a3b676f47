"""Fine meshes, all of whose edges are nearly flat: what counts as flat and fairness fall with them."""

from __future__ import annotations

import pytest
import torch
from helpers import wavy_grid

from torchfair.energies import normal_variation, normal_variation_per_edge
from torchfair.formfinding import FairRecipe, FairSettings, minimise_normal_variation
from torchfair.formfinding.fair import scales as of_fairness
from torchfair.formfinding.fair.problem import FairProblem
from torchfair.formfinding.job.pulls import Pulls
from torchfair.geometry import edge_lengths
from torchfair.projection import SmoothAbsolute
from torchfair.shapes import PrincipalParaboloid, icosphere, irregular_triangles


def factors(vertices: torch.Tensor, topology: object) -> tuple[float, float]:
    """Of smoothing and fairness of a mesh in its mean edge length."""
    vertices = vertices / edge_lengths(vertices, topology).mean()
    job = FairProblem(vertices, topology, None, Pulls(vertices), FairSettings())
    return job.scales.smoothing, job.scales.fairness


def test_coarse_meshes_are_left_alone_and_fine_ones_fall_in_proportion() -> None:
    coarse = icosphere(0)
    assert factors(coarse.vertices, coarse.topology) == (1.0, 1.0)
    found = []
    for level in (4, 5):
        fine = icosphere(level)
        scaled = fine.vertices / edge_lengths(fine.vertices, fine.topology).mean()
        mean = float(normal_variation_per_edge(scaled, fine.topology).mean())
        found.append(factors(fine.vertices, fine.topology))
        assert found[-1] == pytest.approx((min(1.0, mean / 0.05), min(1.0, mean / 0.4)), rel=1e-12)
        assert factors(1e-6 * fine.vertices, fine.topology) == pytest.approx(found[-1], rel=1e-9)
    assert found[1] == pytest.approx([0.5 * scale for scale in found[0]], rel=0.02)  # l* is halved


def test_flat_meshes_keep_some_smoothing_and_fairness() -> None:
    vertices, topology = wavy_grid(5, 4)
    flat = vertices * torch.tensor([1.0, 1.0, 0.0], dtype=vertices.dtype)
    assert factors(flat, topology) == (0.01, 0.01)


@pytest.mark.parametrize("bound", ["_SMOOTHED", "_FAIR"])
def test_they_lower_the_energy_of_a_shallow_saddle(bound: str, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = irregular_triangles(PrincipalParaboloid(0.12, -0.08), 250)

    def reached() -> float:
        job = minimise_normal_variation(mesh.vertices, mesh.topology)
        assert all(promise.holds for promise in job.promises)
        return float(normal_variation(job.vertices, mesh.topology))

    scaled = reached()
    monkeypatch.setattr(of_fairness, bound, 1e-9)
    assert scaled < 0.99 * reached()


def test_blunt_stages_of_large_meshes_are_no_blunter_than_a_quarter_of_the_mean(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    mesh = icosphere(3)
    vertices = mesh.vertices / edge_lengths(mesh.vertices, mesh.topology).mean()
    mean = float(normal_variation_per_edge(vertices, mesh.topology).mean())

    def smoothing(blur: float) -> float:
        job = FairProblem(vertices, mesh.topology, None, Pulls(vertices), FairSettings(smoothing=0.01))
        (term,) = (term for term in job.terms(1.0, blur) if term.name == "normal variation")
        assert isinstance(term.loss, SmoothAbsolute)
        return term.loss.epsilon

    sharp = smoothing(1.0)
    assert 0.04 * mean < sharp < 0.25 * mean
    assert smoothing(10.0) == pytest.approx(10.0 * sharp)
    monkeypatch.setattr(of_fairness, "_LARGE", len(vertices) + 1)
    assert smoothing(10.0) == pytest.approx(10.0 * sharp)
    monkeypatch.setattr(of_fairness, "_LARGE", len(vertices))
    assert smoothing(10.0) == pytest.approx(0.25 * mean)
    assert smoothing(1.5) == pytest.approx(1.5 * sharp)
    assert smoothing(1.0) == sharp
    monkeypatch.setattr(of_fairness, "_BLUNT", 1e-9)
    assert smoothing(10.0) == sharp


def test_blunt_stages_of_large_meshes_end_after_two_steps_that_gain_little(monkeypatch: pytest.MonkeyPatch) -> None:
    def patience() -> list[int]:
        mesh = icosphere(2)
        recipe = FairRecipe(mesh.vertices, mesh.topology)
        return [stage.settings.patience for stage in recipe.plan(recipe.state()).stages()]

    assert patience() == [6, 6, 6]
    monkeypatch.setattr(of_fairness, "_LARGE", 162)
    assert patience() == [2, 2, 6]


def fairness_weight(job: FairProblem, blur: float) -> float:
    """Of the fairness of a stage, along the boundary too."""
    (weight,) = {term.weight for term in job.terms(1.0, blur) if "fairness" in term.name}
    return weight


def test_fairness_falls_with_the_blur_from_its_weight_to_its_share_of_it() -> None:
    vertices, topology = wavy_grid(7, 6)
    vertices = torch.tensor([1.0, 1.0, 0.2], dtype=vertices.dtype) * vertices
    vertices = vertices / edge_lengths(vertices, topology).mean()
    job = FairProblem(vertices, topology, None, Pulls(vertices), FairSettings(fairness_weight=0.7))
    scale = job.fairness_scale
    assert 0.1 < scale < 0.3
    assert fairness_weight(job, 1.0) == pytest.approx(0.7 * scale)
    assert fairness_weight(job, 3.0) == pytest.approx(2.1 * scale)
    assert fairness_weight(job, 10.0) == 0.7


def test_fairness_counts_in_full_where_handles_leave_the_reference() -> None:
    vertices, topology = wavy_grid(7, 6)
    vertices = torch.tensor([1.0, 1.0, 0.2], dtype=vertices.dtype) * vertices
    vertices = vertices / edge_lengths(vertices, topology).mean()
    pulls = Pulls(vertices)
    job = FairProblem(vertices, topology, None, pulls, FairSettings(fairness_weight=0.7))
    handle = torch.tensor([24])
    for height, full in ((0.01, False), (2.0, True), (0.01, False)):
        pulls.pull(handle, vertices[handle] + torch.tensor([0.0, 0.0, height], dtype=vertices.dtype))
        job.reconsider()
        assert (fairness_weight(job, 1.0) == 0.7) == full


def test_the_printed_method_weighs_as_printed() -> None:
    vertices, topology = wavy_grid(7, 6)
    job = FairProblem(vertices, topology, None, Pulls(vertices), FairSettings.paper(w_fair=0.7))
    assert fairness_weight(job, 1.0) == 4.0 * 0.7
