"""Positions, normals, curvatures and principal directions of the analytic surfaces."""

from __future__ import annotations

import math

import pytest
import torch
from torch.func import jacrev, jvp, vmap

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

CASES = {name: make() for name, make in SURFACES.items()} | {
    "bowl": PrincipalParaboloid(2.0, 0.5, (0.7, 1.0)),
    "flat hill": PrincipalParaboloid(-0.5, -2.0, (1.0, 0.7)),
    "trough": PrincipalParaboloid(0.0, 1.5),
    "turned saddle": PrincipalParaboloid(-0.5, 1.0),
    "left helicoid": Helicoid(-0.7),
    "free form 3": FreeFormPatch(3, half_width=2.0),
    "octant": Sphere(2.0, (0.1, 1.2), angles=(0.0, 1.5)),
}
PRINCIPAL = [name for name, surface in CASES.items() if surface.parameter_lines_are_principal]


def sample(surface, count=40, seed=0):
    """Random parameters inside the domain, away from its ends."""
    generator = torch.Generator().manual_seed(seed)
    places = 0.05 + 0.9 * torch.rand(2, count, generator=generator, dtype=torch.float64)
    return [low + (high - low) * place for (low, high), place in zip(surface.domain, places, strict=True)]


@pytest.fixture(params=list(CASES), ids=lambda name: name.replace(" ", "_"))
def surface(request):
    return CASES[request.param]


# ---- any surface ---------------------------------------------------------------------------------------


def test_tangents_are_limits_of_secants(surface):
    u, v = sample(surface)
    h = 1e-5
    x_u, x_v = surface.tangents(u, v)
    for tangent, du, dv in ((x_u, h, 0), (x_v, 0, h)):
        secant = (surface.position(u + du, v + dv) - surface.position(u - du, v - dv)) / (2 * h)
        scale = tangent.abs().max()
        torch.testing.assert_close(secant, tangent, rtol=0, atol=1e-8 * float(scale))


def test_normals_and_frame_are_right_handed_orthonormal(surface):
    u, v = sample(surface)
    x_u, x_v = surface.tangents(u, v)
    frame = torch.cat([surface.frame(u, v), surface.normal(u, v)[:, None]], dim=1)
    torch.testing.assert_close(frame @ frame.mT, torch.eye(3, dtype=torch.float64).expand(40, 3, 3))
    torch.testing.assert_close(torch.linalg.det(frame), torch.ones(40, dtype=torch.float64))
    assert (torch.linalg.cross(x_u, x_v) * frame[:, 2]).sum(-1).min() > 0
    torch.testing.assert_close((frame[:, 0] * x_u).sum(-1), x_u.norm(dim=-1))


def test_tangents_are_forward_derivatives(surface):
    """Along u, along v."""
    u, v = sample(surface)
    one, zero = torch.ones_like(u), torch.zeros_like(u)
    for found, direction in zip(surface.tangents(u, v), ((one, zero), (zero, one)), strict=True):
        torch.testing.assert_close(found, jvp(surface._position, (u, v), direction)[1], rtol=1e-13, atol=1e-13)


def test_weingarten(surface):
    """Along a principal direction the normal changes by k times the step: dn = k dx."""
    u, v = sample(surface)
    parameters = torch.stack([u, v], dim=-1)
    d_normal = vmap(jacrev(lambda p: surface.normal(p[0], p[1])))(parameters)
    d_position = vmap(jacrev(lambda p: surface.position(p[0], p[1])))(parameters)
    directions = surface.principal_directions(u, v)
    steps = torch.linalg.lstsq(d_position, directions.mT).solution  # parameters' change along each direction
    expected = surface.principal_curvatures(u, v)[:, None] * directions.mT
    torch.testing.assert_close(d_normal @ steps, expected, rtol=1e-9, atol=1e-9)


def test_fundamental_form_identities(surface):
    """K and 2H from the forms, and III - 2 H II + K I = 0 with III from the derivatives of the normal."""
    u, v = sample(surface)
    first, second = (form[..., [0, 1, 1, 2]].unflatten(-1, (2, 2)) for form in surface.fundamental_forms(u, v))
    k1, k2 = surface.principal_curvatures(u, v).unbind(-1)
    assert (k1 >= k2).all()
    torch.testing.assert_close(k1 * k2, torch.linalg.det(second) / torch.linalg.det(first))
    torch.testing.assert_close(surface.gaussian_curvature(u, v), k1 * k2)
    torch.testing.assert_close(k1 + k2, torch.linalg.solve(first, second).diagonal(dim1=-2, dim2=-1).sum(-1))
    n = vmap(jacrev(lambda p: surface.normal(p[0], p[1])))(torch.stack([u, v], dim=-1))
    third = (k1 + k2)[:, None, None] * second - (k1 * k2)[:, None, None] * first
    torch.testing.assert_close(n.mT @ n, third, rtol=1e-9, atol=1e-9)


