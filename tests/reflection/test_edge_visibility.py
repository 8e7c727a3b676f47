"""Visible shares of edges: convex bodies, one sheet before another, and a slow count by rays."""

from __future__ import annotations

import dataclasses
import math
import sys

import pytest
import torch
from geometry_meshes import random_polytope, torus
from helpers import DOUBLE, cube, random_rotation, wavy_grid

from torchfair import ShapeError, Topology, TorchfairError
from torchfair.geometry import face_normals
from torchfair.reflection import (
    OrthographicCamera,
    PerspectiveCamera,
    axis_directions,
    edge_visibility,
    reflection_variation,
    reflection_variation_from_eyes,
)
from torchfair.shapes import icosphere

visibility = sys.modules["torchfair.reflection.edge_visibility"]  # the package has a function of that name


def from_afar(
    vertices: torch.Tensor, topology: Topology, views: torch.Tensor, samples: int = 8, size: int = 1024
) -> torch.Tensor:
    camera = OrthographicCamera.fit(vertices, directions=views)
    return edge_visibility(vertices, topology, camera, samples=samples, size=size)


def from_eyes(vertices: torch.Tensor, topology: Topology, eyes: torch.Tensor, samples: int = 8) -> torch.Tensor:
    centre = vertices.mean(0)
    distance = (eyes - centre).norm(dim=-1).min()
    angle = 2 * torch.rad2deg(torch.atan(1.2 * (vertices - centre).norm(dim=-1).max() / distance))
    camera = PerspectiveCamera(eyes, centre, float(angle))
    return edge_visibility(vertices, topology, camera, samples=samples)


def facing_share(vertices: torch.Tensor, topology: Topology, view: torch.Tensor) -> torch.Tensor:
    front = face_normals(vertices, topology) @ view < 0
    return front[topology.interior_edge_faces].all(1).to(DOUBLE)


@pytest.mark.parametrize("mesh", [cube, lambda: random_polytope(1), lambda: random_polytope(5)])
def test_on_convex_bodies_edges_between_two_front_faces_are_visible(mesh):
    vertices, topology = mesh()
    views = axis_directions() @ random_rotation(2).T
    shares = from_afar(vertices, topology, views)
    expected = torch.stack([facing_share(vertices, topology, view) for view in views])
    assert (shares - expected).abs().mean() < 5e-3  # pixels of the outline
    eyes = vertices.mean(0) - 20 * views
    front = ((face_normals(vertices, topology) * (vertices[topology.corners[topology.face_offsets[:-1]]]
              - eyes[:, None])).sum(-1) < 0)  # fmt: skip
    expected = front[:, topology.interior_edge_faces].all(-1).to(DOUBLE)
    assert (from_eyes(vertices, topology, eyes) - expected).abs().mean() < 5e-3


def two_sheets(height: float, cover: float) -> tuple[torch.Tensor, Topology]:
    """A bent pair of squares, its crease along y from 0 to 1, under a sheet over the part with y < cover."""
    lower = torch.tensor([[-1.0, 0, 0.2], [0, 0, 0], [1, 0, 0.2], [-1, 1, 0.2], [0, 1, 0], [1, 1, 0.2]])
    upper = torch.tensor([[-2.0, -1, height], [2, -1, height], [2, cover, height], [-2, cover, height]])
    topology = Topology.from_faces([[0, 1, 4, 3], [1, 2, 5, 4], [6, 7, 8, 9]])
    return torch.cat([lower, upper]).to(DOUBLE), topology


@pytest.mark.parametrize("cover", [0.25, 0.5])
def test_a_sheet_hides_its_share_of_an_edge_from_above_and_nothing_from_below(cover):
    vertices, topology = two_sheets(2.0, cover)
    views = torch.tensor([[0, 0, -1], [0, 0, 3]], dtype=DOUBLE)
    shares = from_afar(vertices, topology, views, samples=16)
    torch.testing.assert_close(shares[:, 0], torch.tensor([1 - cover, 1], dtype=DOUBLE))
    eyes = torch.tensor([[0.0, cover, 9], [0, 0.5, -9]], dtype=DOUBLE)  # the rim lies straight under the first eye
    torch.testing.assert_close(from_eyes(vertices, topology, eyes, samples=16), shares)
    tilted = torch.tensor([[0, 1.0, -4]], dtype=DOUBLE)  # shifts the shadow of the rim by a quarter of its height
    expected = 1 - min(cover + (2.0 - 0) / 4, 1)
    share = from_afar(vertices, topology, tilted, samples=16)[0, 0].item()
    assert share == pytest.approx(expected, abs=1e-12)


