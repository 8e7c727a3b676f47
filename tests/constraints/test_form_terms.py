"""Terms of the job that lowers C besides the target: directions, tangent planes, tangential fairness."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import wavy_grid

from torchfair.constraints import (
    absolute_curvature_terms,
    along_directions,
    closeness_terms,
    even_fairness_terms,
    interior_fairness_terms,
    tangent_plane_terms,
    tangential_fairness_terms,
)
from torchfair.constraints.closeness import TangentPlanes
from torchfair.constraints.tangent_planes import tangent_frames
from torchfair.errors import ShapeError
from torchfair.geometry import umbrella_vectors, vertex_normals
from torchfair.geometry.closest_point import ReferenceSurface
from torchfair.projection.differentiation import differentiate
from torchfair.shapes import Cylinder, principal_triangles

VERTICES, TOPOLOGY = wavy_grid(7, 6, triangles=True)


def test_terms_along_directions_equal_those_at_the_places() -> None:
    generator = torch.Generator().manual_seed(0)
    directions = torch.randn(VERTICES.shape, dtype=torch.float64, generator=generator)
    heights = 0.05 * torch.randn(VERTICES.shape[0], 1, dtype=torch.float64, generator=generator)
    moved = VERTICES + heights * directions
    terms = [*absolute_curvature_terms(TOPOLOGY, smoothing=0.1), *interior_fairness_terms(TOPOLOGY, weight=2.0)]
    for term in terms:
        reduced = along_directions(term, VERTICES, directions)
        arguments, whole = reduced.arguments({"heights": heights}), term.arguments({"vertices": moved})
        torch.testing.assert_close(reduced.values(arguments), term.values(whole), atol=1e-12, rtol=1e-9)
        chain = term.jacobians(whole).unflatten(-1, (-1, 3))
        expected = (chain * directions[term.stencil[0][1]][:, None]).sum(-1)
        torch.testing.assert_close(reduced.jacobians(arguments), expected, atol=1e-12, rtol=1e-9)
        automatic = differentiate(reduced.residual, arguments, 1)[1]
        torch.testing.assert_close(automatic, expected, atol=1e-10, rtol=1e-8)


def test_refreshed_terms_cannot_go_along_directions() -> None:
    planes = TangentPlanes(ReferenceSurface(VERTICES, TOPOLOGY))
    (term,) = closeness_terms(planes, torch.arange(TOPOLOGY.num_vertices), weight=1.0)
    with pytest.raises(ShapeError, match="no refresh"):
        along_directions(term, VERTICES, VERTICES)


def test_frames_are_orthonormal() -> None:
    normals = torch.randn(200, 3, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    axes = torch.eye(3, dtype=torch.float64)
    normals = torch.cat([normals, axes, -axes])
    normals = normals / normals.norm(dim=1, keepdim=True)
    frames = torch.stack([*tangent_frames(normals), normals], 1)
    torch.testing.assert_close(frames @ frames.mT, torch.eye(3, dtype=torch.float64).expand(206, 3, 3))


@pytest.mark.parametrize("angle", [0.0, 0.1, 0.5])
def test_tilt_is_the_sine_of_the_angle_to_the_plane(angle: float) -> None:
    flat = VERTICES * torch.tensor([1.0, 1.0, 0.0], dtype=torch.float64)
    rim = torch.nonzero(TOPOLOGY.is_boundary_vertex).squeeze(1)
    normal = torch.tensor([math.sin(angle), 0.0, math.cos(angle)], dtype=torch.float64)
    terms = tangent_plane_terms(TOPOLOGY, rim, normal.expand(len(rim), 3), weight=1.0)
    assert sum(term.num_elements for term in terms) == len(rim)
    for term in terms:
        sizes = term.values(term.arguments({"vertices": flat})).norm(dim=1)
        torch.testing.assert_close(sizes, torch.full_like(sizes, math.sin(angle)), atol=1e-12, rtol=1e-9)


def test_tangential_fairness_is_the_tangential_part_of_umbrellas() -> None:
    normals, umbrellas = vertex_normals(VERTICES, TOPOLOGY), umbrella_vectors(VERTICES, TOPOLOGY)
    expected = umbrellas - (umbrellas * normals).sum(1, keepdim=True) * normals
    seen = 0
    for term in tangential_fairness_terms(TOPOLOGY, weight=1.0):
        values = term.values(term.arguments({"vertices": VERTICES}))
        centres = term.stencil[0][1][:, 0]
        torch.testing.assert_close(values, expected[centres], atol=1e-12, rtol=1e-9)
        seen += len(centres)
    assert seen == int((~TOPOLOGY.is_boundary_vertex).sum())


def test_even_bending_is_left_in_peace_by_even_fairness() -> None:
    """On a cylinder, whose umbrella vectors are alike, little is left to even out away from the boundary."""
    mesh = principal_triangles(Cylinder(radius=1.0, height=3.0), 24, 20)
    middle = (mesh.vertices[:, 2] - mesh.vertices[:, 2].mean()).abs() < 0.8
    plain = umbrella_vectors(mesh.vertices, mesh.topology)[middle].norm(dim=1)
    for term in even_fairness_terms(mesh.vertices, mesh.topology, weight=1.0):
        values = term.values(term.arguments({"vertices": mesh.vertices}))
        inside = middle[term.stencil[0][1][:, 0]]
        # What is left is that the umbrella vectors around a vertex are turned against each other.
        assert float(values[inside].norm(dim=1).max()) < 0.15 * float(plain.min())


def test_the_even_part_is_the_mean_normal_part_over_three_rings() -> None:
    """Against a slow loop: thrice the mean over a vertex and its neighbours inside; the boundary has no say."""
    umbrellas, normals = umbrella_vectors(VERTICES, TOPOLOGY), vertex_normals(VERTICES, TOPOLOGY)
    inside = (~TOPOLOGY.is_boundary_vertex).tolist()
    around = [[v] for v in range(TOPOLOGY.num_vertices)]
    for v, w in TOPOLOGY.edges.tolist():
        around[v].append(w)
        around[w].append(v)
    even = [torch.dot(u, n) * n for u, n in zip(umbrellas, normals, strict=True)]
    for _ in range(3):
        parts = [[even[w] for w in near if inside[w]] for near in around]
        even = [sum(part) / len(part) if part else torch.zeros(3, dtype=torch.float64) for part in parts]
    seen = 0
    for term in even_fairness_terms(VERTICES, TOPOLOGY, weight=1.0):
        values = term.values(term.arguments({"vertices": VERTICES}))
        for centre, value in zip(term.stencil[0][1][:, 0].tolist(), values, strict=True):
            torch.testing.assert_close(value, umbrellas[centre] - even[centre], atol=1e-12, rtol=0)
            seen += 1
    assert seen == sum(inside)


def test_even_fairness_removes_noise() -> None:
    noise = 0.2 * torch.randn(VERTICES.shape, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    rough = VERTICES + noise * (~TOPOLOGY.is_boundary_vertex)[:, None]
    sizes = []
    for vertices in (VERTICES, rough):
        terms = even_fairness_terms(VERTICES, TOPOLOGY, weight=1.0)
        sizes.append(sum(float(t.values(t.arguments({"vertices": vertices})).square().sum()) for t in terms))
    assert sizes[1] > 1.2 * sizes[0]
    assert all(term.linear for term in terms)
