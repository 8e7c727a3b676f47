"""Vertices that fans share are split, and edges of more than two faces where that is asked for."""

from __future__ import annotations

import pytest
import torch
from helpers import cube

from torchfair import MeshError
from torchfair.geometry import dihedral_angles
from torchfair.repair import repair_mesh


def two_cubes(shift: list[float]) -> tuple[torch.Tensor, list[list[int]]]:
    """Unit cubes, the second one moved, with the vertices in which they meet used by both."""
    vertices, topology = cube()
    both = torch.cat(
        [vertices, vertices + torch.tensor(shift, dtype=vertices.dtype) * (vertices.amax() - vertices.amin())]
    )
    near = torch.cdist(both, both) < 1e-9
    names = near.int().argmax(1)
    faces = topology.face_lists()
    return both, [[int(names[v]) for v in face] for face in faces + [[v + 8 for v in face] for face in faces]]


def test_cubes_that_touch_at_a_vertex_get_a_copy() -> None:
    vertices, faces = two_cubes([1.0, 1.0, 1.0])
    result = repair_mesh(vertices, faces)
    assert result.topology.num_vertices == 16
    assert result.vertices[-1].equal(vertices[result.kept_vertices[-1]])
    assert "split 1 vertex(es), one copy for each fan of faces, 1 more in all" in result.messages[0]
    assert result.faces[:6] == faces[:6]  # the first fan keeps the vertex
    assert not len(result.topology.boundary_loops())


def test_cubes_that_touch_along_an_edge_come_apart_where_asked() -> None:
    """Each stays convex, rather than both becoming one ring with a concave edge."""
    vertices, faces = two_cubes([1.0, 1.0, 0.0])
    with pytest.raises(MeshError, match=r"non-manifold: 1 edge\(s\).*split_edges=True"):
        repair_mesh(vertices, faces)
    result = repair_mesh(vertices, faces, split_edges=True)
    assert result.topology.num_vertices == 16
    assert torch.allclose(dihedral_angles(result.vertices, result.topology), torch.tensor(torch.pi / 2).double())


def test_a_fin_comes_off_the_flat_pair() -> None:
    points = torch.tensor([[0.0, 0, 0], [0, 1, 0], [1, 0, 0], [-1, 0, 0], [0, 0, 1]], dtype=torch.float64)
    for order in ([0, 1, 2], [2, 0, 1]):
        faces = [[[0, 1, 3], [1, 0, 2], [0, 1, 4]][i] for i in order]
        result = repair_mesh(points, faces, split_edges=True)
        assert result.topology.num_interior_edges == 1
        assert dihedral_angles(result.vertices, result.topology).abs().max() < 1e-12


def test_several_fans_at_a_vertex() -> None:
    faces = [[0, 1, 2], [0, 3, 4], [0, 5, 6], [0, 2, 7]]
    result = repair_mesh(torch.rand(8, 3, dtype=torch.float64), faces)
    assert result.faces == [[0, 1, 2], [8, 3, 4], [9, 5, 6], [0, 2, 7]]
    assert result.kept_vertices.tolist() == [*range(8), 0, 0]
    assert result.vertex_map.tolist() == list(range(8))