def test_agrees_with_rays_on_a_torus_that_hides_itself():
    vertices, topology = torus(24, 14, big=2.0)
    views = torch.nn.functional.normalize(torch.tensor([[1.0, 0.3, -0.4], [0.2, -1, 0.5]], dtype=DOUBLE), dim=-1)
    shares = from_afar(vertices, topology, views, size=2048)
    coarse = from_afar(vertices, topology, views, size=256)
    triangles = vertices[torch.tensor([t for a, b, c, d in topology.face_lists() for t in ([a, b, c], [a, c, d])])]
    own = topology.interior_edge_faces.repeat_interleave(8, 0)
    places = ((torch.arange(8) + 0.5) / 8)[:, None]
    ends = vertices[topology.interior_edges]
    points = torch.lerp(ends[:, :1], ends[:, 1:], places.to(DOUBLE)).reshape(-1, 3)
    for view, share, rough in zip(views, shares, coarse, strict=True):
        a, e, f = triangles[:, 0], triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0]
        p = torch.linalg.cross((-view).expand_as(f), f)
        det = (e * p).sum(-1)
        s = points[:, None] - a
        u = (s * p).sum(-1) / det
        q = torch.linalg.cross(s, e.expand_as(s))
        v, t = (q * -view).sum(-1) / det, (q * f).sum(-1) / det
        hit = (u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-9)
        faces = torch.arange(len(triangles)) // 2
        hit &= (faces != own[:, :1]) & (faces != own[:, 1:])
        free = (~hit.any(1)).view(-1, 8).to(DOUBLE).mean(1)
        expected = free * facing_share(vertices, topology, view)
        error = (share - expected).abs().mean()
        assert error < 2e-3
        assert error < 0.2 * (rough - expected).abs().mean()  # of first order in the size of a pixel
        facing_only = reflection_variation(
            vertices, topology, view[None], visibility=facing_share(vertices, topology, view)[None]
        )
        seen, exact = (
            reflection_variation(vertices, topology, view[None], visibility=x[None]) for x in (share, expected)
        )
        assert facing_only > 1.02 * exact  # there is something to hide
        torch.testing.assert_close(seen, exact, rtol=5e-3, atol=0)


def test_visible_variation_from_far_away_is_that_of_the_direction():
    vertices, topology = torus(12, 8)
    view = torch.nn.functional.normalize(torch.tensor([[1.0, 0.3, -0.4]], dtype=DOUBLE), dim=-1)
    eye = -1e4 * view
    near = reflection_variation_from_eyes(vertices, topology, eye, visibility=from_eyes(vertices, topology, eye))
    far = reflection_variation(vertices, topology, view, visibility=from_afar(vertices, topology, view))
    torch.testing.assert_close(1e4 * near, far, rtol=5e-3, atol=0)


def test_backs_mirror_as_well_and_shares_follow_motions():
    vertices, topology = wavy_grid(triangles=True)
    backs = Topology.from_faces([face[::-1] for face in topology.face_lists()])
    views = axis_directions() @ random_rotation(4).T
    shares = from_afar(vertices, topology, views)
    torch.testing.assert_close(from_afar(vertices, backs, views), shares)
    assert shares.dtype == DOUBLE
    assert from_afar(vertices.float(), topology, views).dtype == torch.float32
    assert shares.mean() > 0.1


def test_nothing_is_visible_outside_of_the_picture_or_behind_the_eye():
    vertices, topology = wavy_grid(triangles=True)
    away = OrthographicCamera(torch.tensor([0.0, 0, -1]), targets=vertices.mean(0) + 100)
    assert not edge_visibility(vertices, topology, away).any()
    behind = PerspectiveCamera(vertices.mean(0) + torch.tensor([0, 0, 9.0]), vertices.mean(0) + 20)
    assert not edge_visibility(vertices, topology, behind).any()


def test_meshes_without_edges_or_area():
    nothing = Topology.from_faces([], num_vertices=2)
    camera = OrthographicCamera(axis_directions())
    assert edge_visibility(torch.zeros(2, 3), nothing, camera).shape == (6, 0)
    assert not edge_visibility(torch.zeros(8, 3), cube()[1], camera).any()


def test_wrong_arguments_are_named():
    vertices, topology = cube()
    camera = OrthographicCamera(axis_directions())
    with pytest.raises(TorchfairError, match="not finite"):
        edge_visibility(vertices * math.nan, topology, camera)
    with pytest.raises(ShapeError, match="samples"):
        edge_visibility(vertices, topology, camera, samples=0)
    with pytest.raises(ShapeError, match="size"):
        edge_visibility(vertices, topology, camera, size=0)
    with pytest.raises(ShapeError, match="one mesh"):
        edge_visibility(vertices[None], topology, camera)


@pytest.mark.parametrize("offset", [0.0, 1e6])
@pytest.mark.parametrize("size", [12, 24, 64])
def test_edges_that_are_settled_as_a_whole_have_the_shares_of_their_points(
    offset: float, size: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Short edges are told by the pixels around them, and no point of them is otherwise."""
    views = axis_directions() @ random_rotation(2).T
    ball = icosphere(3)
    meshes = [cube(), random_polytope(1), torus(), wavy_grid(9, 8), (ball.vertices, ball.topology)]
    told = 0
    for vertices, topology in meshes:
        vertices = vertices.to(DOUBLE) + offset
        camera = OrthographicCamera.fit(vertices, directions=views)
        narrow = dataclasses.replace(camera, half_widths=0.7 * camera.half_widths)  # edges beside the picture, too
        for chosen in (camera, narrow):
            with monkeypatch.context() as patch:
                patch.setattr(visibility, "_settle", lambda share, left, *others: left)
                expected = edge_visibility(vertices, topology, chosen, size=size)
            counts = []
            settle = visibility._settle

            def counting(share, left, *others, settle=settle, counts=counts):
                rest = settle(share, left, *others)
                counts.append(len(left) - len(rest))
                return rest

            with monkeypatch.context() as patch:
                patch.setattr(visibility, "_settle", counting)
                assert torch.equal(edge_visibility(vertices, topology, chosen, size=size), expected)
            told += sum(counts)
    assert told > 500