def test_principal_directions_are_an_orthonormal_tangent_pair(surface):
    u, v = sample(surface)
    directions, normal = surface.principal_directions(u, v), surface.normal(u, v)
    torch.testing.assert_close(directions @ directions.mT, torch.eye(2, dtype=torch.float64).expand(40, 2, 2))
    torch.testing.assert_close(torch.linalg.cross(directions[:, 0], directions[:, 1]), normal)


def test_area_element_from_the_first_form(surface):
    u, v = sample(surface)
    e, f, g = surface.fundamental_forms(u, v)[0].unbind(-1)
    torch.testing.assert_close(surface.area_element(u, v) ** 2, e * g - f**2)


@pytest.mark.parametrize("name", ["sphere", "torus", "paraboloid", "principal_helicoid", "free_form_patch"])
def test_parameters_broadcast_and_keep_dtype(name):
    surface = CASES[name]
    u, v = sample(surface, 6)
    for method in (surface.position, surface.normal, surface.principal_curvatures, surface.principal_directions):
        grid = method(u[:, None], v[None, :4])
        assert grid.shape[:2] == (6, 4)
        torch.testing.assert_close(grid[2, 3], method(u[2], v[3]))
        assert method(u.float(), v.float()).dtype == torch.float32
    torch.testing.assert_close(vmap(surface.normal)(u, v), surface.normal(u, v))


def test_closed_form_partials():
    """Surfaces that replace the derivatives by closed forms agree with automatic differentiation."""
    replaced = [s for s in CASES.values() if type(s)._partials is not Surface._partials]
    assert replaced
    for surface in replaced:
        u, v = sample(surface)
        for ours, exact in zip(surface._partials(u, v), Surface._partials(surface, u, v), strict=True):
            torch.testing.assert_close(ours, exact, rtol=1e-12, atol=1e-12)


@pytest.mark.parametrize("name", ["torus", "paraboloid", "helicoid", "free_form_patch"])
def test_curvatures_can_be_differentiated(name):
    u, v = sample(CASES[name], 2)
    inputs = (u.requires_grad_(), v.requires_grad_())
    assert torch.autograd.gradcheck(CASES[name].principal_curvatures, inputs, fast_mode=True)


@pytest.mark.parametrize("name", PRINCIPAL)
def test_principal_parameter_lines(name):
    """Both forms are diagonal, and directions are those of the lines, without arbitrary signs."""
    surface = CASES[name]
    u, v = sample(surface)
    first, second = surface.fundamental_forms(u, v)
    assert first[:, 1].abs().max() < 1e-12 * first.abs().max()
    assert second[:, 1].abs().max() < 1e-12 * first.abs().max()
    lines = surface.line_curvatures(u, v)
    torch.testing.assert_close(lines.sort(dim=-1, descending=True).values, surface.principal_curvatures(u, v))
    along = surface.principal_directions(u, v)[:, 0] @ surface.frame(u, v).mT
    assert torch.allclose(along.diagonal(dim1=0, dim2=1).abs().max(0).values, torch.ones(()).double())
    assert along.diagonal(dim1=0, dim2=1).min() > -1e-6


def test_other_parameter_lines_are_not_principal():
    for name in set(CASES) - set(PRINCIPAL):
        first, second = CASES[name].fundamental_forms(*sample(CASES[name]))
        assert max(first[:, 1].abs().max(), second[:, 1].abs().max()) > 1e-3, name


def test_periods_close():
    for surface in CASES.values():
        ends = surface.domain
        for axis, periodic in enumerate(surface.periodic):
            u, v = sample(surface)
            start, end = (torch.full_like(u, value) for value in ends[axis])
            gap = surface.position(*((start, v) if axis == 0 else (u, start))) - surface.position(
                *((end, v) if axis == 0 else (u, end))
            )
            assert (gap.abs().max() < 1e-12) == periodic


# ---- closed forms --------------------------------------------------------------------------------------


def curvatures(surface, u, v):
    return surface.principal_curvatures(torch.tensor(u).double(), torch.tensor(v).double()).tolist()


