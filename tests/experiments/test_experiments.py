"""Every experiment at a tiny size: the claim that its JSON carries holds, and it behaves as a program should."""

from __future__ import annotations

import json
import math
import subprocess
import sys
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
from torchfair.geometry import angle_defects, corner_angles, face_area_vectors, planarity
from torchfair.io import load_mesh

FOLDER = Path(__file__).parents[2] / "experiments"
SCRIPTS = sorted(path.stem for path in FOLDER.glob("[!_]*.py"))

Run = Callable[..., dict[str, Any]]


# ---- claims --------------------------------------------------------------------------------------------


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


@pytest.mark.slow
def test_handles_are_found_through_the_solve(run: Run, tmp_path: Path) -> None:
    design = run("inverse_design", "--vertices", "60", "--steps", "2", "--difference-steps", "1", "--points", "4",
                 "--handles", "1", "--pull", "0.4")["designs"]["points"]  # fmt: skip
    assert design["errors_of_gradients"]["implicit"] < 0.03  # that of differences of a loss that is small here
    for way in ("implicit", "unrolled", "finite differences"):
        assert design[way]["loss"] <= design[way]["first_loss"]
    assert design["implicit"]["loss"] < 0.6 * design["implicit"]["first_loss"]
    assert load_mesh(tmp_path / "out" / "points_found.obj").topology.is_triangular


@pytest.mark.slow
def test_a_surface_is_recovered_from_what_it_mirrors(run: Run, tmp_path: Path) -> None:
    report = run("shape_from_mirrors", "--rows", "8", "--fine", "24", "--views", "3", "--size", "32", "--steps", "40",
                 "--rate", "0.06")  # fmt: skip
    surfaces = report["surfaces"]
    for way in surfaces.values():
        assert way["degrees"] < 0.4 * way["start"]["degrees"]
        assert way["rms"] < 0.4 * way["start"]["rms"]
    alone, energy = surfaces["pictures alone"], surfaces["pictures and E"]
    assert energy["normal_variation"] < alone["normal_variation"]
    found, wanted = (load_mesh(tmp_path / "out" / name) for name in ("pictures_and_e.obj", "surface.obj"))
    boundary = found.topology.is_boundary_vertex
    torch.testing.assert_close(found.vertices[boundary], wanted.vertices[boundary])


@pytest.mark.parametrize(("name", "rows"), [("fig01_reflections", ["16"]), ("fig14_reflections", ["10", "16"])])
def test_principal_meshes_have_least_energy_and_mirror_better(run: Run, name: str, rows: list[str]) -> None:
    report = run(name, "--size", "96", "--rows", *rows)
    finest = {kind: row.get(rows[-1], row) for kind, row in report["meshes"].items()}
    kinds = ("triangle mesh", "principal-symmetric triangles", "principal quads")
    irregular, symmetric, quads = (finest[kind] for kind in kinds)
    meshed = finest["principal quads, meshed"]  # of the irregular triangles alone
    assert meshed["normal_variation"] == pytest.approx(quads["normal_variation"], rel=0.05)
    assert meshed["score"] < irregular["score"]
    assert quads["normal_variation"] < symmetric["normal_variation"] < irregular["normal_variation"]
    assert quads["normal_variation"] == pytest.approx(report["total_absolute_curvature"], rel=0.15)
    assert max(quads["score"], symmetric["score"]) < irregular["score"]


@pytest.mark.slow
def test_chains_end_in_planar_quads_whose_energy_is_the_curvature_of_the_surface(run: Run, tmp_path: Path) -> None:
    report = run("fig17_pipelines", "--vertices", "300", "--quads", "150")["surfaces"]
    for surface in report.values():
        stages = surface["stages"]
        energy = {name: row["variation_over_curvature"] for name, row in stages.items()}
        assert energy["triangles"] > 1.2
        assert energy["of smaller E"] < 0.9 * energy["triangles"]
        assert energy["principal quads"] < 1.03
        assert energy["planar"] < 1.06
        assert stages["planar"]["planarity_max"] < 1e-4 < stages["principal quads"]["planarity_max"]
        assert surface["chain"]["holds"]
    floors = [surface["stages"]["triangles"]["total_absolute_curvature"] for surface in report.values()]
    assert floors[1] < 0.8 * floors[0]
    mesh = load_mesh(tmp_path / "out" / "design_surface_planar.obj")
    assert planarity(mesh.vertices, mesh.topology).max() < 1e-4


