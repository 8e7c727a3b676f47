"""What the job that lowers C asks for on one level: directions, smoothing, who stays, and what is reported."""

from __future__ import annotations

import itertools
import math

import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor

from torchfair.curves import ClosedCurve
from torchfair.energies import total_absolute_curvature
from torchfair.formfinding import FormRecipe, FormSettings, start_surface
from torchfair.formfinding.form.boundary_track import BoundaryTrack
from torchfair.formfinding.form.measures import warp_notes
from torchfair.formfinding.form.problem import FormProblem, staying_vertices
from torchfair.formfinding.form.rim import Rim
from torchfair.formfinding.job import Pulls
from torchfair.geometry import corner_angles, edge_lengths, vertex_normals
from torchfair.normalisation import Normalisation

VERTICES, TOPOLOGY = wavy_grid(8, 7, triangles=True)
FLAT = VERTICES * torch.tensor([1.0, 1.0, 0.0], dtype=DOUBLE)
RIM = TOPOLOGY.is_boundary_vertex
NONE = torch.zeros(0, dtype=torch.int64)


def problem(
    vertices: Tensor = VERTICES,
    *,
    normals: Tensor | None = None,
    handles: Tensor = NONE,
    targets: Tensor | None = None,
    settings: FormSettings | None = None,
) -> FormProblem:
    settings = settings or FormSettings()
    rim = Rim.of(vertices, TOPOLOGY, None, normals, settings.corner_angle)
    pulls = Pulls(vertices)
    pulls.pull(handles, vertices[handles] if targets is None else targets)
    return FormProblem(TOPOLOGY, Normalisation.of(vertices, TOPOLOGY), rim, pulls, settings)


def upright(where: Tensor) -> Tensor:
    return where[:, None] * torch.tensor([0.0, 0.0, 1.0], dtype=DOUBLE)


def test_directions_are_unit_vectors_that_point_to_targets_at_handles() -> None:
    handles = torch.nonzero(~RIM).squeeze(1)[[3, 9]]
    targets = VERTICES[handles] + torch.tensor([[0.0, 3.0, 4.0], [0.0, 0.0, 0.0]], dtype=DOUBLE)
    plain, pulled = problem().directions(VERTICES), problem(handles=handles, targets=targets).directions(VERTICES)
    torch.testing.assert_close(plain.norm(dim=1), torch.ones(len(plain), dtype=DOUBLE))
    torch.testing.assert_close(pulled[handles[0]], torch.tensor([0.0, 0.6, 0.8], dtype=DOUBLE))
    others = torch.arange(len(plain)) != handles[0]
    assert torch.equal(pulled[others], plain[others])  # also at a handle that is where it is to be


def test_directions_are_vertex_normals_evened_out_over_a_fifth_of_the_mesh() -> None:
    """``(I + (0.2 sqrt(V))^2 / 6 L) d ~ n`` with the graph Laplacian, by dense linear algebra."""
    count = TOPOLOGY.num_vertices
    laplacian = torch.diag(TOPOLOGY.valences.to(DOUBLE))
    v, w = TOPOLOGY.edges.unbind(1)
    laplacian[v, w] = laplacian[w, v] = -1.0
    matrix = torch.eye(count, dtype=DOUBLE) + 0.04 * count / 6.0 * laplacian
    expected = torch.linalg.solve(matrix, vertex_normals(VERTICES, TOPOLOGY))
    ways = problem().directions(VERTICES)
    torch.testing.assert_close(ways, expected / expected.norm(dim=1, keepdim=True))


def test_smoothing_is_a_fraction_of_the_mean_curvature_of_stars_and_never_nothing() -> None:
    mean = float(total_absolute_curvature(VERTICES, TOPOLOGY)) / TOPOLOGY.num_vertices
    assert problem().smoothing(VERTICES, 0.3) == pytest.approx(0.3 * mean)
    assert problem(FLAT).smoothing(FLAT, 0.3) == pytest.approx(1e-4)


def test_the_first_row_inside_prescribed_tangent_planes_stays_while_others_are_spread() -> None:
    some = RIM & (VERTICES[:, 0] < 3.5)
    held = problem(normals=upright(some)).fixed_in_space
    near = torch.zeros_like(RIM)
    for v, w in TOPOLOGY.edges.tolist():
        near[w] |= some[v]
        near[v] |= some[w]
    assert torch.equal(held, RIM | near)
    assert bool((near & ~RIM).any())
    assert torch.equal(problem().fixed_in_space, RIM)
    for other in (FormSettings(formulation="lifted"), FormSettings(boundary="glide")):
        also = problem(normals=upright(some), settings=other)
        assert not also.keeps_rows
        assert torch.equal(also.fixed_in_space, also.fixed)


def test_gliding_boundaries_keep_their_corners() -> None:
    settings = FormSettings(boundary="glide")
    gliding = problem(FLAT, settings=settings)
    track = BoundaryTrack.through(FLAT, TOPOLOGY, settings.corner_angle)
    assert 4 <= int(track.corners.sum()) < int(RIM.sum())
    assert torch.equal(gliding.fixed, track.corners)
    terms = gliding.terms(FLAT, 0.1)
    (slides,) = (term for term in terms if term.name == "boundary gliding")
    assert torch.equal(slides.stencil[0][1][:, 0], torch.nonzero(RIM & ~track.corners).squeeze(1))
    (spread,) = (term for term in terms if term.name == "boundary fairness")
    assert not bool(track.corners[spread.stencil[0][1][:, 1]].any())
    assert torch.equal(staying_vertices(TOPOLOGY, track, FormSettings()), RIM)