def test_outward_normals():
    for surface in (Sphere(2.0), Cylinder(), Cone(), Catenoid(), Hyperboloid()):
        u, v = sample(surface)
        radial = torch.stack([u.cos(), u.sin()], dim=-1)
        assert (surface.normal(u, v)[:, :2] * radial).sum(-1).min() > 0
    torus = Torus()
    u, v = sample(torus)
    centre = 2.0 * torch.stack([u.cos(), u.sin(), 0 * u], dim=-1)
    torch.testing.assert_close(torus.position(u, v) - centre, 0.8 * torus.normal(u, v))


def test_upward_normals():
    for surface in (Paraboloid(), PrincipalParaboloid(), PrincipalParaboloid(1.0, 3.0, (0.4, 0.4)), Enneper()):
        assert surface.normal(torch.zeros(1).double(), torch.zeros(1).double())[0, 2] == pytest.approx(1)


def test_curvatures_with_sign():
    assert curvatures(Sphere(2.0), 0.3, 0.7) == pytest.approx([0.5, 0.5])
    assert curvatures(Cylinder(0.5), 1.0, 0.4) == pytest.approx([2.0, 0.0])
    # torus, angle v around the tube: 1/r and cos v / (R + r cos v)
    assert curvatures(Torus(3.0, 1.0), 0.2, 2.0) == pytest.approx([1.0, math.cos(2) / (3 + math.cos(2))])
    # cone of slope angle t against the axis: cos t / r and 0
    assert curvatures(Cone(1.0, 0.0001, 0.9999), 0.0, 0.25) == pytest.approx([math.cos(math.pi / 4) / 0.75, 0.0])
    assert curvatures(Catenoid(2.0), 0.1, 1.0) == pytest.approx([0.5 / math.cosh(0.5) ** 2, -0.5 / math.cosh(0.5) ** 2])
    assert curvatures(Hyperboloid(2.0, 3.0), 0.0, 0.0) == pytest.approx([1 / 2, -2 / 9])
    assert curvatures(Enneper(), 0.5, -0.3) == pytest.approx([2 / 1.34**2, -2 / 1.34**2])
    assert curvatures(Helicoid(0.5), 0.3, math.asinh(2.0)) == pytest.approx([0.4, -0.4])
    assert curvatures(PrincipalHelicoid(0.5), 0.0, 0.0) == pytest.approx([2.0, -2.0])
    # z up: a valley bends against the normal and is negative
    for surface in (Paraboloid(1.5, -0.5), PrincipalParaboloid(1.5, -0.5)):
        assert curvatures(surface, 0.0, 0.0) == pytest.approx([0.5, -1.5])


def test_points_satisfy_their_equations():
    for surface, equation in (
        (Sphere(2.0), lambda x, y, z: x**2 + y**2 + z**2 - 4),
        (Torus(3.0, 1.0), lambda x, y, z: ((x**2 + y**2).sqrt() - 3) ** 2 + z**2 - 1),
        (Cylinder(2.0), lambda x, y, z: x**2 + y**2 - 4),
        (Cone(1.0, 0.5, 2.0), lambda x, y, z: (x**2 + y**2).sqrt() - 1 + z / 4),
        (Catenoid(2.0), lambda x, y, z: (x**2 + y**2).sqrt() - 2 * (z / 2).cosh()),
        (Hyperboloid(2.0, 0.5), lambda x, y, z: (x**2 + y**2) / 4 - z**2 / 0.25 - 1),
        (Paraboloid(2.0, -1.0), lambda x, y, z: x**2 - y**2 / 2 - z),
        (PrincipalParaboloid(2.0, -1.0), lambda x, y, z: x**2 - y**2 / 2 - z),
        (PrincipalParaboloid(2.0, 0.5, (0.7, 1)), lambda x, y, z: x**2 + y**2 / 4 - z),
        (Helicoid(0.5, angles=(-1.0, 1.0)), lambda x, y, z: x * (2 * z).sin() - y * (2 * z).cos()),
        (PrincipalHelicoid(0.5), lambda x, y, z: x * (2 * z).sin() - y * (2 * z).cos()),
    ):
        assert equation(*surface.position(*sample(surface)).unbind(-1)).abs().max() < 1e-13


@pytest.mark.parametrize("case", [(1.0, -0.5), (-0.5, 1.0), (2.0, 0.5), (-0.5, -2.0)])
def test_principal_paraboloid_meets_the_axes_at_its_half_widths(case):
    surface = PrincipalParaboloid(*case, half_widths=(0.6, 0.5))
    (_, u), (_, v) = surface.domain
    zero = torch.zeros(()).double()
    assert surface.position(torch.tensor(u), zero)[:2].tolist() == pytest.approx([0.6, 0])
    assert surface.position(zero, torch.tensor(v))[:2].tolist() == pytest.approx([0, 0.5])
    x_u, x_v = surface.tangents(zero, zero)
    assert [*x_u, *x_v] == pytest.approx([1, 0, 0, 0, 1, 0])


