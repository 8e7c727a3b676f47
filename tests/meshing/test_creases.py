"""Creases of a surface: found, kept as lines or as cuts, and what each step does about them."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch
from creased_shapes import box, can, drilled_box, fading_fold, folded_sheet, pyramid, tunnel_on_a_plane
from helpers import grid_faces, random_rotation
from meshing_tools import irregular

from torchfair import MeshError, Topology
from torchfair._graph import connected
from torchfair.creases import crease_edges
from torchfair.fields import FaceFrames
from torchfair.fields.direction_field import WEAK
from torchfair.geometry import dihedral_angles, face_areas
from torchfair.meshing import MeshingSettings, QuadMesh, combing, principal_quads
from torchfair.meshing.bridges import cut_bridges
from torchfair.meshing.creases import find_creases, sharp_edges
from torchfair.meshing.mesh_creases import MeshCreases
from torchfair.meshing.polygon_edits import PolygonEdits
from torchfair.meshing.surface import components_of
from torchfair.meshing.verification import shape_of, verify_creases
from torchfair.shapes import PrincipalParaboloid, Torus

SHARP = math.radians(40)
SHAPES = {
    "box": box(),
    "plate with a hole": drilled_box(),
    "can": can(),
    "can with a leaning lid": can(0.7),
    "folded sheet": folded_sheet(),
    "tunnel": tunnel_on_a_plane(),
    "pyramid": pyramid(),
    "fading fold": fading_fold(),
}
SLOW = {"plate with a hole", "can", "tunnel"}
NOT_ALL_LINES = {"can with a leaning lid", "pyramid", "fading fold"}


def is_crease(mesh: QuadMesh) -> np.ndarray:
    """(I,) inner edges along creases."""
    known = {tuple(pair) for pair in mesh.creases.edges.tolist()}
    return np.array([tuple(sorted(pair)) in known for pair in mesh.topology.interior_edges.tolist()])


def parts(topology: Topology, crease: np.ndarray) -> int:
    """How many pieces a surface falls into where it is cut along creases."""
    return int(connected(topology.interior_edge_faces.numpy()[~crease], topology.num_faces).max()) + 1


def points_to(segments: torch.Tensor, point: torch.Tensor) -> float:
    """Distance of a point from segments."""
    start, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    place = (((point - start) * along).sum(1) / along.square().sum(1)).clamp(0, 1)
    return float((point - start - place[:, None] * along).norm(dim=1).min())


@pytest.mark.parametrize("name", [pytest.param(n, marks=[pytest.mark.slow] * (n in SLOW)) for n in SHAPES])
def test_creases_of_the_surface_are_edges_of_the_mesh(name: str) -> None:
    vertices, topology = SHAPES[name]
    found = principal_quads(vertices, topology, count=500 if name == "plate with a hole" else 150)
    assert found.notes == []
    assert shape_of(found.topology) == shape_of(topology)
    made = found.vertices[found.creases.edges]
    off = max(points_to(found.creases.given, end) for end in made.reshape(-1, 3))
    assert off < 1e-9 * found.report["mean_edge"]
    sharp = np.zeros(topology.num_interior_edges, bool)
    sharp[crease_edges(vertices, topology, SHARP)] = True
    crease = is_crease(found)
    assert crease.sum() == len(found.creases.edges) == found.report["crease_edges"] > 0
    assert parts(found.topology, crease) == parts(topology, sharp)  # no face lies on both sides of a crease
    frames = FaceFrames.of(vertices, topology)
    wanted = find_creases(frames, sharp, SHARP, 0.0)
    corners = vertices[torch.from_numpy(wanted.corners)]
    assert all(float((found.vertices - corner).norm(dim=1).min()) < 1e-12 for corner in corners)
    lengths = [float((x[:, 1] - x[:, 0]).norm(dim=1).sum()) for x in (made, found.creases.given)]
    assert lengths[0] == pytest.approx(lengths[1], rel=0.04)
    assert found.topology.is_quadrangular == (name not in NOT_ALL_LINES)


def smallest_at(mesh: QuadMesh, curves: set[int]) -> float:
    """Area over the mean of the smallest face with one of some vertices."""
    areas = face_areas(mesh.vertices, mesh.topology)
    touching = [not curves.isdisjoint(face) for face in mesh.topology.face_lists()]
    return float(areas[torch.tensor(touching)].min() / areas.mean())


def test_the_smallest_face_at_curves_is_one_at_creases_or_at_the_boundary() -> None:
    solid = principal_quads(*SHAPES["pyramid"], count=60)
    on_creases = set(solid.creases.edges.flatten().tolist())
    assert solid.report["smallest_curve_face"] == pytest.approx(smallest_at(solid, on_creases))
    sheet = principal_quads(*SHAPES["folded sheet"], count=60)
    on_both = set(sheet.creases.edges.flatten().tolist())
    on_both |= set(torch.nonzero(sheet.topology.is_boundary_vertex).flatten().tolist())
    assert sheet.report["smallest_curve_face"] == pytest.approx(smallest_at(sheet, on_both))
    ring = irregular(Torus(), 600)
    assert principal_quads(*ring, count=150).report["smallest_curve_face"] is None


def test_a_box_has_its_corners_and_edges_wherever_it_is() -> None:
    vertices, topology = box()
    turned = vertices @ random_rotation(3).T * 1e3 + 500
    for points in (vertices, turned):
        found = principal_quads(points, topology, count=150)
        assert found.report["singular"] == {"0.25": 8}
        assert found.report["faces"] == 150
        angles = dihedral_angles(found.vertices, found.topology).abs().numpy()
        assert np.abs(angles[is_crease(found)] - math.pi / 2).max() < 1e-6
        assert angles[~is_crease(found)].max() < 1e-6
        assert found.report["crease_distance_max"] < 1e-9
        assert float(face_areas(found.vertices, found.topology).sum()) == pytest.approx(
            float(face_areas(points, topology).sum())
        )


def test_a_cube_of_twelve_triangles_can_be_six_quads() -> None:
    found = principal_quads(*box(2), count=6)
    assert found.topology.num_faces == 6
    assert found.topology.is_quadrangular
    assert len(found.creases.edges) == 12


def test_an_angle_of_zero_and_smooth_surfaces_have_no_creases() -> None:
    assert not components_of(*folded_sheet(), 0.0)[0].sharp.any()
    assert components_of(*folded_sheet(), SHARP)[0].sharp.any()
    smooth = irregular(Torus(), 800)
    assert not sharp_edges(*smooth, MeshingSettings().crease_angle).any()
    found = principal_quads(*smooth, count=200)
    assert (found.report["crease_edges"], found.report["crease_distance_max"]) == (0, 0)


def test_noise_is_no_crease() -> None:
    vertices, topology = irregular(PrincipalParaboloid(1.0, -0.5, (0.8, 0.8)), 700)
    shift = torch.randn(vertices.shape, generator=torch.Generator().manual_seed(0), dtype=vertices.dtype)
    rough = vertices + 0.015 * shift
    assert len(crease_edges(rough, topology, SHARP)) > 20
    assert not sharp_edges(rough, topology, SHARP).any()
    assert sharp_edges(*fading_fold(), SHARP).any()  # its two loose ends are none of noise


def test_chains_end_at_corners() -> None:
    vertices, topology = box(4)
    frames = FaceFrames.of(vertices, topology)
    found = find_creases(frames, sharp_edges(vertices, topology, SHARP), SHARP, 0.0)
    assert (len(found.chains), int(found.corners.sum())) == (12, 8)
    for chain in found.chains:
        assert not chain.closed
        ends = np.stack([chain.vertices[:-1], chain.vertices[1:]], 1)
        assert np.array_equal(np.sort(frames.edges[chain.edges], 1), np.sort(ends, 1))
        forward = chain.forward(frames)
        assert np.array_equal(frames.edges[chain.edges, (~forward).astype(int)], chain.vertices[:-1])
    vertices, topology = can()
    found = find_creases(FaceFrames.of(vertices, topology), sharp_edges(vertices, topology, SHARP), SHARP, 0.0)
    assert [chain.closed for chain in found.chains] == [True, True]
    vertices, topology = fading_fold()
    frames, sharp = FaceFrames.of(vertices, topology), sharp_edges(vertices, topology, SHARP)
    assert len(find_creases(frames, sharp, SHARP, 0.1).chains) == 1
    assert len(find_creases(frames, sharp, SHARP, 10.0).chains) == 0  # shorter than an edge of the new mesh


def test_curvature_does_not_reach_across() -> None:
    """A tunnel of radius 1/2 that rises from a plane: curvatures 2 and 0, up to the crease."""
    (surface,) = components_of(*tunnel_on_a_plane(), SHARP)
    directions, fitted = surface.directions("auto")
    assert fitted.rings == 2
    flat = np.abs(surface.frames.normals[:, 2]) > 1 - 1e-9
    flat &= np.abs(surface.frames.centres[:, 0]) > 0.5
    assert np.abs(directions.values[flat]).max() < 1e-6
    assert np.abs(np.abs(directions.values[~flat]) - 1).max() < 0.1
    across, _ = surface.without_creases().directions("auto")
    assert np.abs(across.values[flat]).max() > 0.3


def test_no_triangle_has_all_its_corners_on_creases() -> None:
    for vertices, topology in (box(2), can(around=16)):
        sharp = sharp_edges(vertices, topology, SHARP)
        points, finer, kept = cut_bridges(vertices, topology, sharp)
        assert shape_of(finer) == shape_of(topology)
        assert kept.sum() == sharp.sum()
        assert float(face_areas(points, finer).sum()) == pytest.approx(float(face_areas(vertices, topology).sum()))
        on_crease = np.zeros(len(points), bool)
        on_crease[finer.interior_edges.numpy()[kept]] = True
        inner = finer.interior_edges.numpy()[~kept]
        assert not on_crease[inner].all(1).any()
        assert torch.equal(points[: len(vertices)], vertices)
    plain = irregular(Torus(), 300)
    assert cut_bridges(*plain, np.zeros(plain[1].num_interior_edges, bool))[1] is plain[1]


def strip() -> PolygonEdits:
    """Three columns of four quads with a crease between the second and the third row of vertices."""
    x, y = np.meshgrid(np.arange(5), np.arange(4), indexing="ij")
    positions = np.stack([x.ravel(), y.ravel(), 0 * x.ravel()], 1).astype(float)
    outer = (x == 0) | (y == 0) | (x == 4) | (y == 3)
    line = np.arange(5) * 4 + 1
    creases = np.stack([line[:-1], line[1:]], 1)
    fixed = np.zeros(20, bool)
    fixed[line[[0, -1]]] = True
    return PolygonEdits(positions, grid_faces(5, 4).tolist(), outer.ravel(), fixed, creases)


def test_edges_collapse_along_creases_and_onto_them_only() -> None:
    edits = strip()
    assert edits.collapse((5, 9))
    assert sum(map(len, edits.beside.values())) == 2 * 3
    assert not edits.collapse((4, edits.place_of(5)))  # from the crease to the boundary
    assert edits.collapse((14, 13))
    assert 14 not in edits.around
    assert 13 in edits.around
    edits = strip()
    assert edits.collapse((1, 5))
    assert edits.place_of(5) == 1
    assert edits.beside[1] == {9}
    assert edits.beside[9] == {1, 13}


def test_faces_are_not_merged_across_creases() -> None:
    edits = strip()
    number = next(n for n, face in edits.faces.items() if {5, 9, 4, 8} == set(face))
    crease = next(edge for edge in edits.sides(number) if set(edge) == {5, 9})
    assert edits.across(crease, number) is not None
    assert not edits.merge(number, crease)
    other = next(edge for edge in edits.sides(number) if set(edge) == {8, 9})
    assert edits.merge(number, other)


def test_verification_of_creases() -> None:
    vertices, topology = box(4)
    wanted = find_creases(FaceFrames.of(vertices, topology), sharp_edges(vertices, topology, SHARP), SHARP, 0.0)
    edges = np.sort(topology.interior_edges.numpy()[wanted.edges], axis=1)
    verify_creases(topology, edges, wanted)
    with pytest.raises(MeshError, match="end and meet"):
        verify_creases(topology, edges[1:], wanted)
    far = np.array([[0, topology.num_vertices - 1]])
    with pytest.raises(MeshError, match="not be an edge"):
        verify_creases(topology, np.concatenate([edges, far]), wanted)


def test_distances_are_measured_both_ways() -> None:
    given = torch.tensor([[[0.0, 0, 0], [1, 0, 0]], [[1, 0, 0], [3, 0, 0]]])
    vertices = torch.tensor([[0.0, 0, 0], [1, 0.5, 0], [2, 0, 0]])
    assert MeshCreases(torch.tensor([[0, 1], [1, 2]]), given).distance(vertices) == pytest.approx(1.0)  # the end at 3
    assert MeshCreases(torch.tensor([[0, 1], [1, 2]]), given[:1]).distance(vertices) == pytest.approx(1.0)

    assert MeshCreases(torch.zeros((0, 2), dtype=torch.int64), given).distance(vertices) == 0.0


def test_the_length_of_creases_does_not_count_how_finely_they_are_cut() -> None:
    ends = torch.tensor([[[0.0, 0, 0], [3, 4, 0]], [[3.0, 4, 0], [3, 4, 2]]], dtype=torch.float64)
    middles = ends.mean(1, keepdim=True)
    halves = torch.cat([torch.cat([ends[:, :1], middles], 1), torch.cat([middles, ends[:, 1:]], 1)])
    none = torch.zeros((0, 2), dtype=torch.int64)
    assert MeshCreases(none, ends).length == pytest.approx(7.0)
    assert MeshCreases(none, halves).length == pytest.approx(7.0)
    assert MeshCreases(none, ends[:0]).length == 0.0


@pytest.mark.parametrize("seed", [1, 2])
def test_axes_of_bodies_without_a_longest_one_run_along_creases(seed: int) -> None:
    """Of all directions that of an edge of the cube; of a plane the nearest to one; whatever the basis is."""
    vertices, topology = box(4)
    turn, basis = random_rotation(seed).numpy(), random_rotation(seed + 5).numpy()
    turned = vertices @ torch.from_numpy(turn.T)
    frames = FaceFrames.of(turned, topology)
    creases = find_creases(frames, sharp_edges(turned, topology, SHARP), SHARP, 0.0)
    axis = combing._among(basis, frames, creases)
    assert sorted(np.abs(axis @ turn)) == pytest.approx([0, 0, 1], abs=1e-12)
    assert np.abs(axis @ combing._among(turn, frames, creases)) == pytest.approx(1, abs=1e-12)
    plane = turn @ np.array([[1.0, 0, 0], [0, 0.8, 0.6]]).T  # holds the first edge of the cube
    assert np.abs(combing._among(plane, frames, creases) @ turn[:, 0]) == pytest.approx(1, abs=1e-12)


def test_meshes_of_cubes_are_chosen_by_no_rounding() -> None:
    """Moments that differ in their last digits say nothing."""
    vertices, topology = box(2)
    axes = []
    for shift in (0.0, 1e-13, -1e-13):
        moved = vertices * torch.tensor([1.0, 1.0 + shift, 1.0 + 2 * shift], dtype=torch.float64)
        frames = FaceFrames.of(moved, topology)
        creases = find_creases(frames, sharp_edges(moved, topology, SHARP), SHARP, 0.0)
        pull = combing._along_the_longest_axis(frames, creases)
        axes.append(pull.weights * np.exp(2j * pull.angles))
    assert all(np.abs(axis - axes[0]).max() < 1e-9 * WEAK for axis in axes)