@pytest.mark.slow
def test_a_facade_of_principal_quads_mirrors_better_than_one_of_as_many_triangles(run: Run) -> None:
    options = ("--vertices", "200", "--levels", "1", "--quads", "500", "--size", "96")
    meshes = run("fig10_glass_facade", *options)["meshes"]
    triangles, quads = meshes["as many triangular panels"], meshes["planar principal quads"]
    assert 0.8 < triangles["faces"] / quads["faces"] < 1.25
    assert quads["variation_over_curvature"] < 1.08 < 1.25 < triangles["variation_over_curvature"]
    assert quads["score"] < triangles["score"]
    assert quads["planarity_max"] < 1e-4


@pytest.mark.slow
def test_a_surface_with_four_openings_is_meshed_with_all_of_them(run: Run, tmp_path: Path) -> None:
    report = run("fig21_principal_remeshing", "--vertices", "300", "--levels", "1", "--quads", "500")
    made = report["chain"]["principal quads"]
    assert (made["euler_number"], made["boundary_loops"]) == (-3, 5)
    rows = report["meshes"]
    assert rows["principal quads"]["normal_variation"] < 0.85 * rows["surface of least C"]["normal_variation"]
    mesh = load_mesh(tmp_path / "out" / "planar_quads.obj")
    assert len(mesh.topology.boundary_loops()) == 5


TRAINING = ("--rows", "8", "--columns", "8", "--points", "120", "--batch", "60", "--steps", "90", "--log-every", "30")


def test_training_with_energy_is_nearer_to_the_surface_and_smoother(run: Run, tmp_path: Path) -> None:
    options = (*TRAINING, "--steps", "300", "--learning-rate", "0.02", "--noise", "0.1")
    report = run("train_height_field", *options)
    plain, regularised = report["plain"], report["regularised"]
    assert regularised["best"]["error"] < 0.8 * plain["best"]["error"]
    assert regularised["normal_variation"] < 0.5 * plain["normal_variation"]
    lines = [json.loads(line) for line in (tmp_path / "out" / "plain.jsonl").read_text().splitlines()]
    assert [line["step"] for line in lines] == list(range(30, 301, 30))
    assert plain["best"] == min(lines, key=lambda line: line["validation"])


def test_a_surface_of_changing_faces_is_smoother_with_energy(run: Run, tmp_path: Path) -> None:
    options = ("--nodes", "11", "--steps", "60", "--log-every", "20", "--samples", "400", "--noise", "0.1",
               "--warm-up", "5", "--weight", "0.003", "--runs", "plain", "normal_variation")  # fmt: skip
    report = run("train_signed_distance", *options)
    plain, regularised = report["plain"]["records"][-1], report["normal_variation"]["records"][-1]
    assert regularised["normal_variation_over_c"] < 0.9 * plain["normal_variation_over_c"]
    assert load_mesh(tmp_path / "out" / "normal_variation.obj").topology.num_faces > 100


def test_a_network_finds_forms_of_less_curvature_than_it_starts_from(run: Run, tmp_path: Path) -> None:
    options = ("--rows", "6", "--steps", "150", "--log-every", "50", "--hidden", "32", "--unseen", "1",
               "--validation-boundaries", "8")  # fmt: skip
    report = run("train_form_finding", *options)
    records = report["training"]["records"]
    assert records[-1]["c_over_harmonic"] < records[0]["c_over_harmonic"] < 1.0
    (row,) = report["unseen"]["rows"]
    assert row["solver"] < row["network"] < row["harmonic"]
    start, found = (load_mesh(tmp_path / "out" / f"{name}.obj") for name in ("harmonic", "network"))
    rim = start.topology.is_boundary_vertex
    torch.testing.assert_close(found.vertices[rim], start.vertices[rim], rtol=0, atol=1e-6)


def test_marching_tetrahedra_give_closed_meshes_that_follow_the_values(script: Callable[[str], ModuleType]) -> None:
    marching = script("_marching")
    nodes = marching.lattice(13, 1.0)
    radius = torch.linalg.vector_norm(nodes, dim=1)
    values = (radius - 0.713).requires_grad_()
    vertices, topology = marching.zero_surface(values, nodes, 13)
    topology.require_fans()
    counts = (topology.num_vertices - topology.num_edges + topology.num_faces, len(topology.boundary_loops()))
    assert counts == (2, 0)

    def volume_inside(vertices: torch.Tensor, topology: Topology) -> torch.Tensor:  # positive: normals point outward
        firsts = vertices[topology.corners[topology.face_offsets[:-1]]]
        return (face_area_vectors(vertices, topology) * firsts).sum() / 3

    inside, finer = volume_inside(vertices, topology), marching.lattice(25, 1.0)
    exact, finer_values = 4 / 3 * math.pi * 0.713**3, torch.linalg.vector_norm(finer, dim=1) - 0.713
    at_half = volume_inside(*marching.zero_surface(finer_values, finer, 25))
    assert 3 < (exact - inside.item()) / (exact - at_half.item()) < 5  # second order
    assert (torch.linalg.vector_norm(vertices, dim=1) - 0.713).abs().max() < 0.02
    assert planarity(vertices, topology).max() < 1e-12
    (slope,) = torch.autograd.grad(inside, values)
    assert (slope < 1e-12).all()  # where values rise, the body shrinks
    area = 4 * math.pi * 0.713**2  # by how much it does if all rise alike, as their slope is one
    assert float(slope.sum()) == pytest.approx(-area, rel=0.03)


