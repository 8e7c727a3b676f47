"""What experiments on figures of the paper claim, at tiny sizes."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest
import torch
from helpers import DOUBLE

from torchfair import Topology
from torchfair.formfinding.denoise.measures import volume
from torchfair.geometry import angle_defects, corner_angles, planarity
from torchfair.io import load_mesh

Run = Callable[..., dict[str, Any]]


def test_energy_of_principal_meshes_converges_to_c_and_that_of_others_does_not(run: Run, tmp_path: Path) -> None:
    report = run("fig07_principal_meshes", "--surfaces", "enneper", "torus", "--rows", "8", "16", "32",
                 "--drawn-rows", "3", "4", "5")  # fmt: skip
    enneper, torus = report["surfaces"]["enneper"], report["surfaces"]["torus"]
    assert enneper["order_inside"] >= 1.9
    assert enneper["order"] == pytest.approx(1, abs=0.1)  # against C of the whole patch
    assert torus["order"] >= 1.9
    assert enneper["smallest_ratio_others"] > 1.15
    assert torus["smallest_ratio_others"] > 1.02
    for surface in (enneper, torus):
        rows = surface["meshings"]
        for name in surface["finest_ratio_others"]:  # not on the way to C, but away from it or steady
            assert rows[name][-1]["ratio"] > 0.99 * rows[name][0]["ratio"]
        cut, whole = surface["finest_ratio_principal_cut"], surface["finest_ratio_principal"]
        assert cut == pytest.approx(whole, abs=2e-3)
    mesh = load_mesh(tmp_path / "out" / "principal_fine.obj")
    assert mesh.topology.is_quadrangular
    assert load_mesh(tmp_path / "out" / "irregular.obj").topology.is_triangular


@pytest.mark.slow
def test_denoising_keeps_edges_where_filters_do_not(run: Run, tmp_path: Path) -> None:
    report = run("denoise_shapes", "--faces", "2500", "--shapes", "block", "cylinder", "--levels", "0.3",
                 "--noises", "all", "--repeats", "1")  # fmt: skip
    for row in report["rows"]:
        assert row["denoise"]["degrees"] < 0.6 * min(row["bilateral"]["degrees"], row["taubin"]["degrees"])
        assert row["denoise"]["flipped"] <= 0.02 * row["noisy"]["flipped"]
        assert abs(row["denoise"]["volume"]) < 0.04
        assert row["denoise"]["estimate"] == pytest.approx(0.3, rel=0.15)
    assert len((tmp_path / "out" / "table.md").read_text().splitlines()) == 4


@pytest.mark.parametrize("name", ["block", "cylinder"])
def test_bodies_to_denoise_are_closed_and_evenly_meshed(script: Callable[[str], ModuleType], name: str) -> None:
    shapes = script("_denoise_shapes")
    vertices, topology = getattr(shapes, name)(3000)
    assert not bool(topology.is_boundary_vertex.any())
    assert topology.num_vertices - topology.num_edges + topology.num_faces == {"block": -2, "cylinder": 2}[name]
    assert topology.num_faces == pytest.approx(3000, rel=0.1)
    assert float(corner_angles(vertices, topology).min()) > math.radians(20.0)
    inside = {"block": 9.0 - math.pi * (0.35**2 + 2 * 0.4**2), "cylinder": 2.5 * math.pi}[name]
    assert volume(vertices, topology) == pytest.approx(inside, rel=0.01)


def test_parameter_lines_of_the_moulding_surface_are_principal(script: Callable[[str], ModuleType]) -> None:
    surface = script("fig07_principal_meshes").Moulding()
    (u0, u1), (v0, v1) = surface.domain
    u, v = torch.meshgrid(
        torch.linspace(u0, u1, 9, dtype=DOUBLE), torch.linspace(v0, v1, 9, dtype=DOUBLE), indexing="ij"
    )
    first, second = surface.fundamental_forms(u, v)
    assert first[..., 1].abs().max() < 1e-12
    assert second[..., 1].abs().max() < 1e-12
    curvature = surface.gaussian_curvature(u, v)
    assert curvature.min() < -0.01
    assert curvature.max() > 0.01


def test_energy_per_area_is_minimal_for_rectangles_only_where_k_is_negative(run: Run) -> None:
    report = run("fig11_energy_per_area", "--steps", "36", "--cells", "2")
    saddle, bowl = report["saddle"], report["bowl"]
    for paraboloid in (saddle, bowl):
        assert paraboloid["smallest_planar"] == pytest.approx(1, abs=1e-3)
        assert paraboloid["largest_planarity"] < 1e-12
        assert paraboloid["largest_deviation_from_formula"] < 1e-3
        assert paraboloid["largest_influence_of_length"] < 2e-3
        assert min(paraboloid["smallest_cut"].values()) > 1 - 1e-3
    assert saddle["smallest_planar_at_degrees"] % 90 == 0
    assert saddle["smallest_planar_10_degrees_away"] > 1.03
    assert bowl["largest_planar_below_10"] == pytest.approx(1, abs=1e-3)  # the same at every angle
    assert saddle["smallest_cut"]["rhombi of 60°, cut"] > 1.1


def test_stars_of_a_finite_size_stay_above_the_bound(script: Callable[[str], ModuleType]) -> None:
    module = script("fig11_energy_per_area")
    coefficients = torch.tensor([1.0, -0.4], dtype=DOUBLE)
    angles = torch.linspace(0, 3.1, 40, dtype=DOUBLE)
    p = 0.02 * module.directions(angles)
    q = 0.03 * module.conjugate(p, coefficients)
    assert (p * coefficients * q).sum(-1).abs().max() < 1e-18
    values = module.energy_per_area(p, q, coefficients)
    assert (values / (2 * coefficients.abs().sum()) > 1 - 1e-3).all()


def test_handles_are_reached_and_energy_unfolds_the_gauss_image(run: Run, tmp_path: Path) -> None:
    report = run("fig12_handles", "--weights", "0.03", "--samples", "32", "--lattices", "sheared")
    assert report["counts"] == {"vertices": 189, "edges": 525, "faces": 336}  # those of the paper
    without, with_energy = report["by_weight"]["sheared"]["0"], report["by_weight"]["sheared"]["0.03"]
    for row in (without, with_energy):
        assert row["largest_handle_distance"] < 1e-3
        assert row["pyramids_beyond_a_half_sphere"] == 0
    assert with_energy["normal_variation"] < 0.6 * without["normal_variation"]
    assert with_energy["sum_of_dihedral_angles"] < 0.5 * without["sum_of_dihedral_angles"]
    assert without["folded_pyramids"] > 10
    assert with_energy["folded_pyramids"] == 0
    assert load_mesh(tmp_path / "out" / "with_energy.obj").topology.num_faces == 336


def test_pyramid_areas_differ_by_the_angle_defect(script: Callable[[str], ModuleType]) -> None:
    module = script("fig12_handles")
    vertices, topology = module.dome(module.Config(around=7, rings=4), 2.0, 0.3)
    vertices = vertices + 0.06 * torch.from_numpy(np.random.default_rng(0).normal(size=vertices.shape))
    positive, negative = module.pyramid_areas(vertices, topology, 200)
    centres = torch.cat([centre for centre, _ in topology.rings_by_valence.values()])
    assert torch.minimum(positive, negative).max() > 1e-3  # some are folded
    torch.testing.assert_close(positive - negative, angle_defects(vertices, topology)[centres], atol=2e-3, rtol=0)


@pytest.mark.parametrize(
    ("arms", "bend", "is_folded"),
    [
        ([(1.0, 0.0), (0.5, 0.8), (-0.5, 0.8)], (1.0, 1.0), False),  # bowl
        ([(1.0, 0.0), (0.5, 0.8), (-0.5, 0.8)], (1.0, -1.0), False),  # saddle
        ([(1.2, 0.0), (2.2, 0.5), (1.0, 0.5)], (1.0, -1.0), True),  # paper Fig. 2c: K < 0, but all edges rise
    ],
)
def test_pyramids_fold_where_the_star_of_a_saddle_is_none(
    script: Callable[[str], ModuleType], arms: list[tuple[float, float]], bend: tuple[float, float], is_folded: bool
) -> None:
    ring = torch.tensor(arms + [(-x, -y) for x, y in arms], dtype=DOUBLE)
    ring = torch.cat([ring, 0.2 * (ring**2 @ torch.tensor(bend, dtype=DOUBLE))[:, None]], dim=1)
    vertices = torch.cat([torch.zeros(1, 3, dtype=DOUBLE), ring])
    topology = Topology.from_faces([[0, i + 1, (i + 1) % 6 + 1] for i in range(6)])
    areas = script("fig12_handles").pyramid_areas(vertices, topology, 200)
    assert bool(torch.minimum(*areas) > 1e-3) == is_folded
    assert torch.sign(angle_defects(vertices, topology)[0]) == torch.sign(torch.tensor(bend).prod())


def test_hybrid_roof_gets_smoother_near_the_original_with_planar_quads(run: Run, tmp_path: Path) -> None:
    report = run("fig18_hybrid_roof", "--strips", "3", "--columns", "8", "--iterations", "10")
    for formulation in ("reduced", "lifted"):
        row = report["formulations"][formulation]
        assert row["relative_change"] < -0.03
        assert row["after"]["largest_planarity"] < 1e-4
        assert row["after"]["largest_distance_relative"] <= 0.05
        assert row["after"]["flipped_faces"] == 0
        mesh = load_mesh(tmp_path / "out" / f"{formulation}.obj")
        assert planarity(mesh.vertices, mesh.topology).max() < 1e-4
    assert report["formulations"]["lifted"]["unknowns"] > 3 * report["formulations"]["reduced"]["unknowns"]
    sizes = report["sizes_as_in_paper"]
    assert sizes["V"] - sizes["E"] + sizes["F"] == 1
    assert "0.21" in (tmp_path / "out" / "table.txt").read_text()  # the paper's row


@pytest.mark.parametrize("name", ["cone", "tilted_circles"])
def test_least_absolute_curvature_lies_below_that_of_surfaces_of_least_area_and_bending(
    run: Run, tmp_path: Path, name: str
) -> None:
    options = ("--boundaries", name, "--vertices", "90", "--levels", "1", "--iterations", "15")
    report = run("fig13_boundaries", *options)["boundaries"][name]
    assert min(report["saved"].values()) > 0.03
    assert abs(report["excess"]) < 0.03
    if name == "cone":
        assert report["largest_distance_from_hull"] < 5e-3
        least, start = (report["surfaces"][key]["total_absolute_curvature"] for key in ("least C", "start"))
        assert least < 0.6 * start
    surfaces = report["surfaces"]
    assert min(surfaces, key=lambda kind: surfaces[kind]["area"]) == "least area"
    assert load_mesh(tmp_path / "out" / f"{name}_least_c.obj").topology.num_faces == report["faces"]


def test_curvature_of_canopies_of_least_absolute_curvature_gathers_in_ridges(run: Run) -> None:
    options = ("--canopies", "leaf", "--vertices", "120", "--levels", "1", "--iterations", "15")
    report = run("fig16_canopies", *options)["canopies"]["leaf"]
    assert min(report["saved"].values()) > 0.05
    gathered = {kind: row["area_with_half_of_c"] for kind, row in report["surfaces"].items()}
    assert min(gathered, key=lambda kind: gathered[kind]) == "least C"


def test_boundary_and_tangent_planes_give_patches_of_cylinder_and_cone_back(run: Run) -> None:
    report = run("fig15_tangent_planes", "--vertices", "120", "--levels", "0", "--designs", "pipe")
    for patch in report["patches"].values():
        assert patch["largest_distance"] < 0.05 * patch["start_distance"]
        assert abs(patch["excess"]) < 0.05
    kinds = report["designs"]["pipe"]["kinds"]
    by_angles = {kind: row["total_absolute_curvature_by_angles"] for kind, row in kinds.items()}
    assert by_angles["prescribed"] > 1.3 * by_angles["free"]


def test_mean_curvature_is_better_where_stars_are_saddles(run: Run) -> None:
    report = run("fig03_mean_curvature", "--rows", "24", "--perturbations", "0", "0.1", "--drawn", "0.1")["lattices"]
    saddles, others = report["stars are saddles"], report["stars are no saddles"]
    for size in ("0", "0.1"):
        assert saddles[size]["stars"]["good"] == saddles[size]["stars"]["all"]
        assert saddles[size]["self_intersecting_pyramids"] == 0
        assert others[size]["stars"]["neither"] > 0.9 * others[size]["stars"]["all"]
        assert others[size]["face_normal_error_degrees"] < 1.5 * saddles[size]["face_normal_error_degrees"]
    assert max(rows["0"]["error"]["all"] for rows in (saddles, others)) < 0.02  # both are right when regular
    assert others["0.1"]["error"]["all"] > 1.3 * saddles["0.1"]["error"]["all"] > 0.05


@pytest.mark.slow
def test_self_intersecting_pyramids_become_fewer_on_a_rough_saddle(run: Run) -> None:
    row = run("fig12_pyramids", "--builtin", "inner_torus")["meshes"]["inner_torus"]
    assert row["after"]["self_intersecting_pyramids"] < 0.3 * row["before"]["self_intersecting_pyramids"]
    assert row["after"]["pyramid_penalty"] < 0.05 * row["before"]["pyramid_penalty"]
    assert row["after"]["normal_variation"] < 0.9 * row["before"]["normal_variation"]


@pytest.mark.slow
def test_saddle_term_removes_bad_saddles_near_the_surface(run: Run) -> None:
    results = run("repair_saddles", "--rows", "10", "--rounds", "2")["results"]
    start, repaired = results["start"], results["saddle term"]
    assert repaired["good_saddle"] > start["good_saddle"]
    assert repaired["good_saddle"] >= 0.97 * start["inner_vertices"]
    assert repaired["largest_distance"] < 0.05


def test_reflections_rank_principal_meshes_first_and_variation_is_energy(run: Run) -> None:
    report = run("fig_reflection_ranking", "--surfaces", "paraboloid", "--rows", "20", "--size", "96")
    principal = ("principal quads", "principal-symmetric, base = height", "principal-symmetric, equilateral")
    others = ("split squares, turned 25°", "split squares, turned 45°", "irregular", "irregular, another seed")
    rates = [report["pairs"][f"{good} < {bad}"] for good in principal for bad in others]
    assert all(rate["means"] == 1 for rate in rates)
    assert report["smallest_rate_of_principal_meshes"] == min(rate["views"] for rate in rates) >= 0.8
    assert min(rate["single_stripes"] for rate in rates) < min(rate["views"] for rate in rates)
    assert report["correlations"]["reflection_variation, energy_per_area"]["smallest"] > 0.95
    assert report["cases"] == 6


@pytest.mark.slow
def test_vertices_slide_until_reflections_are_smoother_without_folding(run: Run, tmp_path: Path) -> None:
    options = ("--surfaces", "paraboloid", "--rows", "9", "--steps", "12", "--log-every", "12",
               "--learning-rate", "0.03", "--size", "64", "--judged-size", "64")  # fmt: skip
    losses = run("optimise_reflection", *options)["surfaces"]["paraboloid"]
    both, energy = losses["1 - SSIM and variation"], losses["E alone"]
    assert both["score_change"] < -0.08
    assert both["score_change"] < energy["score_change"]
    assert both["normal_variation_change"] < 0
    assert both["end"]["flipped_faces"] == 0
    assert both["end"]["smallest_angle_degrees"] > 10
    start, end = (load_mesh(tmp_path / "out" / name) for name in ("start.obj", "reflection.obj"))
    boundary = start.topology.is_boundary_vertex
    assert torch.equal(start.vertices[boundary], end.vertices[boundary])
    x, y, z = end.vertices.unbind(1)
    assert (z - 0.5 * x**2 + 0.25 * y**2).abs().max() < 1e-9  # still on the surface
