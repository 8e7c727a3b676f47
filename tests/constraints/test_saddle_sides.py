"""Saddle sides: what stars lack, against their definition and against pyramids."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
import torch
from helpers import DOUBLE, random_rotation
from torch import Tensor

from torchfair.constraints.principal_symmetric import star_stencil
from torchfair.constraints.saddle_sides import SaddleSides
from torchfair.constraints.side_curvatures import (
    angle_excess,
    angle_excess_derivative,
    side_curvatures,
    side_curvatures_derivative,
)
from torchfair.geometry import corner_angles
from torchfair.principal import principal_edges_of_lattice
from torchfair.principal.principal_edges import PrincipalStars
from torchfair.principal.spheres import spheres_through
from torchfair.projection.differentiation import differentiate
from torchfair.shapes import Catenoid, Torus, principal_triangles
from torchfair.stars import pyramid_self_intersections


def symmetric_star(principal: float, other: float, *, sideways: float = 0.0) -> torch.Tensor:
    """(1, 7, 3) star whose principal neighbours have curvature ``principal`` and the others ``other``.

    ``sideways`` bends the principal polyline within the surface.
    """
    places = [(1.0, sideways), (0.5, 0.9), (-0.5, 0.9), (-1.0, sideways), (-0.5, -0.9), (0.5, -0.9)]
    rows = [[0.0, 0.0, 0.0]]
    for number, (x, y) in enumerate(places):
        curvature = principal if number in (0, 3) else other
        rows.append([x, y, 0.5 * curvature * (x * x + y * y)])
    return torch.tensor([rows], dtype=DOUBLE)


def test_angle_excess_equals_the_sum_of_corner_angles() -> None:
    mesh = principal_triangles(Torus(2.0, 1.0), 12, 16)
    stars = principal_edges_of_lattice(mesh).stars()
    sums = torch.zeros(mesh.topology.num_vertices, dtype=DOUBLE)
    sums.index_add_(0, mesh.topology.corners, corner_angles(mesh.vertices, mesh.topology))
    excess = angle_excess(mesh.vertices[star_stencil(stars)])
    torch.testing.assert_close(excess, sums[stars.vertices] - 2.0 * math.pi)
    assert bool((excess > 0).any())
    assert bool((excess < 0).any())


@pytest.mark.parametrize("sideways", [0.0, 0.2, -0.2])
def test_face_sides_follow_their_definition(sideways: float) -> None:
    star = symmetric_star(0.3, -0.5, sideways=sideways) @ random_rotation(1).T + 1.0
    v, w1, w2, w3, w4, w5, w6 = star[0]
    values = []
    for a, b in ((w2, w3), (w5, w6)):
        normal = torch.linalg.cross(a - v, b - v)
        normal = normal / normal.norm()
        values += [2.0 * normal @ (w - v) / (w - v).square().sum() for w in (w1, w4)]
    sides, spheres = side_curvatures(star)
    torch.testing.assert_close(sides[0, 2:], torch.stack(values))
    fitted = spheres_through(star[:, 0], star[:, [2, 3, 5, 6]])
    tangent = [2.0 * fitted.normals[0] @ (w - v) / (w - v).square().sum() for w in (w1, w4)]
    torch.testing.assert_close(sides[0, :2], torch.stack(tangent))
    torch.testing.assert_close(spheres, fitted.curvatures)


def test_stars_on_the_right_side_of_both_faces_have_simple_pyramids_and_others_cross() -> None:
    """The bound is sharp: where a principal neighbour passes through the plane of a face the pyramid closes up."""
    from torchfair import Topology

    fan = Topology.from_faces([[0, 1 + i, 1 + (i + 1) % 6] for i in range(6)])
    for sideways in (0.0, 0.15, 0.3):
        for principal in torch.linspace(0.01, 0.6, 30).tolist():
            star = symmetric_star(principal, -0.5, sideways=sideways)
            if float(angle_excess(star)) < 1e-3:
                continue
            sides = side_curvatures(star)[0]
            beyond = bool((sides > 0.0).all())
            crossings = int(pyramid_self_intersections(star[0], fan)[0])
            if beyond:
                assert crossings == 0
            elif float(sides[0, 2:].min()) < -1e-3:
                assert crossings > 0


def test_decisions_and_what_is_lacking() -> None:
    mesh = principal_triangles(Catenoid(), 8, 14, ends="zigzag")
    stars = principal_edges_of_lattice(mesh, "u").stars()
    sides = SaddleSides(stars)
    assert sides.decide(mesh.vertices) == len(stars.vertices)  # nothing was decided before
    assert sides.decide(mesh.vertices) == 0
    assert sides.count_wrong(mesh.vertices) == 0
    assert bool(sides.is_saddle.all())
    (term,) = sides.terms(weight=1.0)
    state = {"vertices": mesh.vertices}
    assert float(term.missed(term.values(term.arguments(state))).max()) == 0.0
    assert float(term.values(term.arguments(state)).min()) < 0.0  # what holds has a margin that steps know
    wide = SaddleSides(stars, margin=100.0)
    values = wide.terms(weight=1.0)[0].values(wide.terms(weight=1.0)[0].arguments(state))
    assert float(values.max()) > 0.0
    (blind,) = sides.terms(weight=1.0, ahead=False)
    assert torch.equal(blind.values(blind.arguments(state)), term.missed(term.values(term.arguments(state))))
    (slight,) = wide.terms(weight=1.0, share=1e-3)
    assert float(slight.missed(slight.values(slight.arguments(state))).max()) == 0.0
    # Pulled to the other side of the tangent plane, a principal neighbour makes stars lack something.
    bent = mesh.vertices.clone()
    inner = stars.principal[len(stars.vertices) // 2, 0]
    bent[inner] *= 1.15
    assert sides.count_wrong(bent) > 0
    assert float(term.values(term.arguments({"vertices": bent})).max()) > 0.0


def test_a_star_of_small_excess_is_to_lose_it_and_one_of_large_excess_is_to_be_a_saddle() -> None:
    mesh = principal_triangles(Torus(2.0, 1.0), 12, 16, along="u")
    stars = principal_edges_of_lattice(mesh, "u").stars()
    sides = SaddleSides(stars)
    sides.decide(mesh.vertices)
    excess = angle_excess(mesh.vertices[sides.stencil])
    assert bool(sides.is_saddle[excess > 0.1].all())
    assert not bool(sides.is_saddle[excess <= 0.0].any())
    (term,) = sides.terms(weight=1.0)
    values = term.values(term.arguments({"vertices": mesh.vertices}))
    assert bool((values[~sides.is_saddle][:, :7] == 0.0).all())
    assert bool((values[sides.is_saddle][:, 7] == 0.0).all())


def single_stars(x: Tensor) -> tuple[Tensor, PrincipalStars]:
    """Vertices (7n, 3) of n stars ``x`` (n, 7, 3) that have nothing to do with each other."""
    first = 7 * torch.arange(x.shape[0])
    near = first[:, None] + torch.arange(7)
    return x.reshape(-1, 3), PrincipalStars(first, near[:, [1, 4]], near[:, [2, 3, 5, 6]])


def change_of_curvatures(sides: list[float], sphere: float, sign: float) -> float:
    """What it takes to bring the sphere to the side ``sign`` and the principal neighbours beyond all three planes."""
    return max(0.0, *(sign * side for side in sides)) + max(0.0, -sign * sphere)


def test_a_star_takes_the_side_of_the_smaller_change_and_is_a_saddle_if_that_is_nearer_than_losing_its_excess() -> None:
    """Of all curvatures the one of the sphere keeps its sign unless neighbours on its side ask for the other."""
    x = symmetric_star(0.0, 0.0).repeat(400, 1, 1)
    x[:, 1:] += 0.25 * torch.randn(400, 6, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(3))
    vertices, stars = single_stars(x)
    decided = SaddleSides(stars)
    decided.decide(vertices)
    is_saddle, per_curvature, _ = decided(state={})
    sides, spheres = (part.tolist() for part in side_curvatures(x))
    turned, saddles = 0, []
    for star, excess in enumerate(angle_excess(x).tolist()):
        beside = sides[star]
        keeps = 1.0 if spheres[star] >= 0 else -1.0
        asked = -1.0 if sum(beside) >= 0 else 1.0
        keep, turn = (change_of_curvatures(beside, spheres[star], sign) for sign in (keeps, asked))
        expected = asked if turn < keep else keeps
        assert math.copysign(1.0, float(per_curvature[star])) == expected
        turned += expected != keeps
        spokes = x[star, 1:] - x[star, 0]
        areas = [float(torch.linalg.cross(spokes[i], spokes[(i + 1) % 6]).norm()) for i in range(6)]
        size = max(abs(spheres[star]), sum(abs(side) for side in beside) / 6, 1e-2)
        saddles.append(excess > 0 and min(keep, turn) <= excess / (sum(areas) / 6 * size))
        assert abs(float(per_curvature[star])) == pytest.approx(1.0 / size)
    assert decided.is_saddle.tolist() == saddles == (is_saddle > 0).tolist()
    assert 20 < turned < 380
    assert 20 < sum(saddles) < 380
    assert int((angle_excess(x) > 0).sum()) > sum(saddles) + 20


@pytest.mark.parametrize(("sphere", "sign"), [(0.02, -1.0), (-0.02, -1.0), (0.9, 1.0), (-0.9, -1.0)])
def test_a_nearly_flat_sphere_is_turned_and_a_curved_one_kept(sphere: float, sign: float) -> None:
    """With principal neighbours at curvature 0.3 the sphere is to lie below them, unless it is far above."""
    vertices, stars = single_stars(symmetric_star(0.3, sphere))
    sides = SaddleSides(stars)
    sides.decide(vertices)
    assert math.copysign(1.0, float(sides(state={})[1])) == sign


def by_autograd(function: Callable[[Tensor], Tensor], x: Tensor) -> Tensor:
    """Derivative by the spokes of a function of stars (n, 7, 3) with values (n,)."""
    x = x.clone().requires_grad_()
    (gradient,) = torch.autograd.grad(function(x).sum(), x)
    return gradient[:, 1:]


def test_closed_derivatives_are_those_of_automatic_differentiation() -> None:
    generator = torch.Generator().manual_seed(5)
    mesh = principal_triangles(Torus(2.0, 1.0), 12, 16, along="u")
    noise = 0.03 * torch.randn(mesh.vertices.shape, dtype=DOUBLE, generator=generator)
    sides = SaddleSides(principal_edges_of_lattice(mesh, "u").stars())
    x = (mesh.vertices + noise)[sides.stencil]
    by_sides, by_spheres = side_curvatures_derivative(x)
    for number in range(6):
        expected = by_autograd(lambda y, i=number: side_curvatures(y)[0][:, i], x)
        assert float((by_sides[:, number] - expected).abs().max()) < 1e-10 * float(expected.abs().max())
    expected = by_autograd(lambda y: side_curvatures(y)[1], x)
    assert float((by_spheres - expected).abs().max()) < 1e-10 * float(expected.abs().max())
    expected = by_autograd(angle_excess, x)
    assert float((angle_excess_derivative(x) - expected).abs().max()) < 1e-11


def test_closed_derivatives_are_finite_on_flat_and_degenerate_stars() -> None:
    turn = torch.arange(6, dtype=DOUBLE) * math.pi / 3.0
    flat = torch.zeros(1, 7, 3, dtype=DOUBLE)
    flat[0, 1:, 0], flat[0, 1:, 1] = torch.cos(turn), torch.sin(turn)
    collapsed = flat * torch.tensor([1.0, 0.0, 0.0], dtype=DOUBLE)
    for star in (flat, collapsed, torch.zeros_like(flat)):
        for part in (*side_curvatures_derivative(star), angle_excess_derivative(star)):
            assert bool(torch.isfinite(part).all())
            assert float(part.abs().max()) < 1e3
    expected = by_autograd(angle_excess, flat)
    assert float((angle_excess_derivative(flat) - expected).abs().max()) < 1e-12


def test_derivative_of_the_terms() -> None:
    mesh = principal_triangles(Torus(2.0, 1.0), 12, 16, along="u")
    sides = SaddleSides(principal_edges_of_lattice(mesh, "u").stars(), margin=0.5)
    sides.decide(mesh.vertices)
    assert 0 < int(sides.is_saddle.sum()) < len(sides.is_saddle)
    state = {"vertices": mesh.vertices}
    for ahead in (True, False):
        (term,) = sides.terms(weight=1.0, share=0.7, ahead=ahead)
        arguments = term.arguments(state)
        _, expected = differentiate(term.residual, arguments, 1, batched=True)
        assert float((term.jacobians(arguments) - expected).abs().max()) < 1e-10 * float(expected.abs().max())
