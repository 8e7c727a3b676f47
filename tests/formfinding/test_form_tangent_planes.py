"""Tangent planes along the boundary of a surface of least C: met, and those of a cylinder give it back."""

from __future__ import annotations

import math

import pytest
import torch
from form_boundaries import ring
from torch import Tensor

from torchfair import Topology
from torchfair.constraints import BoundaryNormals
from torchfair.formfinding import minimise_absolute_curvature, start_surface
from torchfair.shapes import Cylinder, Torus, principal_triangles


def test_tangent_planes_of_a_cylinder_give_it_back() -> None:
    mesh = principal_triangles(Cylinder(radius=1.0, height=1.5), 12, 30)
    vertices, topology = mesh.vertices.clone(), mesh.topology
    z = vertices[:, 2]
    t = (z - z.min()) / (z.max() - z.min())
    bulged = vertices * torch.stack([1.0 + 0.3 * t * (1 - t), 1.0 + 0.3 * t * (1 - t), torch.ones_like(t)], 1)
    normals = torch.where(topology.is_boundary_vertex[:, None], mesh.normals, 0.0)
    result = minimise_absolute_curvature(bulged, topology, normals=normals)
    assert result.before["largest_tilt_degrees"] > 5.0
    assert result.after["largest_tilt_degrees"] < 0.5
    assert float((result.vertices[:, :2].norm(dim=1) - 1.0).abs().max()) < 0.01


def test_prescribed_tangent_planes_are_met() -> None:
    """A disk whose rim is to rise at 30 degrees: a cone with a flattened tip, or a dome."""
    vertices, topology = start_surface([ring(1.0, 0.0)], 300)
    rim = topology.is_boundary_vertex
    outward = vertices / vertices.norm(dim=1, keepdim=True).clamp_min(1e-9)
    up = torch.tensor([0.0, 0.0, 1.0], dtype=torch.float64)
    normals = torch.where(rim[:, None], math.sin(math.pi / 6) * outward + math.cos(math.pi / 6) * up, 0.0)
    vertices[:, 2] += 0.1 * (1.0 - vertices[:, :2].square().sum(1))
    result = minimise_absolute_curvature(vertices, topology, normals=normals, levels=1)
    assert result.after["largest_tilt_degrees"] < 0.5
    assert float(result.vertices[:, 2].max()) > 0.12  # the start: 0.1


def test_normals_at_the_boundary_are_those_of_the_surface() -> None:
    """Star normals are off by the bending over half a row; those of patches by far less, and in second order."""
    errors = []
    for rows in (8, 16):
        mesh = principal_triangles(Torus(tube_angles=(0.3, 1.5)), rows, 8 * rows)
        rim = mesh.topology.is_boundary_vertex
        seen = BoundaryNormals.of(mesh.vertices, mesh.topology)
        gaps = [(n - mesh.normals)[rim].norm(dim=1).max() for n in (seen.star, seen.at_boundary)]
        errors.append([float(gap) for gap in gaps])
        assert not bool(seen.at_boundary[~rim].any())
    assert all(patch < 0.1 * star for star, patch in errors)
    (star, patch), (finer_star, finer_patch) = errors
    assert star > 1.8 * finer_star
    assert patch > 3.5 * finer_patch


def height_field(kind: str, rows: int = 16, columns: int = 15) -> tuple[Tensor, Tensor, Topology]:
    """Patch over a square, its unit normals, and staggered triangles whose sides are lopsided."""
    s, t = torch.meshgrid(
        torch.linspace(-1, 1, rows + 1).double(), torch.linspace(-1, 1, columns + 1).double(), indexing="ij"
    )
    shift = (torch.arange(rows + 1) % 2)[:, None] * (1.0 - t.square()) / columns
    x, y = (t + shift).flatten(), s.flatten()
    faces = []
    for row in range(rows):
        for column in range(columns):
            a, b = row * (columns + 1) + column, row * (columns + 1) + column + 1
            c, d = a + columns + 1, b + columns + 1
            faces += [[a, b, c], [b, d, c]] if row % 2 == 0 else [[a, b, d], [a, d, c]]
    root = {"cap": 4.0 - x * x - y * y, "cylinder": 2.2 - x * x}
    if kind == "saddle":
        z, dx, dy = 0.5 * x * y, 0.5 * y, 0.5 * x
    else:
        z = root[kind].sqrt()
        dx, dy = -x / z, -y / z if kind == "cap" else torch.zeros_like(y)
    normals = torch.stack([-dx, -dy, torch.ones_like(x)], 1)
    return torch.stack([x, y, z], 1), normals / normals.norm(dim=1, keepdim=True), Topology.from_faces(faces)


@pytest.mark.parametrize("kind", ["cap", "saddle", "cylinder"])
def test_tangent_planes_along_patches_with_corners_are_met(kind: str) -> None:
    exact, normals, topology = height_field(kind)
    bump = 0.15 * (1.0 - exact[:, :1].square()) * (1.0 - exact[:, 1:2].square())
    along = torch.where(topology.is_boundary_vertex[:, None], normals, 0.0)
    result = minimise_absolute_curvature(exact + bump * normals, topology, normals=along)
    assert result.before["largest_tilt_degrees"] > 5.0
    assert result.after["largest_tilt_degrees"] < 0.1
    assert result.after["smallest_angle_degrees"] > 15.0
    if kind == "cylinder":  # it is given back
        away = (result.vertices[:, [0, 2]].norm(dim=1) - math.sqrt(2.2)).abs()
        assert float(away.max()) < 0.01
