"""The job that removes noise."""

from __future__ import annotations

import math
from typing import Any

import pytest
import torch
from helpers import DOUBLE, random_rotation
from noisy_meshes import angles, box, noisy

from torchfair import MeshError
from torchfair.energies import normal_variation
from torchfair.errors import SettingsError
from torchfair.formfinding import DenoiseRecipe, DenoiseSettings, Session, denoise
from torchfair.formfinding.denoise.measures import volume
from torchfair.formfinding.denoise.unfolding import Sides
from torchfair.geometry import dual_edge_lengths, edge_lengths
from torchfair.normalisation import Normalisation
from torchfair.shapes import Paraboloid, Sphere, irregular_triangles


@pytest.mark.parametrize("kind", ["normal", "all"])
def test_a_box_gets_flat_faces_and_sharp_edges(kind: str) -> None:
    clean = box(14)
    start = noisy(clean, kind, 0.3)
    result = denoise(start, clean[1])
    assert angles(start, clean).mean() > 25.0
    assert angles(result.vertices, clean).mean() < 5.0
    assert volume(result.vertices, clean[1]) == pytest.approx(1.0, abs=0.01)
    assert result.holds
    assert result.after["flipped_faces"] == 0
    assert 0.85 < result.after["rms_displacement_over_noise"] < 1.2
    assert result.after["volume"] == pytest.approx(volume(result.vertices, clean[1]))
    assert result.after["normal_variation"] < 0.5 * result.before["normal_variation"]
    assert result.projection.iterations <= 60


def test_faces_that_arrive_flipped_are_unfolded() -> None:
    clean = box(14)
    start = noisy(clean, "all", 0.5)
    result = denoise(start, clean[1])
    arrived, left = int((angles(start, clean) > 90.0).sum()), int((angles(result.vertices, clean) > 90.0).sum())
    assert result.before["flipped_faces"] > 100
    assert left < 0.1 * arrived
    assert result.after["flipped_faces"] < 0.1 * result.before["flipped_faces"]
    folded = denoise(start, clean[1], settings=DenoiseSettings(unfolding_weight=0.0))
    assert folded.after["flipped_faces"] > result.after["flipped_faces"] + 10


def test_curved_is_better_on_a_sphere() -> None:
    made = irregular_triangles(Sphere(), 400)
    clean = made.vertices, made.topology
    start = noisy(clean, "normal", 0.3)
    sharp, blunt = (denoise(start, clean[1], settings=DenoiseSettings(curved=curved)) for curved in (False, True))
    assert angles(blunt.vertices, clean).mean() < 0.9 * angles(sharp.vertices, clean).mean()


@pytest.mark.parametrize("unit", [1000.0, 1e-3])
def test_the_result_does_not_depend_on_the_unit_nor_on_the_place(unit: float) -> None:
    clean = box(8)
    start = noisy(clean, "all", 0.2)
    shift = torch.tensor([2.0, -1.0, 0.5], dtype=DOUBLE)
    here, there = denoise(start, clean[1]), denoise(unit * (start + shift), clean[1])
    torch.testing.assert_close(there.vertices / unit - shift, here.vertices, rtol=0, atol=1e-9)
    assert there.after["noise"] == pytest.approx(unit * here.after["noise"], rel=1e-9)
    assert there.after["volume"] == pytest.approx(unit**3 * here.after["volume"], rel=1e-9)
    assert there.after["flipped_faces"] == here.after["flipped_faces"]


def test_a_turned_mesh_gives_the_turned_result_as_far_as_steps_go() -> None:
    """Damping goes by coordinates, so that the way to the minimum is not quite the same."""
    clean = box(8)
    start, turn = noisy(clean, "all", 0.2), random_rotation()
    here, there = denoise(start, clean[1]), denoise(start @ turn.T, clean[1])
    away = torch.linalg.vector_norm(there.vertices @ turn - here.vertices, dim=1)
    assert away.max() < 0.05 * edge_lengths(*clean).mean()
    assert there.after["normal_variation"] == pytest.approx(here.after["normal_variation"], rel=0.01)


def test_the_merit_is_that_of_the_formula() -> None:
    clean = box(6)
    start = noisy(clean, "normal", 0.1)
    settings = DenoiseSettings(noise=0.02, strength=1.5)
    recipe = DenoiseRecipe(start, clean[1], settings=settings)
    unit = Normalisation.of(start, clean[1])
    there = unit.apply(clean[0])  # not folded
    session = Session(recipe)
    total = 0.0
    for term in recipe.terms():
        arguments = term.arguments({"vertices": there})
        total += float(term.contributions(arguments, term.values(arguments)).sum())
    jump = (
        edge_lengths(there, clean[1])[: clean[1].num_interior_edges]
        * dual_edge_lengths(there, clean[1])[: clean[1].num_interior_edges]
    )
    bent = (torch.sqrt(jump**2 + 3e-3**2) - 3e-3).sum()
    expected = 0.5 * (there - unit.apply(start)).square().sum() + 1.5 * 0.02 / unit.length * bent
    assert total == pytest.approx(float(expected), rel=1e-9)
    assert session.recipe is recipe


