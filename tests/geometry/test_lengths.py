from __future__ import annotations

import math

import torch
from geometry_meshes import mixed_grid
from helpers import DOUBLE, cube

from torchfair import Topology
from torchfair.geometry import edge_lengths, edge_vectors


def test_edges_of_the_unit_cube():
    torch.testing.assert_close(edge_lengths(*cube()), torch.ones(12, dtype=DOUBLE))


def test_vectors_lead_from_v_to_w_with_the_left_face_first():
    vertices, topology = mixed_grid()
    lists = topology.face_lists()
    for e, vector in enumerate(edge_vectors(vertices, topology)):
        v, w = topology.edges[e].tolist()
        torch.testing.assert_close(vector, vertices[w] - vertices[v])
        if e < topology.num_interior_edges:
            left = lists[int(topology.interior_edge_faces[e, 0])]
            assert left[(left.index(v) + 1) % len(left)] == w


def test_boundary_edges_come_last():
    vertices = torch.tensor([[0.0, 0], [1, 0], [1, 2], [0, 2]], dtype=DOUBLE)
    vertices = torch.cat([vertices, torch.zeros(4, 1, dtype=DOUBLE)], dim=1)
    lengths = edge_lengths(vertices, Topology.from_faces([[0, 1, 2], [0, 2, 3]]))
    torch.testing.assert_close(lengths, torch.tensor([math.sqrt(5), 1, 2, 2, 1], dtype=DOUBLE))


def test_gradient_is_the_unit_vector_and_zero_at_length_zero():
    topology = Topology.from_faces([[0, 1, 2]])
    vertices = torch.tensor([[0.0, 0, 0], [3, 4, 0], [3, 4, 0]], dtype=DOUBLE, requires_grad=True)
    lengths = edge_lengths(vertices, topology)
    longest = int(topology.edges.tolist().index([0, 1]))
    (gradient,) = torch.autograd.grad(lengths[longest], vertices, retain_graph=True)
    unit = torch.tensor([0.6, 0.8, 0], dtype=DOUBLE)
    torch.testing.assert_close(gradient, torch.stack([-unit, unit, 0 * unit]))
    collapsed = int(topology.edges.tolist().index([1, 2]))
    (gradient,) = torch.autograd.grad(lengths[collapsed], vertices)
    assert not gradient.any()
