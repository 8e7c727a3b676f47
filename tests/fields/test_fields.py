"""Frames, principal directions, fields and their singular vertices."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from helpers import random_rotation, wavy_grid
from meshing_tools import Flat, MonkeySaddle, ellipsoid, irregular, nearest, punched
from torch import Tensor

from torchfair import MeshError, Topology
from torchfair.fields import (
    Directions,
    FaceFrames,
    Symmetry,
    carried_directions,
    direction_field,
    directions_of,
    loop_charges,
    matchings,
    merge_singularities,
    vertex_charges,
)
from torchfair.fields.matchings import QUARTER, differences
from torchfair.shapes import PrincipalParaboloid, Torus, icosphere, irregular_triangles
from torchfair.subdivision import midpoint

SADDLE = PrincipalParaboloid(1.0, -0.5, (0.8, 0.8))


def field(
    vertices: Tensor, topology: Topology, symmetry: Symmetry = 4, smoothing: float = 0.05
) -> tuple[FaceFrames, Directions, np.ndarray, np.ndarray]:
    frames = FaceFrames.of(vertices, topology)
    directions = directions_of(frames)
    angles = direction_field(frames, directions, smoothing, symmetry)
    return frames, directions, angles, matchings(frames, angles, symmetry)


def test_frames_are_orthonormal_and_counterclockwise() -> None:
    frames = FaceFrames.of(*wavy_grid(triangles=True))
    axes = np.stack([frames.first, frames.second, frames.normals], axis=1)
    assert np.allclose(axes @ axes.transpose(0, 2, 1), np.eye(3), atol=1e-14)
    assert np.allclose(np.linalg.det(axes), 1)


def test_corners_and_angles_of_edges_are_those_of_the_faces() -> None:
    frames = FaceFrames.of(*wavy_grid(triangles=True))
    along = frames.points[frames.edges[:, 1]] - frames.points[frames.edges[:, 0]]
    for side in (0, 1):
        face, corner = frames.faces[:, side], frames.corners[:, side]
        assert (frames.triangles[face, corner] == frames.edges[:, side]).all()
        assert (frames.triangles[face, (corner + 1) % 3] == frames.edges[:, 1 - side]).all()
        angle = frames.edge_angles[:, side][:, None]
        rebuilt = np.cos(angle) * frames.first[face] + np.sin(angle) * frames.second[face]
        assert np.allclose(rebuilt * frames.lengths[:, None], along, atol=1e-12)


def test_gradients_of_a_linear_function() -> None:
    frames = FaceFrames.of(*wavy_grid(triangles=True))
    slope = np.array([0.3, -1.2, 0.5])
    found = ((frames.points @ slope)[frames.triangles] * frames.gradients).sum(1)
    assert np.allclose(found.real, frames.first @ slope)
    assert np.allclose(found.imag, frames.second @ slope)


def test_a_mesh_of_quads_is_refused() -> None:
    with pytest.raises(MeshError, match="triangle mesh is needed"):
        FaceFrames.of(*wavy_grid())


@pytest.mark.parametrize("surface", [Torus(), SADDLE], ids=["torus", "saddle"])
def test_directions_are_those_of_the_surface(surface: Torus | PrincipalParaboloid) -> None:
    mesh = irregular_triangles(surface, 2000)
    frames = FaceFrames.of(mesh.vertices, mesh.topology)
    directions = directions_of(frames)
    middle = mesh.principal_directions[:, 0][mesh.topology.triangles[:, 0]].numpy()
    exact = np.arctan2((middle * frames.second).sum(1), (middle * frames.first).sum(1))
    off = np.angle(directions.values * np.exp(-2j * exact)) / 2  # not up to quarter turns: the larger curvature
    assert np.degrees(np.median(np.abs(off))) < 1.5  # within a triangle directions turn by as much
    curvatures = mesh.principal_curvatures[mesh.topology.triangles].mean(1).numpy()
    assert np.median(np.abs(np.abs(directions.values) - (curvatures[:, 0] - curvatures[:, 1]) / 2)) < 0.03
    assert np.median(np.abs(directions.means - curvatures.mean(1))) < 0.03


def test_there_is_no_confidence_on_spheres_and_planes() -> None:
    sphere = icosphere(3)
    flat, topology = wavy_grid(triangles=True)
    flat = flat * torch.tensor([1.0, 1, 0])
    for vertices, connectivity in ((sphere.vertices, sphere.topology), (flat, topology)):
        frames = FaceFrames.of(vertices, connectivity)
        assert directions_of(frames).confidence.max() < 0.1
    vertices, connectivity = irregular(SADDLE)
    frames = FaceFrames.of(vertices, connectivity)
    found = directions_of(frames).confidence
    assert 0.5 < np.median(found) <= found.max() <= 1.5


def test_directions_of_finer_triangles_are_linear_in_those_that_they_lie_in() -> None:
    vertices, topology = irregular(SADDLE, 200)
    frames = FaceFrames.of(vertices, topology)
    directions = directions_of(frames)
    finer = midpoint(topology)
    fine = FaceFrames.of(finer.apply(vertices), finer.topology)
    parents = finer.face_parents.numpy()
    carried = carried_directions(directions, frames, fine, parents)

    def in_space(values: np.ndarray, frame: FaceFrames) -> np.ndarray:
        plane = np.stack([values.real, values.imag, values.imag, -values.real], -1).reshape(*values.shape, 2, 2)
        axes = np.stack([frame.first, frame.second], 1).reshape(-1, *[1] * (values.ndim - 1), 2, 3)
        return np.swapaxes(axes, -1, -2) @ plane @ axes

    found, given = in_space(carried.at_corners, fine), in_space(directions.at_corners, frames)
    for child, parent in enumerate(parents[:40]):  # at an old vertex that of its corner, at a new one a mean of two
        middles = (given[parent] + np.roll(given[parent], -1, axis=0)) / 2
        expected = np.concatenate([given[parent], middles]).reshape(6, -1)
        corners = frames.points[frames.triangles[parent]]
        places = np.concatenate([corners, (corners + np.roll(corners, -1, axis=0)) / 2])
        at = ((fine.points[fine.triangles[child]][:, None] - places) ** 2).sum(-1).argmin(1)
        assert np.allclose(found[child].reshape(3, -1), expected[at], atol=1e-12)
    assert np.allclose(in_space(carried.values, fine)[parents == 7].mean(0), in_space(directions.values, frames)[7])


@pytest.mark.parametrize("symmetry", [2, 4])
@pytest.mark.parametrize("holes", [0, 1, 2])
def test_indices_sum_to_the_euler_number(symmetry: Symmetry, holes: int) -> None:
    sphere = icosphere(3)
    vertices, topology = punched(sphere.vertices, sphere.topology, *range(0, 30 * holes, 30))
    frames, _, angles, matched = field(vertices, topology, symmetry)
    charges, loops = vertex_charges(frames, angles, matched), loop_charges(frames, angles, matched)
    euler_number = topology.num_vertices - topology.num_edges + topology.num_faces
    assert euler_number == 2 - holes
    assert len(loops) == holes
    assert np.abs(loops - np.rint(loops)).max(initial=0) < 1e-9
    assert charges.sum() + loops.sum() == pytest.approx(4 * euler_number)
    assert (charges % (4 // symmetry) == 0).all()


def test_the_sum_holds_for_any_field() -> None:
    vertices, topology = punched(*ellipsoid(3), 0, 40)
    frames = FaceFrames.of(vertices, topology)
    angles = np.random.default_rng(0).uniform(-3, 3, len(frames.triangles))
    matched = matchings(frames, angles)
    assert np.abs(differences(frames, angles) - QUARTER * matched).max() <= QUARTER / 2 + 1e-12
    total = vertex_charges(frames, angles, matched).sum() + loop_charges(frames, angles, matched).sum()
    assert total == pytest.approx(0, abs=1e-9)


def test_torus_and_saddle_have_no_singular_vertices() -> None:
    for surface in (Torus(), SADDLE):
        frames, _, angles, matched = field(*irregular(surface))
        assert not vertex_charges(frames, angles, matched).any()


def test_an_ellipsoid_has_four_umbilics() -> None:
    mesh = ellipsoid()
    frames, _, angles, matched = field(*mesh)
    charges = vertex_charges(frames, angles, matched)
    assert np.unique(charges[charges != 0]).tolist() == [1]
    assert np.count_nonzero(charges) == 8
    frames, _, angles, matched = field(*mesh, symmetry=2)
    charges = vertex_charges(frames, angles, matched)
    assert charges[charges != 0].tolist() == [2] * 4


def test_fields_do_not_depend_on_motion_scale_and_numbering() -> None:
    vertices, topology = irregular(MonkeySaddle())
    frames, _, angles, matched = field(vertices, topology)
    charges = vertex_charges(frames, angles, matched)
    moved = 1e3 * vertices @ random_rotation(3).T + 7
    frames, _, angles, matched = field(moved, topology, smoothing=50.0)
    assert (vertex_charges(frames, angles, matched) == charges).all()
    order = torch.randperm(topology.num_vertices, generator=torch.Generator().manual_seed(1))
    number = order.argsort()
    faces = number[topology.triangles].roll(1, 1).flip(0)
    frames, _, angles, matched = field(vertices[order], Topology.from_faces(faces))
    assert (vertex_charges(frames, angles, matched)[number] == charges).all()


def test_singular_vertices_of_a_monkey_saddle_are_merged() -> None:
    frames, directions, angles, matched = field(*irregular(MonkeySaddle()))
    before = vertex_charges(frames, angles, matched)
    assert before[before != 0].tolist() == [-1, -1]
    same = merge_singularities(frames, angles, matched, directions, 0.05, 1e-3)
    assert same[0] is angles
    assert same[1] is matched
    angles, matched = merge_singularities(frames, angles, matched, directions, 0.05, 0.5)
    after = vertex_charges(frames, angles, matched)
    assert after[after != 0].tolist() == [-2]
    assert np.abs(frames.points[after != 0][:, :2]).max() < 0.2
    turning = differences(frames, angles) - QUARTER * matched
    assert np.abs(turning).max() < QUARTER  # angles have followed the matchings


@pytest.mark.parametrize(("symmetry", "charge"), [(2, 2), (4, 1)])
def test_where_no_three_faces_would_meet_singular_vertices_are_split(symmetry: Symmetry, charge: int) -> None:
    """Around a pole directions turn once: a whole index. Fewer than three triangles, or quads, would meet there."""
    vertices, topology = irregular(Flat(), 600)
    frames = FaceFrames.of(vertices, topology)
    pole = nearest(vertices, (0.05, -0.02))[0]
    away = frames.centres - frames.points[pole]
    angles = np.arctan2((away * frames.second).sum(1), (away * frames.first).sum(1))
    matched = matchings(frames, angles, 2)
    charges = vertex_charges(frames, angles, matched)
    assert charges[pole] == 4 == np.abs(charges).sum()
    none = np.zeros(len(frames.triangles))
    directions = Directions(np.zeros((len(none), 3), complex), none, none)
    angles, matched = merge_singularities(frames, angles, matched, directions, 0.05, 0.3, symmetry)
    charges = vertex_charges(frames, angles, matched)
    singular = np.flatnonzero(charges)
    assert (charges[singular] == charge).all()
    assert charges.sum() == 4
    places = frames.points[singular]
    apart = np.linalg.norm(places[:, None] - places, axis=-1) + np.eye(len(places))
    assert apart.min() > 0.2


def test_opposite_singular_vertices_cancel() -> None:
    frames = FaceFrames.of(*irregular(SADDLE))
    directions = directions_of(frames)
    angles = direction_field(frames, directions, 0.05, 4)
    matched = matchings(frames, angles)
    inner = np.flatnonzero(~frames.is_boundary[frames.edges].any(1))
    matched[inner[len(inner) // 2]] += 1
    charges = vertex_charges(frames, angles, matched)
    assert sorted(charges[charges != 0].tolist()) == [-1, 1]
    angles, matched = merge_singularities(frames, angles, matched, directions, 0.05, 0.2)
    assert not vertex_charges(frames, angles, matched).any()


def test_singular_vertices_move_onto_corners_nearby_that_have_no_index() -> None:
    frames, directions, angles, matched = field(*ellipsoid(3))
    charges = vertex_charges(frames, angles, matched)
    singular = np.flatnonzero(charges)
    beside = [int(frames.edges[(frames.edges == vertex).any(1)].sum(1)[0] - vertex) for vertex in singular[:2]]
    stay = np.zeros(len(charges), bool)
    stay[[*beside, singular[2]]] = True  # the last has an index already
    angles, matched = merge_singularities(frames, angles, matched, directions, 0.05, 5.0, 4, stay)
    after = vertex_charges(frames, angles, matched)
    assert np.flatnonzero(after).tolist() == sorted([*beside, *singular[2:].tolist()])
    assert (after[beside] == charges[singular[:2]]).all()