def test_a_clean_mesh_and_no_noise_are_left_alone() -> None:
    clean = box(8)
    assert denoise(*clean).vertices.equal(clean[0])
    start = noisy(clean, "normal", 0.2)
    result = denoise(start, clean[1], settings=DenoiseSettings(noise=0.0))
    torch.testing.assert_close(result.vertices, start, rtol=0, atol=1e-12)
    assert result.after["rms_displacement_over_noise"] == 0.0


def test_noise_is_estimated_or_given_in_the_unit_of_the_input() -> None:
    clean = box(8)
    start = 25.4 * noisy(clean, "normal", 0.2)
    estimated = denoise(start, clean[1])
    given = denoise(start, clean[1], settings=DenoiseSettings(noise=estimated.after["noise"]))
    torch.testing.assert_close(given.vertices, estimated.vertices, rtol=0, atol=1e-9)
    assert any("estimated" in note for note in estimated.notes)
    assert not given.notes
    weak = denoise(start, clean[1], settings=DenoiseSettings(noise=0.1 * estimated.after["noise"]))
    assert weak.after["normal_variation"] > 1.2 * estimated.after["normal_variation"]


@pytest.mark.parametrize("boundary", ["free", "fixed"])
def test_the_boundary_is_free_or_fixed(boundary: str) -> None:
    made = irregular_triangles(Paraboloid(1.0, -1.0), 500)
    clean = made.vertices, made.topology
    start = noisy(clean, "all", 0.2)
    result = denoise(start, clean[1], settings=DenoiseSettings(boundary=boundary))
    rim = clean[1].is_boundary_vertex
    assert bool((result.vertices == start).all(1)[rim].all()) == (boundary == "fixed")
    assert not bool((result.vertices == start).all(1)[~rim].any())
    assert "volume" not in result.after
    assert result.after["normal_variation"] < 0.6 * result.before["normal_variation"]


def test_dtype_and_device_are_those_of_the_input() -> None:
    clean = box(6)
    start = noisy(clean, "normal", 0.1)
    result = denoise(start.float(), clean[1])
    assert result.vertices.dtype == torch.float32
    torch.testing.assert_close(result.vertices.double(), denoise(start, clean[1]).vertices, rtol=0, atol=1e-4)


def test_the_callback_sees_the_energy_and_stops() -> None:
    clean = box(6)
    start = noisy(clean, "normal", 0.2)
    seen: list[float] = []

    def stop(record: Any) -> bool:
        seen.append(record.quantities["normal_variation"])
        return len(seen) == 3

    result = denoise(start, clean[1], callback=stop)
    assert result.stopped
    assert seen[0] == pytest.approx(float(normal_variation(start, clean[1])), rel=1e-9)
    assert seen[2] == pytest.approx(result.after["normal_variation"], rel=1e-9)


def test_a_live_session_pulls_a_vertex() -> None:
    clean = box(6)
    session = Session(DenoiseRecipe(noisy(clean, "normal", 0.1), clean[1]))
    place = (0.5, 0.5, 1.3)
    session.move({40: place})
    session.settle()
    assert math.dist(session.vertices[40].tolist(), place) < 0.01


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("noise", -1.0),
        ("noise", math.nan),
        ("strength", -0.1),
        ("strength", math.inf),
        ("curved", 1),
        ("boundary", "glide"),
        ("smoothing", 0.0),
        ("curved_smoothing", -1.0),
        ("unfolding_weight", -1.0),
        ("handle_weight", math.inf),
    ],
)
def test_settings_out_of_range_are_named(field: str, value: Any) -> None:
    with pytest.raises(SettingsError, match=field):
        DenoiseSettings(**{field: value})


def test_faces_without_area_and_tiny_meshes_are_refused() -> None:
    clean = box(4)
    bad = clean[0].clone()
    bad[clean[1].corners[0]] = bad[clean[1].corners[1]]
    with pytest.raises(MeshError, match="no area"):
        denoise(bad, clean[1])
    with pytest.raises(MeshError, match="give the noise"):
        denoise(*box(1))
    assert denoise(*box(1), settings=DenoiseSettings(noise=0.01)).after["flipped_faces"] == 0


def test_flipped_faces_are_counted_with_the_sides_of_each_mesh() -> None:
    clean = box(8)
    start = noisy(clean, "all", 0.4)
    recipe = DenoiseRecipe(start, clean[1])
    counted = recipe.before()["flipped_faces"]
    assert counted == int(Sides.of(start, clean[1], recipe._near).flipped(start, clean[1]).sum())
    assert recipe.measures(clean[0])["flipped_faces"] == 0
