"""The built-in roofs and the catalogue of names."""

from __future__ import annotations

import math

import pytest
import torch

from torchfair.errors import MeshError, TorchfairError
from torchfair.geometry import corner_angles, dual_edge_lengths, edge_lengths, face_normals
from torchfair.shapes import EXAMPLES, SURFACES, Canopy, Surface, builtin_mesh, example_roof, hybrid_roof


def energy(vertices, topology):
    return float(
        (edge_lengths(vertices, topology)[: topology.num_interior_edges] * dual_edge_lengths(vertices, topology)).sum()
    )


def diagonal_distances(vertices, topology):
    """Distance of the two diagonals of every quad, relative to the mean edge length."""
    a, b, c, d = vertices[topology.faces_by_size[4][1]].unbind(1)
    normal = torch.nn.functional.normalize(torch.linalg.cross(c - a, d - b), dim=-1)
    return ((b - a) * normal).sum(-1).abs() / edge_lengths(vertices, topology).mean()


# ---- canopy --------------------------------------------------------------------------------------------


def test_canopy_has_domes_and_saddles():
    canopy = Canopy()
    zero, bay = torch.zeros(()).double(), torch.tensor(9.0).double()  # a crest and the valley beside it
    assert canopy.gaussian_curvature(zero, zero) > 0
    assert canopy.gaussian_curvature(bay, zero) < 0
    assert canopy.principal_curvatures(zero, zero).min() > 0  # convex seen from above
    assert canopy.position(zero, zero).tolist() == pytest.approx([0, 0, 3.5 * 1.45])


def test_example_roof_has_something_to_gain():
    vertices, topology = example_roof()
    assert vertices.dtype == torch.float64
    assert topology.is_triangular
    assert 1000 <= topology.num_faces <= 2000
    assert len(topology.boundary_loops()) == 1
    assert face_normals(vertices, topology)[:, 2].min() > 0
    assert math.degrees(corner_angles(vertices, topology).min()) > 15
    middles = (torch.arange(100, dtype=torch.float64) + 0.5) / 100
    canopy = Canopy()
    u, v = torch.meshgrid(36 * middles - 18, 16 * middles - 8, indexing="ij")
    total = float((canopy.principal_curvatures(u, v).abs().sum(-1) * canopy.area_element(u, v)).mean()) * 36 * 16
    assert energy(vertices, topology) > 1.3 * total


def test_example_roof_is_deterministic():
    (first, topology), (second, _) = example_roof(), example_roof()
    assert torch.equal(first, second)
    torch.testing.assert_close(first[:, 2].min(), torch.zeros(()).double(), atol=1e-9, rtol=0)
    assert topology.num_vertices == len(first)


# ---- hybrid roof ---------------------------------------------------------------------------------------


def test_hybrid_roof_in_the_proportions_of_the_paper():
    vertices, topology = hybrid_roof()
    assert topology.num_vertices == pytest.approx(1250, abs=30)
    sizes = topology.face_sizes
    assert sizes.unique().tolist() == [3, 4]
    assert len(topology.boundary_loops()) == 1
    assert topology.num_vertices - topology.num_edges + topology.num_faces == 1
    assert face_normals(vertices, topology)[:, 2].min() > 0.3
    assert math.degrees(corner_angles(vertices, topology).min()) > 15
    # away from the ends every vertex has three triangles and two quads
    inner = ~topology.is_boundary_vertex
    valences = topology.valences[inner]
    assert (valences == 5).double().mean() > 0.9


@pytest.mark.parametrize("seed", [0, 1])
def test_hybrid_quads_are_planar(seed):
    for irregularity in (0.0, 0.3, 0.9):
        assert diagonal_distances(*hybrid_roof(irregularity=irregularity, seed=seed)).max() < 1e-12


def test_irregularity_costs_energy():
    regular, default, rough = (energy(*hybrid_roof(irregularity=value)) for value in (0.0, 0.3, 0.6))
    assert 1.05 * regular < default < rough


def test_hybrid_roof_alternates():
    """Strips of 6, 7, 6, 7 quads, and between two strips 6 + 7 triangles that each rest on one of the quads."""
    _, topology = hybrid_roof(4, 6)
    quads = (topology.face_sizes[topology.interior_edge_faces] == 4).sum(1)
    assert int((quads == 2).sum()) == 5 + 6 + 5 + 6
    assert int((quads == 1).sum()) == 3 * (6 + 7)
    assert int((quads == 0).sum()) == 3 * (6 + 7 - 1)


def test_hybrid_seed_decides():
    first, again, other = (hybrid_roof(3, 5, seed=seed)[0] for seed in (1, 1, 2))
    assert torch.equal(first, again)
    assert not torch.equal(first, other)
    assert torch.equal(hybrid_roof(3, 5, irregularity=0.0, seed=1)[0], hybrid_roof(3, 5, irregularity=0.0, seed=2)[0])


def test_hybrid_errors():
    with pytest.raises(MeshError, match="strips must be an integer of at least 2"):
        hybrid_roof(1)
    with pytest.raises(MeshError, match="columns must be an integer of at least 2"):
        hybrid_roof(3, 1)
    for value in (-0.1, 1.0, math.nan):
        with pytest.raises(TorchfairError, match="irregularity must be at least 0 and less than 1"):
            hybrid_roof(irregularity=value)


# ---- names ---------------------------------------------------------------------------------------------


def test_catalogue():
    assert set(EXAMPLES) == {"roof", "hybrid_roof"}
    for name, make in SURFACES.items():
        assert isinstance(make(), Surface)
        assert name == name.lower()
        assert " " not in name


def test_builtin_meshes():
    for name, make in (("roof", example_roof), ("hybrid_roof", hybrid_roof)):
        assert torch.equal(builtin_mesh(name)[0], make()[0])
    vertices, topology = builtin_mesh("cylinder")
    assert vertices.shape == (1000, 3)
    assert topology.is_triangular


def test_unknown_name():
    with pytest.raises(TorchfairError, match="no example 'louvre': choose roof, hybrid_roof, sphere"):
        builtin_mesh("louvre")