def test_collapse_is_an_angle_below_the_limit_and_below_half_of_the_start() -> None:
    judge = problem(settings=FormSettings(least_angle=math.radians(5.0)))
    squeezed = [VERTICES * torch.tensor([1.0, size, size], dtype=DOUBLE) for size in (1.0, 0.3, 0.03, 0.003)]
    smallest = [float(corner_angles(mesh, TOPOLOGY).min()) for mesh in squeezed]
    assert smallest[0] > math.radians(10.0) > smallest[-1]
    for start, angle in zip(squeezed, smallest, strict=True):
        least = min(math.radians(5.0), 0.5 * angle)
        assert judge.least_angle(start) == pytest.approx(least)
        assert [judge.has_collapsed(mesh, start) for mesh in squeezed] == [other < least for other in smallest]


@pytest.mark.parametrize("coarse", [0.05, 0.1, 0.3, 2.0, 40.0])
def test_smoothings_fall_in_equal_steps_of_about_five(coarse: float) -> None:
    found = FormSettings(coarse_smoothing=coarse, smoothing=0.05).smoothings()
    assert found[0] == pytest.approx(coarse)
    assert found[-1] == 0.05
    steps = [a / b for a, b in itertools.pairwise(found)]
    assert steps == pytest.approx([steps[0]] * len(steps))
    assert steps[0] < 5.0**1.5
    assert len(steps) == 1 or steps[0] > 5.0**0.75


# ---- what is reported --------------------------------------------------------------------------------------


def test_the_largest_tilt_and_the_farthest_handle_are_reported() -> None:
    vertices, topology = start_surface([circle()], 120)
    rim = torch.nonzero(topology.is_boundary_vertex).squeeze(1)
    tilts = torch.tensor([0.1, 0.4, 0.2, 2.0], dtype=DOUBLE)
    normals = torch.zeros_like(vertices)
    normals[rim[:4]] = torch.stack([tilts.sin(), torch.zeros(4, dtype=DOUBLE), tilts.cos()], 1)
    offsets = torch.tensor([[0.0, 0.0, 0.1], [0.3, 0.0, 0.4], [0.0, 0.2, 0.0]], dtype=DOUBLE)
    recipe = FormRecipe(vertices, topology, normals=normals)
    recipe.pull({number: (vertices[number] + offset).tolist() for number, offset in enumerate(offsets)})
    measures = recipe.measures(vertices)
    assert measures["largest_tilt_degrees"] == pytest.approx(math.degrees(2.0))
    assert measures["largest_handle_distance"] == pytest.approx(0.5)
    none = FormRecipe(vertices, topology).measures(vertices)
    assert none["largest_tilt_degrees"] == none["largest_handle_distance"] == none["largest_boundary_distance"] == 0.0


def circle() -> ClosedCurve:
    turn = torch.arange(40, dtype=DOUBLE) * (math.tau / 40)
    return ClosedCurve(torch.stack([turn.cos(), turn.sin(), torch.zeros_like(turn)], 1))


@pytest.mark.parametrize(("count", "rings"), [(7, 1), (19, 2), (36, 3), (40, 3), (57, 4), (66, 4), (331, 10)])
def test_start_disks_have_the_number_of_rings_that_comes_nearest(count: int, rings: int) -> None:
    """With n rings there are 1 + 3 n (n + 1) vertices; they are made where that is within a tenth."""
    vertices, topology = start_surface([circle()], count)
    assert topology.num_vertices == 1 + 3 * rings * (rings + 1)
    rim = vertices[topology.is_boundary_vertex]
    assert len(rim) == 6 * rings
    inner = torch.nonzero(~topology.is_boundary_vertex).squeeze(1)
    for vertex in inner.tolist():
        ends = topology.edges[(topology.edges == vertex).any(1)].flatten()
        torch.testing.assert_close(vertices[ends[ends != vertex]].mean(0), vertices[vertex], atol=1e-12, rtol=0)


def test_start_disks_have_a_boundary_vertex_for_every_corner() -> None:
    turn = torch.arange(11, dtype=DOUBLE) * (math.tau / 11)
    star = torch.where(torch.arange(11) % 2 == 0, 1.0, 0.5).to(DOUBLE)
    places = torch.stack([star * turn.cos(), star * turn.sin(), torch.zeros_like(turn)], 1)
    curve = ClosedCurve(places, corners=range(11))
    vertices, topology = start_surface([curve], 7)
    assert float(torch.cdist(places, vertices[topology.is_boundary_vertex]).min(1).values.max()) < 1e-9


@pytest.mark.parametrize("count", [300, 2000])
def test_start_annuli_have_the_number_of_vertices_and_even_triangles(count: int) -> None:
    """Between circles of a tube all triangles are alike."""
    lower = circle()
    upper = ClosedCurve(lower.at(lower.knots) + torch.tensor([0.0, 0.0, 2.0], dtype=DOUBLE))
    vertices, topology = start_surface([lower, upper], count)
    assert topology.num_vertices == pytest.approx(count, rel=0.1)
    lengths = edge_lengths(vertices, topology)
    level = (vertices[topology.edges][..., 2].diff(dim=1).abs() < 1e-9).squeeze(1)
    assert float(lengths[level].mean() / lengths[~level].mean()) == pytest.approx(1.0, abs=0.08)


def test_faces_that_are_warped_now_are_told_of() -> None:
    """Only where they were nearly planar: C is lowered on triangles."""
    flat, nearly, bent = ({"largest_planarity_of_all": value} for value in (1e-9, 4e-3, 0.1))
    for before, after, told in ((flat, bent, True), (nearly, bent, True), (bent, bent, False), (flat, nearly, False)):
        assert (len(warp_notes(before, after)) == 1) is told
    (note,) = warp_notes(flat, bent)
    assert "warped by up to 0.1" in note
