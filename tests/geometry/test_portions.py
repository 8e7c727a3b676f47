"""Faces of large meshes are worked on some at a time: the same numbers, bit for bit, and gradients of all at once."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE, wavy_grid

from torchfair import Topology, _portions
from torchfair.geometry import (
    balanced_normals,
    corrected_shape_operators,
    dihedral_angles,
    face_area_vectors,
    face_normals,
    planarity,
)
from torchfair.geometry._ops import map_faces


def mixed() -> tuple[torch.Tensor, Topology]:
    """Quads, of which every third is cut."""
    vertices, topology = wavy_grid(9, 8)
    faces = [part for n, f in enumerate(topology.face_lists()) for part in ([f] if n % 3 else [f[:3], [*f[2:], f[0]]])]
    return vertices, Topology.from_faces(faces)


@pytest.mark.parametrize(
    "function",
    [face_area_vectors, face_normals, planarity, balanced_normals, corrected_shape_operators, dihedral_angles],
)
@pytest.mark.parametrize("mesh", [mixed, lambda: wavy_grid(9, 8, triangles=True)])
def test_portions_change_no_bit(function, mesh, monkeypatch):
    vertices, topology = mesh()
    batch = torch.stack([vertices, vertices.flip(1)])
    whole = [function(each, topology) for each in (vertices, batch)]
    sizes = []
    monkeypatch.setattr(_portions.portions_unless, "__defaults__", (5,))  # faces at a time
    map_faces(vertices, topology, lambda corners: (sizes.append(corners.shape[-3]), corners[..., 0, :])[1])
    assert max(sizes) == 5
    assert sum(sizes) == topology.num_faces
    for each, expected in zip((vertices, batch), whole, strict=True):
        assert torch.equal(function(each, topology), expected)


def test_what_is_differentiated_is_worked_on_at_once(monkeypatch):
    vertices, topology = wavy_grid(9, 8, triangles=True)
    weights = torch.linspace(-1.0, 1.0, 3 * topology.num_faces, dtype=DOUBLE).view(-1, 3)
    monkeypatch.setattr(_portions.portions_unless, "__defaults__", (5,))
    sizes = []
    leaf = vertices.clone().requires_grad_()
    map_faces(leaf, topology, lambda corners: (sizes.append(corners.shape[-3]), corners[..., 0, :])[1])
    assert sizes == [topology.num_faces]

    def work(x):
        return (weights * face_area_vectors(x, topology)).sum()

    expected = torch.autograd.grad(work(leaf), leaf)[0]
    torch.testing.assert_close(torch.func.grad(work)(vertices), expected, atol=1e-14, rtol=0)
    tangent = torch.sin(vertices)
    rate = torch.func.jvp(work, (vertices,), (tangent,))[1]
    torch.testing.assert_close(rate, (expected * tangent).sum())
    rows = torch.vmap(lambda x: face_area_vectors(x, topology))(torch.stack([vertices, tangent]))
    assert torch.equal(rows[1], face_area_vectors(tangent, topology))
