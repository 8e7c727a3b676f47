"""Area, C and other integrals over the analytic surfaces."""

from __future__ import annotations

import math

import numpy as np
import pytest
import torch

from torchfair.errors import TorchfairError
from torchfair.shapes import (
    SURFACES,
    Catenoid,
    Cone,
    Cylinder,
    Enneper,
    FreeFormPatch,
    Helicoid,
    Hyperboloid,
    Paraboloid,
    PrincipalHelicoid,
    PrincipalParaboloid,
    Sphere,
    Surface,
    Torus,
)
from torchfair.shapes._quadrature import integrate_with_kink

PI = math.pi
CLOSED = [
    Sphere(1.3, (-1.0, 1.2)),
    Torus(2.0, 0.5, (0.3, 4.0), angles=(-1.0, 2.0)),
    Cylinder(0.5, 3.0),
    Cone(1.0, 0.2, 2.0),
    Catenoid(0.7, (-0.5, 1.0)),
    Hyperboloid(1.2, 0.7, (-0.4, 1.0)),
    Enneper(0.9),
    PrincipalHelicoid(-0.6),
]


# ---- C -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("surface", "value"),
    [
        (Sphere(2.5), 8 * PI * 2.5),
        (Torus(3.0, 0.7), 4 * PI**2 * 3 + 8 * PI * 0.7),
        (Cylinder(0.3, 4.0), 2 * PI * 4),
        (Cone(1.0, 3.0, 0.5), 2 * PI * 0.5),
        (Catenoid(1.0, (-0.3, 1.1)), 4 * PI * 1.4),
        (Catenoid(2.5, (-0.3, 1.1)), 4 * PI * 1.4),
        (Enneper(0.8), 16 * 0.64),
        (Helicoid(2.0, (-2.0, 0.0), (0.0, 3.0)), 4 * 3 * math.asinh(1)),
        (PrincipalHelicoid(2.0, 0.5), 4.0),
    ],
)
def test_closed_forms_of_total_absolute_curvature(surface, value):
    assert surface.total_absolute_curvature() == pytest.approx(value, rel=1e-14)


@pytest.mark.parametrize("surface", CLOSED, ids=lambda surface: type(surface).__name__)
def test_closed_forms_agree_with_quadrature(surface):
    assert surface.absolute_line_curvatures() == pytest.approx(
        Surface.absolute_line_curvatures(surface), rel=1e-11, abs=1e-13
    )


@pytest.mark.parametrize("surface", [CLOSED[1], CLOSED[4], CLOSED[6]], ids=lambda surface: type(surface).__name__)
def test_quadrature_without_principal_lines_agrees(surface):
    """The rule for general surfaces, with its kinks where K changes sign, on surfaces whose C is known."""
    value = integrate_with_kink(
        lambda u, v: surface.principal_curvatures(u, v).abs().sum(-1) * surface.area_element(u, v),
        surface.gaussian_curvature,
        surface.domain,
    )
    assert value == pytest.approx(surface.total_absolute_curvature(), rel=1e-11)


@pytest.mark.parametrize("name", ["torus", "enneper", "hyperboloid", "helicoid", "spherical_zone"])
def test_total_absolute_curvature_adds_up(name):
    surface = SURFACES[name]()
    (u0, u1), (v0, v1) = surface.domain
    u, v = 0.3 * u0 + 0.7 * u1, 0.6 * v0 + 0.4 * v1
    parts = [((a, b), (c, d)) for a, b in ((u0, u), (u, u1)) for c, d in ((v0, v), (v, v1))]
    total = sum(surface.total_absolute_curvature(part) for part in parts)
    assert total == pytest.approx(surface.total_absolute_curvature(), rel=1e-13)


def test_total_absolute_curvature_is_a_length():
    for small, large in ((Torus(2.0, 0.5), Torus(6.0, 1.5)), (FreeFormPatch(1), FreeFormPatch(1, 3.0, 1.5))):
        assert large.total_absolute_curvature() == pytest.approx(3 * small.total_absolute_curvature(), rel=1e-10)


def test_kinked_quadrature_against_midpoints():
    """Without cutting panels at K = 0 the plain midpoint rule gives the same value to its own accuracy."""
    surface, size = FreeFormPatch(0), 200
    (u0, u1), (v0, v1) = surface.domain
    middles = (torch.arange(size, dtype=torch.float64) + 0.5) / size
    u, v = torch.meshgrid(u0 + (u1 - u0) * middles, v0 + (v1 - v0) * middles, indexing="ij")
    density = surface.principal_curvatures(u, v).abs().sum(-1) * surface.area_element(u, v)
    total = float(density.mean()) * (u1 - u0) * (v1 - v0)
    assert surface.total_absolute_curvature() == pytest.approx(total, rel=1e-4)


def test_kink_is_cut_exactly():
    """Integral of |v - u/3 - 0.1234| over a square: a kink along a slanted line, exact up to rounding."""

    def height(u, v):
        return v - u / 3 - 0.1234

    value = integrate_with_kink(lambda u, v: height(u, v).abs(), height, ((0.0, 1.0), (0.0, 1.0)))
    u = np.polynomial.polynomial.Polynomial([0.1234, 1 / 3])  # the root of v
    inner = (u**2 + (1 - u) ** 2) / 2
    assert value == pytest.approx(inner.integ()(1.0) - inner.integ()(0.0), rel=1e-13)