@pytest.mark.parametrize("value", [1.0, -1.0])
def test_no_surface_is_an_empty_mesh(script: Callable[[str], ModuleType], value: float) -> None:
    marching = script("_marching")
    nodes = marching.lattice(5, 1.0)
    vertices, topology = marching.zero_surface(torch.full((125,), value), nodes, 5)
    assert (vertices.shape, topology.num_faces) == ((0, 3), 0)


# ---- training ------------------------------------------------------------------------------------------


def test_patience_ends_a_training_at_its_best(run: Run) -> None:
    report = run("train_height_field", *TRAINING, "--log-every", "5", "--patience", "2", "--learning-rate", "0.3",
                 "--noise", "0.5", "--steps", "300")  # fmt: skip
    plain = report["plain"]
    assert plain["stopped_early"]
    assert plain["last"]["step"] == plain["best"]["step"] + 10 < 300


def test_gradients_are_clipped_and_half_precision_trains(run: Run) -> None:
    short = (*TRAINING, "--no-compare", "--steps", "30")
    plain = run("train_height_field", *short)["regularised"]["last"]
    clipped = run("train_height_field", *short, "--clip", "1e-9", folder="clipped")["regularised"]["last"]
    assert clipped != plain  # Adam scales clipped gradients up again, but for its epsilon
    half = run("train_height_field", *short, "--dtype", "bfloat16", folder="half")["regularised"]["last"]
    assert half["validation"] == pytest.approx(plain["validation"], rel=0.05)


def test_a_longer_course_goes_on_from_the_end_of_a_shorter_one(run: Run, tmp_path: Path) -> None:
    run("train_height_field", *TRAINING, "--no-compare", "--steps", "30")
    more = run("train_height_field", *TRAINING, "--no-compare", "--steps", "60", "--resume")["regularised"]
    assert more["last"]["step"] == 60
    log = (tmp_path / "out" / "regularised.jsonl").read_text().splitlines()
    assert [json.loads(line)["step"] for line in log] == [30, 60]


def test_events_are_written_where_tensorboard_is(run: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    written: list[tuple[object, ...]] = []

    class SummaryWriter:
        def __init__(self, folder: str) -> None:
            written.append(("open", folder))

        def add_scalar(self, *values: object) -> None:
            written.append(values)

        def close(self) -> None:
            written.append(("close",))

    module = ModuleType("torch.utils.tensorboard")
    module.SummaryWriter = SummaryWriter  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "torch.utils.tensorboard", module)
    report = run("train_height_field", *TRAINING, "--no-compare", "--steps", "30")
    assert written[0][0] == "open"
    assert ("validation", report["regularised"]["last"]["validation"], 30) in written
    assert written[-1] == ("close",)


@pytest.mark.slow
def test_two_processes_train_one_model(tmp_path: Path) -> None:
    """As torchrun starts them: the same parameters in both, from the mean of the gradients of their batches."""
    script = FOLDER / "train_height_field.py"
    options = [*TRAINING, "--no-compare", "--width", "400", "--steps", "60"]
    results = []
    for extra in ([], ["--steps", "90", "--resume"]):
        command = [sys.executable, "-m", "torch.distributed.run", "--nproc-per-node", "2", "--master-port", "29517"]
        command += [str(script), "--output", str(tmp_path / "out"), *options, *extra]
        done = subprocess.run(command, capture_output=True, text=True, cwd=FOLDER.parent)
        assert done.returncode == 0, done.stderr[-2000:]
        results.append(json.loads((tmp_path / "out" / "result.json").read_text())["regularised"])
    assert [row["last"]["step"] for row in results] == [60, 90]
    state = torch.load(tmp_path / "out" / "regularised_last.pt", weights_only=True)
    assert len(state["generators"]) == 2
    assert not torch.equal(*state["generators"])


