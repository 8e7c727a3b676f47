from __future__ import annotations

import torch
from helpers import DOUBLE, cube, tetrahedron, wavy_grid

from torchfair import Topology
from torchfair.geometry import face_area_vectors
from torchfair.triangulation import triangulate


def summed_areas(vertices: torch.Tensor, topology: Topology) -> torch.Tensor:
    triangles, faces = triangulate(vertices, topology)
    a, b, c = vertices[triangles].unbind(1)
    halves = torch.linalg.cross(b - a, c - a) / 2
    return torch.zeros(topology.num_faces, 3, dtype=DOUBLE).index_add_(0, faces, halves)


def star_polygon(points: list[list[float]]) -> tuple[torch.Tensor, Topology]:
    plane = torch.tensor(points, dtype=DOUBLE)
    return torch.nn.functional.pad(plane, (0, 1)), Topology.from_faces([list(range(len(points)))])


def test_triangles_add_up_to_the_area_vector_of_their_face() -> None:
    quads, grid = wavy_grid()
    mixed = Topology.from_faces([grid.face_lists()[0][:3], *grid.face_lists()[1:]], grid.num_vertices)
    for vertices, topology in (cube(), tetrahedron(), (quads, grid), (quads, mixed)):
        assert torch.allclose(summed_areas(vertices, topology), face_area_vectors(vertices, topology), atol=1e-14)
        triangles, faces = triangulate(vertices, topology)
        assert len(triangles) == int((topology.face_sizes - 2).sum())
        assert bool((faces.diff() >= 0).all())


def test_polygons_that_are_not_convex_are_cut_inside() -> None:
    """Every triangle has the orientation of the polygon, so none covers anything outside."""
    dart = [[0.0, 0], [2, -1], [0.5, 0], [2, 1]]
    arrow = [[0.0, 0], [3, -3], [2, 0], [3, 3], [1, 1]]
    for points in (dart, dart[1:] + dart[:1], arrow, arrow[2:] + arrow[:2]):
        vertices, topology = star_polygon(points)
        a, b, c = vertices[triangulate(vertices, topology).triangles].unbind(1)
        areas = torch.linalg.cross(b - a, c - a)[:, 2]
        assert bool((areas > 0).all())


def test_no_faces() -> None:
    triangles, faces = triangulate(torch.zeros(2, 3), Topology.from_faces([], 2))
    assert triangles.shape == (0, 3)
    assert faces.shape == (0,)
