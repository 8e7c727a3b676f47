"""Support structures: exact on conical meshes; what is missing elsewhere is measured."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE, wavy_grid

from torchfair import Topology, TorchfairError
from torchfair.geometry import edge_lengths, face_normals, planarity
from torchfair.principal import support_structure
from torchfair.shapes import Enneper, Hyperboloid, Torus, principal_quads


@pytest.mark.parametrize("distance", [0.2, -0.15])
@pytest.mark.parametrize("surface", [Torus(2.0, 0.8), Hyperboloid()], ids=["torus", "hyperboloid"])
def test_exact_on_conical_meshes(surface, distance: float) -> None:
    mesh = principal_quads(surface, 8, 12)
    structure = support_structure(mesh.vertices, mesh.topology, distance)
    assert structure.distance_errors.max() < 1e-10
    assert structure.planarity.max() < 1e-10
    assert structure.parallelity.max() < 1e-10
    assert structure.tilts.max() < 1e-10
    assert planarity(structure.offset, mesh.topology).max() < 1e-10
    normals = face_normals(mesh.vertices, mesh.topology)
    torch.testing.assert_close(face_normals(structure.offset, mesh.topology), normals, atol=1e-8, rtol=0)


def test_quads_stand_on_edges_and_end_on_the_offset() -> None:
    mesh = principal_quads(Torus(2.0, 0.8), 6, 9)
    structure = support_structure(mesh.vertices, mesh.topology, 0.3)
    quads = structure.vertices[structure.topology.corners].view(-1, 4, 3)
    assert len(quads) == mesh.topology.num_edges
    v, w = mesh.topology.edges.unbind(1)
    torch.testing.assert_close(quads[:, 0], mesh.vertices[v])
    torch.testing.assert_close(quads[:, 1], mesh.vertices[w])
    torch.testing.assert_close(quads[:, 2], structure.offset[w])
    torch.testing.assert_close(quads[:, 3], structure.offset[v])
    lengths = edge_lengths(mesh.vertices, mesh.topology)
    torch.testing.assert_close(
        edge_lengths(structure.vertices, structure.topology).sum() > 2 * lengths.sum(), torch.tensor(True)
    )


def test_principal_quads_of_a_smooth_surface_come_nearer_with_their_size() -> None:
    errors = []
    for n in (8, 16):
        mesh = principal_quads(Enneper(), n, n)
        structure = support_structure(mesh.vertices, mesh.topology, 0.1)
        errors.append(
            torch.stack([structure.distance_errors.mean(), structure.planarity.mean(), structure.tilts.mean()])
        )
    assert (errors[1] < 0.6 * errors[0]).all()


def test_what_is_missing_is_measured_on_other_meshes() -> None:
    vertices, topology = wavy_grid(6, 6)
    structure = support_structure(vertices, topology, 0.1)
    assert structure.distance_errors.max() > 0.01
    assert structure.planarity.max() > 0.01
    assert structure.tilts.max() > 0.01
    assert structure.parallelity.max() > 0.01


def test_refusals() -> None:
    vertices, topology = wavy_grid(3, 3)
    for distance in (0.0, float("nan"), float("inf")):
        with pytest.raises(TorchfairError, match="distance must be a finite number"):
            support_structure(vertices, topology, distance)
    pillow = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]], dtype=DOUBLE)
    with pytest.raises(TorchfairError, match=r"3 vertices have no offset.*\[0, 1, 2\]"):
        support_structure(pillow, Topology.from_faces([[0, 1, 2], [2, 1, 0]]), 0.1)