def test_the_mean_of_gradients_is_that_of_the_processes(script: Callable[[str], ModuleType]) -> None:
    processes = script("_processes").Processes(0, 2)
    module = torch.nn.Linear(2, 1)
    module.weight.grad = torch.tensor([[1.0, 2.0]])

    def twice(flat: torch.Tensor) -> None:
        flat += torch.tensor([3.0, 0.0, 5.0])  # what the other process has

    original, torch.distributed.all_reduce = torch.distributed.all_reduce, twice  # type: ignore[assignment]
    try:
        processes.average_gradients(module)
    finally:
        torch.distributed.all_reduce = original
    assert module.weight.grad.tolist() == [[2.0, 1.0]]
    assert module.bias.grad.tolist() == [2.5]


def test_ctrl_c_keeps_the_last_whole_step(
    run: Run, script: Callable[[str], ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    module = script("train_height_field")
    residuals, calls = module.Samples.residuals, []

    def interrupting(self: object, *arguments: object) -> torch.Tensor:
        calls.append(1)
        if len(calls) == 43:  # 30 steps, two validations, then the eleventh step after these
            raise KeyboardInterrupt
        return residuals(self, *arguments)

    monkeypatch.setattr(module.Samples, "residuals", interrupting)
    run("train_height_field", *TRAINING, code=130)
    state = torch.load(tmp_path / "out" / "regularised_last.pt", weights_only=True)
    assert state["step"] == 40


# ---- programs ------------------------------------------------------------------------------------------


def test_interrupted_training_keeps_the_best_and_resumes_to_the_same_numbers(
    run: Run, script: Callable[[str], ModuleType], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = run("train_height_field", *TRAINING, folder="whole")
    module = script("train_height_field")
    residuals, calls = module.Samples.residuals, []

    def interrupting(self: object, *arguments: object) -> torch.Tensor:
        calls.append(1)
        if len(calls) == 50:  # in the second stretch of 30 steps
            raise KeyboardInterrupt
        return residuals(self, *arguments)

    monkeypatch.setattr(module.Samples, "residuals", interrupting)
    stopped = run("train_height_field", *TRAINING, code=130)
    assert stopped["interrupted"]
    assert stopped["regularised"]["best"]["step"] == 30
    assert "plain" not in stopped
    assert (tmp_path / "out" / "regularised.obj").exists()
    monkeypatch.undo()
    monkeypatch.syspath_prepend(str(FOLDER))
    resumed = run("train_height_field", *TRAINING, "--resume")
    for name in ("regularised", "plain"):
        for key in ("best", "last"):
            expected, actual = (dict(report[name][key], seconds=0) for report in (whole, resumed))
            assert actual == expected
    log = (tmp_path / "out" / "regularised.jsonl").read_text().splitlines()
    assert [json.loads(line)["step"] for line in log] == [30, 60, 90]


def test_a_checkpoint_of_other_settings_is_refused(run: Run, capsys: pytest.CaptureFixture[str]) -> None:
    run("train_height_field", *TRAINING, "--steps", "2", "--no-compare")
    run("train_height_field", *TRAINING, "--steps", "2", "--no-compare", "--resume", "--noise", "0.2", code=2)
    assert "other settings (noise)" in capsys.readouterr().err


def test_results_are_not_replaced_without_force(run: Run, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    options = ("--steps", "4", "--cells", "2")
    run("fig11_energy_per_area", *options)
    chart = tmp_path / "out" / "energy_per_area.png"
    (tmp_path / "out" / "result.json").unlink()
    written = chart.stat().st_mtime_ns
    run("fig11_energy_per_area", *options, code=2)
    captured = capsys.readouterr()
    assert "--force" in captured.err
    assert captured.err.count("\n") == 1
    assert chart.stat().st_mtime_ns == written
    assert run("fig11_energy_per_area", *options, "--force")["experiment"] == "fig11_energy_per_area"
    assert chart.stat().st_mtime_ns != written


@pytest.mark.parametrize("options", [("--rows", "7", "9"), ("--rows", "8"), ("--surfaces", "cube"), ("--seed", "-1")])
def test_settings_out_of_bounds_are_refused(
    script: Callable[[str], ModuleType], capsys: pytest.CaptureFixture[str], options: tuple[str, ...]
) -> None:
    with pytest.raises(SystemExit) as stop:
        script("fig07_principal_meshes").main(list(options))
    assert stop.value.code == 2
    assert options[0].removeprefix("--") in capsys.readouterr().err


def test_scripts_run_from_the_command_line() -> None:
    command = [sys.executable, str(FOLDER / "fig18_hybrid_roof.py"), "--help"]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "--strips" in done.stdout
    assert "[13]" in done.stdout  # the default


@pytest.mark.parametrize("name", SCRIPTS)
def test_readme_has_a_row_for_every_script(name: str) -> None:
    assert f"`python experiments/{name}.py`" in (FOLDER / "README.md").read_text()