def test_bowl_has_total_absolute_curvature_twice_its_mean_curvature():
    bowl = PrincipalParaboloid(2.0, 0.5, (0.7, 1.0))
    mean = bowl.integrate(lambda u, v: -bowl.principal_curvatures(u, v).sum(-1))
    assert bowl.total_absolute_curvature() == pytest.approx(mean, rel=1e-12)


# ---- other integrals -----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("surface", "value"),
    [
        (Sphere(2.0), 16 * PI),
        (Torus(3.0, 1.0), 12 * PI**2),
        (Cylinder(0.5, 3.0), 3 * PI),
        (Cone(2.0, 1.0, 1.0), 3 * PI * math.sqrt(2)),
        (Catenoid(1.0, (0.0, 1.0)), PI * (1 + math.sinh(2) / 2)),
        (Paraboloid(0.0, 0.0, (1.0, 2.0)), 8.0),
    ],
)
def test_areas(surface, value):
    assert surface.area() == pytest.approx(value, rel=1e-12)


def test_total_mean_curvature_is_positive_where_convex():
    for surface, value in ((Sphere(2.0), 4 * PI * 2), (Cylinder(0.5, 3.0), 3 * PI), (Torus(3.0, 1.0), 6 * PI**2)):
        total = surface.integrate(lambda u, v, surface=surface: 0.5 * surface.principal_curvatures(u, v).sum(-1))
        assert total == pytest.approx(value, rel=1e-12)
    for surface in (Catenoid(), Enneper(), Helicoid(), PrincipalHelicoid()):
        u, v = torch.linspace(0.1, 0.5, 9).double(), torch.linspace(0.4, 0.0, 9).double()
        assert surface.principal_curvatures(u, v).sum(-1).abs().max() < 1e-12


def test_gauss_bonnet_on_closed_surfaces():
    for surface, euler in ((Sphere(1.7), 2), (Torus(), 0)):
        assert surface.integrate(surface.gaussian_curvature) == pytest.approx(2 * PI * euler, abs=1e-10)


@pytest.mark.parametrize("name", SURFACES)
def test_gauss_bonnet_on_patches(name):
    """Integral of K, plus geodesic curvature of the sides, plus exterior angles of the corners: 2 pi."""
    surface = SURFACES[name]()
    (u0, u1), (v0, v1) = surface.domain
    u0, u1, v0, v1 = (0.9 * u0 + 0.1 * u1, 0.4 * u0 + 0.6 * u1, 0.8 * v0 + 0.2 * v1, 0.3 * v0 + 0.7 * v1)
    corners = [(u0, v0), (u1, v0), (u1, v1), (u0, v1)]
    total = surface.integrate(surface.gaussian_curvature, ((u0, u1), (v0, v1)))
    nodes, weights = (torch.from_numpy(a) for a in np.polynomial.legendre.leggauss(40))
    ends = []
    for (a, b), (c, d) in zip(corners, [*corners[1:], corners[0]], strict=True):

        def curve(t, a=a, b=b, c=c, d=d):
            return surface.position(a + (c - a) * t, b + (d - b) * t)

        def velocity(t, curve=curve):
            return torch.func.jvp(curve, (t,), (torch.ones_like(t),))[1]

        t = 0.5 * (nodes + 1)
        normal = surface.normal(a + (c - a) * t, b + (d - b) * t)
        speed, bend = torch.func.jvp(velocity, (t,), (torch.ones_like(t),))
        turn = (torch.linalg.cross(speed, bend) * normal).sum(-1) / (speed**2).sum(-1)
        total += float((0.5 * weights * turn).sum())
        ends.append(velocity(torch.tensor([0.0, 1.0], dtype=torch.float64)))
    for before, after in zip(ends, [*ends[1:], ends[0]], strict=True):
        cos = torch.nn.functional.cosine_similarity(before[1], after[0], dim=0)
        total += math.acos(float(cos))
    assert total == pytest.approx(2 * PI, abs=1e-9)


# ---- sub-rectangles ------------------------------------------------------------------------------------


@pytest.mark.parametrize("domain", [((0.0, 2.0), (0.0, 0.1)), ((0.1, 0.0), (0.0, 0.1)), ((0.0, 0.1), (-0.9, 0.0))])
def test_domain_outside(domain):
    surface = Enneper(0.8)
    for method in (surface.area, surface.total_absolute_curvature, surface.absolute_line_curvatures):
        with pytest.raises(TorchfairError, match="is not inside"):
            method(domain)


def test_periodic_domain_may_cross_the_seam_but_not_overlap():
    torus = Torus()
    across = torus.total_absolute_curvature(((5.0, 8.0), (-1.0, 1.0)))
    assert across == pytest.approx(torus.total_absolute_curvature(((0.0, 3.0), (-1.0, 1.0))))
    with pytest.raises(TorchfairError, match="is not inside"):
        torus.area(((0.0, 7.0), (0.0, 1.0)))
