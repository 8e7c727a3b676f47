"""Points on a smooth surface through the vertices of a mesh: order, vertices, creases, meshes on it."""

from __future__ import annotations

from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest
import torch
from meshing_tools import irregular
from torch import Tensor

from torchfair import Topology
from torchfair.geometry import ReferenceSurface, fitted_curvature
from torchfair.meshing import MeshingSettings, curved_surface, principal_quads
from torchfair.meshing.components import Pieces, ReadSurface, on_surface
from torchfair.meshing.mesh_creases import MeshCreases
from torchfair.shapes import Torus


def inside(vertices: Tensor, topology: Topology, weights: tuple[float, float, float]) -> Tensor:
    """A point in every triangle."""
    return (vertices[topology.triangles] * torch.tensor(weights)[:, None]).sum(1)


def on_curved_surface(points: Tensor, vertices: Tensor, topology: Topology) -> Tensor:
    fitted = fitted_curvature(vertices, topology, rings=2)
    return curved_surface.on_curved_surface(points, vertices, topology, fitted.normals, fitted.operators)


def off_the_torus(points: Tensor) -> float:
    x, y, z = points.unbind(1)
    return float(torch.hypot(torch.hypot(x, y) - 2, z).sub(0.8).abs().mean())


def test_the_error_is_of_the_third_order_and_that_of_triangles_of_the_second() -> None:
    flat, curved = [], []
    for number in (600, 2400):
        vertices, topology = irregular(Torus(), number)
        points = inside(vertices, topology, (0.2, 0.5, 0.3))
        flat.append(off_the_torus(points))
        curved.append(off_the_torus(on_curved_surface(points, vertices, topology)))
    assert curved[0] < 0.15 * flat[0]
    assert 3 < flat[0] / flat[1] < 5
    assert curved[0] / curved[1] > 6


def test_vertices_stay_and_neighbours_fit_together() -> None:
    vertices, topology = irregular(Torus(), 600)
    assert torch.equal(on_curved_surface(vertices, vertices, topology), vertices)
    middles = vertices[topology.edges].mean(1)
    apart = [on_curved_surface(middles + 1e-9 * side, vertices, topology) for side in torch.eye(3).double()]
    assert (apart[0] - apart[1]).abs().max() < 1e-7  # whichever of the two triangles is nearer


def test_scale_motion_and_creases() -> None:
    vertices, topology = irregular(Torus(), 600)
    points = inside(vertices, topology, (0.2, 0.5, 0.3))
    moved = on_curved_surface(points, vertices, topology)
    again = on_curved_surface(1e3 * points + 7, 1e3 * vertices + 7, topology)
    assert torch.allclose(again, 1e3 * moved + 7, atol=1e-7)
    cube = torch.tensor([[x, y, z] for x in (0.0, 1) for y in (0.0, 1) for z in (0.0, 1)]).double()
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    box = Topology.from_faces([t for a, b, c, d in quads for t in ([a, b, c], [a, c, d])])
    on_faces = inside(cube, box, (0.2, 0.5, 0.3))
    assert torch.equal(on_curved_surface(on_faces, cube, box), on_faces)


def test_a_mesh_finer_than_the_triangles_has_no_facets_of_theirs() -> None:
    vertices, topology = irregular(Torus(), 600)
    ratio = {}
    for curved in (False, True):
        found = principal_quads(vertices, topology, count=1500, settings=MeshingSettings(curved=curved))
        ratio[curved] = found.report["normal_variation"] / Torus().total_absolute_curvature()
        distances = ReferenceSurface(vertices, topology).closest(found.vertices).distances
        assert (float(distances.max()) > 1e-9) is curved
    assert abs(ratio[True] - 1) < 0.01 < 0.03 < ratio[False] - 1


def test_points_move_by_a_fifth_of_a_side_at_most() -> None:
    triangle = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=torch.float64)
    normals = torch.tensor([[0.0, 0, 1]] * 3, dtype=torch.float64)
    operators = 100.0 * torch.diag(torch.tensor([1.0, 1.0, 0.0], dtype=torch.float64)).expand(3, 3, 3)
    point = torch.tensor([[0.3, 0.3, 0.0]], dtype=torch.float64)
    topology = Topology.from_faces([[0, 1, 2]])
    moved = curved_surface.on_curved_surface(point, triangle, topology, normals, operators)
    assert float((moved - point).norm()) == pytest.approx(0.2 * 2.0**0.5)


def test_vertices_stay_where_the_curved_surface_would_flatten_a_corner() -> None:
    flat = torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=torch.float64)
    places, none = flat.new_zeros(0, 3), torch.zeros(0, 2, dtype=torch.int64)
    creases = MeshCreases(none, flat.new_zeros(0, 2, 3))
    pieces = Pieces(flat.numpy(), [[0, 1, 2, 3]], set(), creases, places, places[:, 0], [], [0], [4], None)
    for folded, corner in ((False, flat[2] + 0.1), (True, torch.tensor([0.5, 0.001, 0]))):
        moved = flat.index_copy(0, torch.tensor([2]), corner.to(flat)[None])
        surface = cast(ReadSurface, SimpleNamespace(curved=lambda points, moved=moved: moved))
        found = on_surface(pieces, surface, MeshingSettings())
        assert np.array_equal(found.positions, flat.numpy() if folded else moved.numpy())
        assert any("flat triangles" in note for note in found.notes) == folded
