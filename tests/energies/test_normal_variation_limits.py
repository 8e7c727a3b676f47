"""Limits of E on smooth surfaces: 8 pi R, C, energies per area of lattices, with their orders."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
import torch
from geometry_meshes import (
    icosphere,
    outward_hull,
    torus,
)
from helpers import grid_faces, split_quads
from torch import Tensor

from torchfair import Topology
from torchfair.energies import (
    normal_variation,
    normal_variation_per_edge,
)


def sphere_hull(count: int) -> tuple[Tensor, Topology]:
    """Convex hull of ``count`` random points on the unit sphere."""
    points = np.random.default_rng(count).normal(size=(count, 3))
    points /= np.linalg.norm(points, axis=1, keepdims=True)
    return torch.from_numpy(points), Topology.from_faces(outward_hull(points))


def catenoid(rows: int, columns: int, bottom: float, top: float, angle: float) -> tuple[Tensor, Topology]:
    """Principal quads of the catenoid r = cosh z, bottom <= z <= top; closed around the axis if the angle is 2 pi."""
    closed = angle == 2 * math.pi
    z, u = np.meshgrid(np.linspace(bottom, top, rows + 1), np.linspace(0, angle, columns + 1), indexing="ij")
    points = np.stack([np.cosh(z) * np.cos(u), np.cosh(z) * np.sin(u), z], axis=-1)
    faces = grid_faces(rows + 1, columns + 1)
    if closed:
        points = points[:, :-1]
        row, column = np.divmod(faces, columns + 1)
        faces = row * columns + column % columns
    return torch.from_numpy(points.reshape(-1, 3)), Topology.from_faces(faces)


def lattice(half_edge: float, height: float, a: float, b: float) -> tuple[Tensor, Topology]:
    """Triangle lattice on z = (a x^2 + b y^2) / 2: principal edges along x, rows shifted by half an edge."""
    rows = columns = 5
    j, i = np.meshgrid(np.arange(rows) - 2, np.arange(columns) - 2, indexing="ij")
    x, y = half_edge * (2 * i + j % 2), height * j.astype(float)
    faces = []
    for r, c in itertools.product(range(rows - 1), range(columns - 1)):
        p, q = r * columns + c, (r + 1) * columns + c
        faces += [[p, p + 1, q], [p + 1, q + 1, q]] if r % 2 == 0 else [[p, p + 1, q + 1], [p, q + 1, q]]
    points = np.stack([x, y, (a * x**2 + b * y**2) / 2], axis=-1).reshape(-1, 3)
    return torch.from_numpy(points), Topology.from_faces(faces)


def orders(errors: list[float]) -> list[float]:
    """Observed orders of convergence if every step halves the cells."""
    return [math.log2(coarse / fine) for coarse, fine in itertools.pairwise(errors)]


def test_tends_to_eight_pi_r_from_below_on_inscribed_icospheres():
    errors = [8 * math.pi - normal_variation(*icosphere(level)).item() for level in (1, 2, 3)]
    assert errors[-1] > 0
    assert min(orders(errors)) > 1.9
    vertices, topology = icosphere(3)
    assert normal_variation(5 * vertices, topology).item() == pytest.approx(40 * math.pi, rel=1e-2)


def test_tends_to_eight_pi_r_on_any_convex_mesh_in_the_sphere():
    errors = [abs(normal_variation(*sphere_hull(count)).item() / (8 * math.pi) - 1) for count in (50, 200, 800, 3200)]
    assert min(orders(errors)) > 1.5  # quartered cells halve them
    assert errors[-1] < 5e-3


def test_tends_to_c_on_principal_quads_of_the_torus_with_second_order():
    big, small = 3.0, 1.0
    exact = 4 * math.pi**2 * big + 8 * math.pi * small
    sizes = [(24, 12), (48, 24), (96, 48)]
    errors = [abs(normal_variation(*torus(rows, columns, big, small)).item() - exact) for rows, columns in sizes]
    assert min(orders(errors)) > 1.9
    assert errors[-1] < 1e-3 * exact


def test_a_sheared_triangle_mesh_of_the_torus_keeps_more_than_c():
    """Its edges miss the principal directions: refinement does not bring E down to C on the saddle side."""
    exact = 12 * math.pi**2 + 8 * math.pi
    for rows, columns in [(24, 12), (48, 24), (96, 48)]:
        _, topology = torus(rows, columns)
        u, v = np.meshgrid(np.arange(rows) / rows, np.arange(columns) / columns, indexing="ij")
        around, across = 2 * math.pi * (u + v), 2 * math.pi * v  # meridians wind once around the axis
        distance = 3 + np.cos(across)
        points = np.stack([distance * np.cos(around), distance * np.sin(around), np.sin(across)], axis=-1)
        triangles = Topology.from_faces(split_quads(np.array(topology.face_lists())))
        assert normal_variation(torch.from_numpy(points.reshape(-1, 3)), triangles).item() > 1.1 * exact


@pytest.mark.parametrize("angle", [2 * math.pi, 1.5])
def test_tends_to_c_of_what_interior_edges_stand_for_on_a_catenoid_with_second_order(angle):
    """Interior edges along a boundary stand for all but half a cell beside it.

    On the catenoid each of |k1|, |k2| has the integral angle * height. Edges along parallels measure the
    curvature of meridians, and those at top and bottom are missing: half a row at either end. Edges along
    meridians measure that of parallels; the first and the last are missing if the patch is not closed.
    """
    bottom, top = -0.4, 1.2
    errors, naive = [], []
    for rows, columns in [(8, 16), (16, 32), (32, 64)]:
        value = normal_variation(*catenoid(rows, columns, bottom, top, angle)).item()
        row = (top - bottom) / rows
        column = 0 if angle == 2 * math.pi else angle / columns
        errors.append(abs(value - (angle * (top - bottom - row) + (angle - column) * (top - bottom))))
        naive.append(abs(value - 2 * angle * (top - bottom)))
    assert min(orders(errors)) > 1.9
    assert max(orders(naive)) < 1.5  # the whole patch is approached with first order only


@pytest.mark.parametrize(("a", "b", "p", "q"), [(1.0, -2.0, 1.0, 1.5), (-0.5, 3.0, 1.2, 0.7), (2.0, -1.0, 0.5, 1.0)])
def test_energy_per_area_of_principal_triangle_lattices_on_saddles(a, b, p, q):
    """|a| + |b| + 2 |a| p^2 / q^2 while |b| q^2 > |a| p^2 (two triangles of area p q at each vertex)."""
    assert abs(b) * q**2 > abs(a) * p**2
    scale = 1e-3
    vertices, topology = lattice(scale * p, scale * q, a, b)
    centre = 12
    at_centre = (topology.interior_edges == centre).any(1)
    assert at_centre.sum() == 6
    energy = normal_variation_per_edge(vertices, topology)[at_centre].sum().item() / 2
    expected = abs(a) + abs(b) + 2 * abs(a) * p**2 / q**2
    assert energy / (2 * p * q * scale**2) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize(("a", "b"), [(1.0, -2.0), (1.0, 2.0), (0.0, 1.0)])
def test_energy_per_area_of_principal_quads_on_paraboloids(a, b):
    scale = 1e-3
    x, y = np.meshgrid(scale * np.arange(-2, 3), 1.3 * scale * np.arange(-2, 3), indexing="ij")
    points = np.stack([x, y, (a * x**2 + b * y**2) / 2], axis=-1).reshape(-1, 3)
    topology = Topology.from_faces(grid_faces(5, 5))
    at_centre = (topology.interior_edges == 12).any(1)
    energy = normal_variation_per_edge(torch.from_numpy(points), topology)[at_centre].sum().item() / 2
    assert energy / (1.3 * scale**2) == pytest.approx(abs(a) + abs(b), rel=1e-4)
