"""Spacings that follow curvature, as tensors and in meshes."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from helpers import random_rotation
from meshing_tools import Flat, irregular, side_by_side

from torchfair.fields import Directions, FaceFrames, directions_of
from torchfair.meshing import MeshingSettings, principal_quads, principal_triangles
from torchfair.meshing.boundary_runs import find_runs
from torchfair.meshing.combing import combed
from torchfair.meshing.curvature_sizes import curvature_sizes, gradation_length
from torchfair.meshing.row_distances import EQUILATERAL, row_sizes
from torchfair.meshing.sizes import SizeField
from torchfair.meshing.verification import shape_of
from torchfair.shapes import Catenoid, Cylinder, Hyperboloid, PrincipalParaboloid, Torus, icosphere
from torchfair.subdivision import midpoint

ADAPTIVE = MeshingSettings(adaptive=True)
HYPERBOLOID = irregular(Hyperboloid(0.5, 1.2, heights=(-0.6, 2.0)), 900)


def frames_of(vertices: torch.Tensor, topology: object) -> FaceFrames:
    return FaceFrames.of(vertices, topology)  # type: ignore[arg-type]


def random_field(frames: FaceFrames, seed: int = 0) -> SizeField:
    random = np.random.default_rng(seed)
    count = len(frames.areas)
    return SizeField(random.normal(size=count), random.normal(size=count) * np.exp(1j * random.normal(size=count)))


def test_logarithms_along_a_direction() -> None:
    """Those of a tensor R diag(a, b) R^T: n^T S n along n and across."""
    turn, a, b = 0.4, 0.7, -0.2
    field = SizeField(np.array([(a + b) / 2]), np.array([(a - b) / 2 * np.exp(2j * turn)]))
    assert np.allclose(field.along(np.array([turn])), [[a, b]])
    assert np.allclose(field.along(np.array([turn - math.pi / 2])), [[b, a]])
    axes = np.array([[math.cos(turn), -math.sin(turn)], [math.sin(turn), math.cos(turn)]])
    tensor, n = axes @ np.diag([a, b]) @ axes.T, np.array([math.cos(1.1), math.sin(1.1)])
    assert field.along(np.array([1.1]))[0, 0] == pytest.approx(n @ tensor @ n)
    assert (field.smallest, field.largest) == pytest.approx((b, a))


def test_averages_stay_in_the_range_and_keep_the_mean() -> None:
    frames = frames_of(*irregular(Torus(), 600))
    before = random_field(frames)
    after = before.smoothed(frames, 0.3)
    assert before.smallest < after.smallest < after.largest < before.largest
    assert frames.areas @ after.means == pytest.approx(frames.areas @ before.means)
    near = before.smoothed(frames, 1e-4)
    assert np.allclose(near.values, before.values, atol=1e-3)
    one = SizeField(np.full(len(frames.areas), 0.3), np.zeros(len(frames.areas), complex))
    assert np.allclose(one.smoothed(frames, 0.3).means, 0.3)


def test_averages_know_nothing_of_frames() -> None:
    """Renumbering the corners of triangles turns their frames: values turn with them."""
    vertices, topology = irregular(Torus(), 400)
    frames = frames_of(vertices, topology)
    other = frames_of(vertices, type(topology).from_faces(topology.triangles.roll(1, 1)))
    turns = np.angle((frames.first * other.first).sum(1) + 1j * (frames.first * other.second).sum(1))
    field = random_field(frames)
    again = SizeField(field.means, field.values * np.exp(2j * turns)).smoothed(other, 0.4)
    assert np.allclose(again.values, field.smoothed(frames, 0.4).values * np.exp(2j * turns))


def test_logarithms_grow_no_faster_than_the_gradation() -> None:
    """A step of log 4 becomes log 2 (1 - exp(-|x| / L)) on both sides: at most log 1.25 steeper over a spacing."""
    frames = frames_of(*irregular(Flat(), 1500))
    x, spacing = frames.centres[:, 0], 0.1
    length = gradation_length(4.0) * spacing
    assert math.log(4) / (2 * length) == pytest.approx(math.log(1.25) / spacing)
    step = SizeField(np.sign(x) * math.log(2), np.zeros(len(x), complex))
    means = step.smoothed(frames, length).means
    inside = (np.abs(x) > 0.03) & (np.abs(x) < 0.3)
    ends = 2 * math.cosh(1 / length)  # no gradient across the sides of the square
    exact = np.sign(x) * math.log(2) * (1 - 2 * np.cosh((1 - np.abs(x)) / length) / ends)
    assert np.abs(means - exact)[inside].max() < 0.03
    f, g = frames.faces.T
    apart = np.linalg.norm(frames.centres[f] - frames.centres[g], axis=1)
    steep = np.abs(means[f] - means[g]) / apart
    assert np.quantile(steep, 0.99) < 1.1 * math.log(1.25) / spacing


def test_spacings_of_spheres_go_with_the_root_of_the_radius() -> None:
    """Radii 1 and 1/4: lengths 2 to 1, within a range of 1.5 just that, in cells as many as uniform ones."""
    ball = icosphere(3)
    vertices, topology = side_by_side((ball.vertices, ball.topology), (ball.vertices / 4, ball.topology))
    frames = frames_of(vertices, topology)
    directions, half = directions_of(frames), topology.num_faces // 2
    for longest, expected, limited in ((9.0, 2.0, 0), (1.5, 1.5, 1 / 17)):
        found = curvature_sizes(frames, directions, 0.1, longest)
        means = found.field.means
        ratio = np.exp(means[:half].mean() - means[half:].mean())
        assert ratio == pytest.approx(expected, rel=0.01)
        assert frames.areas @ np.exp(-2 * means) == pytest.approx(frames.areas.sum())
        assert found.limited == pytest.approx(limited, abs=0.01)
        assert found.field.largest - found.field.smallest <= math.log(longest) + 1e-12


def test_spacings_of_a_cylinder_are_long_along_it() -> None:
    """The smaller curvature counts as a quarter of the larger at least: lengths sqrt(sqrt(1 + 1/16) / (1/4)) to 1."""
    frames = frames_of(*irregular(Cylinder(), 800))
    directions = directions_of(frames)
    vertical = np.angle(frames.first[:, 2] + 1j * frames.second[:, 2])
    along, across = curvature_sizes(frames, directions, 0.2, 9.0).field.along(vertical).T
    assert np.exp(along - across).mean() == pytest.approx(math.sqrt(math.sqrt(17)), rel=0.01)
    isotropic = curvature_sizes(frames, directions, 0.2, 9.0, isotropic=True).field
    assert np.abs(isotropic.values).max() < 1e-12


def test_a_flat_surface_has_one_spacing() -> None:
    frames = frames_of(*irregular(Flat(), 300))
    count = len(frames.areas)
    flat = Directions(np.zeros((count, 3), complex), np.zeros(count), np.zeros(count))
    field = curvature_sizes(frames, flat, 0.1, 4.0).field
    assert field.largest == pytest.approx(0, abs=1e-12)
    assert field.smallest == pytest.approx(0, abs=1e-12)


def test_sizes_are_those_of_the_finer_triangles_too() -> None:
    vertices, topology = irregular(Torus(), 300)
    finer = midpoint(topology)
    frames, fine = frames_of(vertices, topology), frames_of(finer.apply(vertices), finer.topology)
    parents = finer.face_parents.numpy()
    field = random_field(frames)
    carried = field.carried(frames, fine, parents)
    axis = frames.first[parents]
    angles = np.angle((axis * fine.first).sum(1) + 1j * (axis * fine.second).sum(1))
    assert np.allclose(carried.along(angles), field.along(np.zeros(len(frames.areas)))[parents])


def test_runs_are_as_long_as_the_spacing_beside_them() -> None:
    frames = frames_of(*irregular(PrincipalParaboloid(1.0, -0.5, (0.8, 0.8))))
    graph = combed(frames, directions_of(frames), 4, 0.05, 0.2)
    everywhere = np.full(len(frames.areas), 0.3)
    assert len(find_runs(frames, graph, 0.2, everywhere)) == 4
    everywhere[frames.centres[:, 0] > 0.6] = 99.0
    assert len(find_runs(frames, graph, 0.2, everywhere)) == 3


def test_a_range_of_one_is_the_uniform_mesh() -> None:
    uniform = principal_quads(*HYPERBOLOID, count=200)
    same = principal_quads(*HYPERBOLOID, count=200, settings=MeshingSettings(adaptive=True, spacing_range=1.0))
    assert torch.equal(same.vertices, uniform.vertices)
    assert same.topology.face_lists() == uniform.topology.face_lists()
    assert "range_share" not in uniform.report
    assert same.report["spacing_shortest"] == same.report["spacing_longest"] == same.report["spacing"]


def test_an_adaptive_mesh_is_nearer_to_the_surface() -> None:
    """Where the surface flares it is flat: with as many faces the largest distance falls by a fifth and more."""
    uniform = principal_quads(*HYPERBOLOID, count=200)
    found = principal_quads(*HYPERBOLOID, count=200, settings=ADAPTIVE)
    assert shape_of(found.topology) == shape_of(HYPERBOLOID[1])
    assert found.notes == []
    assert abs(found.report["faces"] / 200 - 1) < 0.15
    off, before = (mesh.report["distance_max"] * mesh.report["mean_edge"] for mesh in (found, uniform))
    assert off < 0.8 * before
    assert found.report["angle_mean_degrees"] < uniform.report["angle_mean_degrees"] + 0.5
    shortest, longest = (found.report[f"spacing_{which}"] for which in ("shortest", "longest"))
    assert 1.5 * shortest < longest <= 4 * shortest
    assert 0 <= found.report["range_share"] < 0.5


@pytest.mark.slow
def test_adaptive_meshes_know_no_unit() -> None:
    found = principal_quads(*HYPERBOLOID, count=200, settings=ADAPTIVE)
    turn = random_rotation(3)
    again = principal_quads(1e3 * HYPERBOLOID[0] @ turn.T + 5, HYPERBOLOID[1], count=200, settings=ADAPTIVE)
    assert again.report["faces"] == found.report["faces"]
    assert torch.cdist(1e3 * found.vertices @ turn.T + 5, again.vertices).amin(1).max() < 0.1


@pytest.mark.parametrize(("across", "sign"), [(False, 1), (True, -1)])
def test_rows_are_as_far_apart_as_the_curvature_says(across: bool, sign: int) -> None:
    """a = -b/3: E exceeds C by ``1/4 / (2 ratio^2)``, which sqrt(1/4 / 0.3) brings to 0.15; equilateral where K > 0."""
    frames = frames_of(*irregular(Flat(), 400))
    count = len(frames.areas)
    size, mean = (2.0, 1.0) if across else (2.0, -1.0)  # rows follow the curvature that is smaller in size
    there = np.angle(frames.first[:, 0] - 1j * frames.first[:, 1])  # the x-axis in the frames
    for difference, middle, expected in ((size, mean, math.sqrt(0.25 / 0.3)), (size, 3.0, EQUILATERAL)):
        values = np.tile(difference * np.exp(2j * there), (3, 1)).T
        directions = Directions(values, np.full(count, middle), np.ones(count))
        one = SizeField(np.zeros(count), np.zeros(count, complex))
        found = row_sizes(one, frames, directions, across, 1.0, 0.1)
        x, y = found.along(there).T
        assert np.allclose(sign * (y - x), math.log(expected))
        assert np.allclose(found.means, 0)


@pytest.mark.slow
@pytest.mark.parametrize("surface", [PrincipalParaboloid(1.5, -0.5, (1.0, 1.0)), Catenoid(0.5, heights=(-0.7, 0.7))])
def test_rows_lower_the_energy_where_surfaces_are_saddles(surface: object, monkeypatch: pytest.MonkeyPatch) -> None:
    vertices, topology = irregular(surface, 2000)  # type: ignore[arg-type]
    follows = principal_triangles(vertices, topology, count=600).report["variation_over_curvature"]
    adaptive = principal_triangles(vertices, topology, count=600, settings=ADAPTIVE)
    monkeypatch.setattr("torchfair.meshing.row_distances._EXCESS", 1e9)
    equilateral = principal_triangles(vertices, topology, count=600).report
    assert equilateral["row_distance"] == EQUILATERAL
    assert follows < equilateral["variation_over_curvature"] - 0.04
    assert adaptive.report["variation_over_curvature"] < equilateral["variation_over_curvature"] - 0.04
    assert adaptive.report["spacing_shortest"] < adaptive.report["spacing_longest"]
    assert adaptive.principal.exceptions.numel() == 0