# ---- umbilics, poles, seeds ----------------------------------------------------------------------------


def test_umbilic_has_the_u_line_first_and_finite_gradients():
    bowl = Paraboloid(1.0, 1.0)
    at = [torch.zeros(1).double().requires_grad_() for _ in range(2)]
    directions = bowl.principal_directions(*at)
    torch.testing.assert_close(directions, torch.eye(3)[None, :2].double())
    for value in (directions.sum(), bowl.principal_curvatures(*at).sum()):
        for gradient in torch.autograd.grad(value, at):
            assert torch.isfinite(gradient).all()


def test_sphere_at_its_poles():
    sphere = Sphere(2.0)
    u, v = torch.tensor([0.3, 0.3]).double(), torch.tensor([-math.pi / 2, math.pi / 2]).double()
    torch.testing.assert_close(sphere.normal(u, v), torch.tensor([[0, 0, -1.0], [0, 0, 1]]).double())
    torch.testing.assert_close(
        sphere.principal_directions(u, v)[0, 0], torch.tensor([-math.sin(0.3), math.cos(0.3), 0]).double()
    )
    torch.testing.assert_close(sphere.gaussian_curvature(u, v), torch.full((2,), 0.25).double())
    assert sphere.poles == (True, True)
    assert Sphere(latitudes=(0.0, math.pi / 2)).poles == (False, True)


@pytest.mark.parametrize("seed", range(5))
def test_free_form_curvature_changes_sign(seed):
    surface = FreeFormPatch(seed)
    line = torch.linspace(-1, 1, 41, dtype=torch.float64)
    curvature = surface.gaussian_curvature(line[:, None], line[None])
    assert (curvature > 0).double().mean() > 0.2
    assert (curvature < 0).double().mean() > 0.2
    assert surface.position(line[:, None], line[None])[..., 2].abs().max() <= 0.5


def test_free_form_is_determined_by_its_seed():
    u, v = sample(FreeFormPatch())
    assert torch.equal(FreeFormPatch(7).position(u, v), FreeFormPatch(7).position(u, v))
    assert not torch.allclose(FreeFormPatch(7).position(u, v), FreeFormPatch(8).position(u, v), atol=0.01)


# ---- errors --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Sphere(0.0), "radius must be a positive number, got 0.0"),
        (lambda: Sphere(latitudes=(-2.0, 1.0)), "latitudes must lie between"),
        (lambda: Torus(1.0, 2.0), "major_radius less minor_radius must be a positive number"),
        (lambda: Torus(angles=(0.0, 7.0)), "angles must span at most 6.28319"),
        (lambda: Cone(1.0, -0.5), "top_radius must be a positive number"),
        (lambda: Cylinder(math.nan), "radius must be a positive number, got nan"),
        (lambda: Catenoid(heights=(1.0, 1.0)), r"heights must be two finite numbers \(low, high\)"),
        (lambda: Hyperboloid(heights=(0.0, math.inf)), "heights must be two finite numbers"),
        (lambda: Paraboloid(math.inf, 1.0), "a must be a finite number"),
        (lambda: Paraboloid(half_widths=(1.0, 0.0)), r"half_widths\[1\] must be a positive number"),
        (lambda: PrincipalParaboloid(1.0, 1.0), "paraboloid of revolution"),
        (lambda: PrincipalParaboloid(2.0, 1.0, (0.6, 1.0)), "reaches the umbilic at 0.5"),
        (lambda: Enneper(-1.0), "extent must be a positive number"),
        (lambda: Helicoid(0.0), r"\|pitch\| must be a positive number"),
        (lambda: FreeFormPatch(amplitude=0.0), "amplitude must be a positive number"),
        (lambda: FreeFormPatch(-1), "seed must be an integer of at least 0, got -1"),
        (lambda: SURFACES["canopy"](length=-1.0), "length must be a positive number"),
    ],
)
def test_bad_arguments(make, message):
    with pytest.raises(TorchfairError, match=message):
        make()


def test_umbilics_of_the_bowl_end_its_principal_patch():
    """The distance in the error is that of the true umbilic: curvatures agree there and only there."""
    bowl = Paraboloid(2.0, 1.0)
    zero = torch.zeros(()).double()
    k1, k2 = bowl.principal_curvatures(torch.tensor(0.5).double(), zero)
    assert k1 == pytest.approx(float(k2))
    PrincipalParaboloid(2.0, 1.0, (0.499, 5.0))
