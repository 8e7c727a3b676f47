"""Curvatures and directions by polynomials over rings."""

from __future__ import annotations

import math
from dataclasses import dataclass

import pytest
import torch
from geometry_meshes import DEGENERATE, GENERIC, flat_squares, with_isolated
from helpers import DOUBLE, random_rotation, wavy_grid
from torch import Tensor

from torchfair import ShapeError, Topology, TorchfairError
from torchfair.errors import SettingsError
from torchfair.geometry import (
    FittedCurvature,
    Patches,
    edge_lengths,
    fitted_curvature,
    principal_directions,
    principal_values,
    rings_for_noise,
    star_normals,
    vertex_areas,
)
from torchfair.geometry import _height_fits as fits_module
from torchfair.geometry import patches as patches_module
from torchfair.geometry.tangent_basis import tangent_bases
from torchfair.shapes import (
    Catenoid,
    Cylinder,
    Enneper,
    Paraboloid,
    Sphere,
    Surface,
    Torus,
    icosphere,
    irregular_triangles,
    parameter_quads,
    principal_quads,
)


@dataclass(frozen=True)
class MonkeySaddle(Surface):
    """``z = (x^3 - 3 x y^2) / 3``, with a flat umbilic in the middle."""

    domain = ((-1.0, 1.0), (-1.0, 1.0))

    def _position(self, u: Tensor, v: Tensor) -> Tensor:
        return torch.stack([u, v, (u**3 - 3 * u * v * v) / 3], dim=-1)


SURFACES = {
    "torus": Torus(2.0, 0.8),
    "saddle": Paraboloid(1.0, -0.7),
    "catenoid": Catenoid(),
    "enneper": Enneper(),
    "cylinder": Cylinder(0.5, 2.0),
    "monkey": MonkeySaddle(),
}
every_surface = pytest.mark.parametrize("name", SURFACES)


def angles(found: Tensor, exact: Tensor) -> Tensor:
    """Degrees between the first directions, seen along the exact normal."""
    x, y = ((found[..., 0, None, :] * exact).sum(-1)).abs().unbind(-1)
    return torch.rad2deg(torch.atan2(y, x))


def noisy(mesh, level: float, kind: str, seed: int = 1) -> Tensor:
    size = level * edge_lengths(mesh.vertices, mesh.topology).mean()
    generator = torch.Generator().manual_seed(seed)
    if kind == "normal":
        return mesh.vertices + size * mesh.normals * torch.randn(len(mesh.vertices), 1, generator=generator).double()
    return mesh.vertices + size * torch.randn(mesh.vertices.shape, generator=generator).double()


def distinct(mesh) -> Tensor:
    """Vertices with two curvatures."""
    k1, k2 = mesh.principal_curvatures.unbind(1)
    size = edge_lengths(mesh.vertices, mesh.topology).mean()
    return ((k1 - k2) * size > 0.02) & (k1 - k2 > 0.1 * (k1.abs() + k2.abs()))


def rim(topology: Topology) -> Tensor:
    """Vertices within two rings of the boundary."""
    near = topology.is_boundary_vertex.clone()
    v, w = topology.edges.unbind(1)
    for _ in range(2):
        near = near.index_put((torch.cat([v[near[w]], w[near[v]]]),), torch.tensor(True))
    return near


def errors(mesh, fit: FittedCurvature) -> tuple[Tensor, Tensor]:
    """Angles of the directions, and of the curvatures the larger error over their median."""
    exact = mesh.principal_curvatures
    return angles(fit.directions, mesh.principal_directions), (fit.curvatures - exact).abs().amax(1) / exact.abs().max()


@pytest.mark.parametrize("degree", [2, 3, 4])
def test_polynomials_of_degree_four_are_reproduced(degree) -> None:
    """Normal, curvatures and directions of the graph of a polynomial, where the plane is that of x and y."""
    x, y = torch.meshgrid(*[torch.linspace(-0.1, 0.1, 9, dtype=DOUBLE)] * 2, indexing="ij")
    height = 0.4 * x * x + 0.3 * x * y - 0.2 * y * y
    if degree > 2:
        height = height + x**3 - 2 * x * y * y
    if degree > 3:
        height = height + 3 * x**4 - 5 * x * x * y * y
    vertices = torch.stack([x, y, height], dim=-1).reshape(-1, 3)
    topology = wavy_grid(9, 9)[1]
    middle = 40
    fit = fitted_curvature(vertices, topology, rings=3)
    expected = torch.zeros(3, 3, dtype=DOUBLE)
    expected[:2, :2] = -torch.tensor([[0.8, 0.3], [0.3, -0.4]], dtype=DOUBLE)  # up, so a bowl is negative
    torch.testing.assert_close(fit.operators[middle], expected, rtol=0, atol=2e-4)
    torch.testing.assert_close(fit.normals[middle], torch.tensor([0.0, 0.0, 1.0], dtype=DOUBLE), rtol=0, atol=1e-5)
    assert fit.doubts[middle] < 1e-3


@every_surface
def test_clean_irregular_meshes(name) -> None:
    mesh = irregular_triangles(SURFACES[name], 1500)
    fit = fitted_curvature(mesh.vertices, mesh.topology)
    turned, curved = errors(mesh, fit)
    clear, edge = distinct(mesh), rim(mesh.topology)
    assert turned[clear & ~edge].median() < 0.1
    assert turned[clear & ~edge].quantile(0.95) < 0.3
    assert curved[~edge].median() < 5e-3
    if edge.any():
        assert turned[clear & edge].median() < 0.1
        assert curved[edge].median() < 5e-3
    assert fit.confidence[clear].median() > 0.99


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["normal", "all"])
@pytest.mark.parametrize(("level", "allowed"), [(0.0, 0.3), (0.03, 1.2), (0.1, 2.5)])
def test_the_figures_on_a_torus(level, allowed, kind) -> None:
    """Median over 4800 irregular vertices; star operators are at 2.8, 10 and 25 degrees (normal cycle)."""
    mesh = irregular_triangles(Torus(2.0, 0.8), 4800)
    found = principal_directions(noisy(mesh, level, kind), mesh.topology)
    in_space = torch.rad2deg(torch.acos((found * mesh.principal_directions).sum(-1).abs().clamp(max=1)))
    assert in_space.amax(1).median() < allowed


@pytest.mark.parametrize("kind", ["normal", "all"])
@pytest.mark.parametrize("level", [0.01, 0.03, 0.1])
@pytest.mark.parametrize("name", ["saddle", "cylinder", "torus", "catenoid"])
def test_noise_inside_and_at_the_boundary(name, level, kind) -> None:
    mesh = irregular_triangles(SURFACES[name], 1500)
    vertices = noisy(mesh, level, kind)
    turned, _ = errors(mesh, fitted_curvature(vertices, mesh.topology))
    stars = principal_directions(vertices, mesh.topology, estimator="corrected")
    clear, edge = distinct(mesh), rim(mesh.topology)
    inside = turned[clear & ~edge].median()
    assert inside < 2.5
    assert inside < angles(stars, mesh.principal_directions)[clear & ~edge].median() / 2
    if edge.any():
        assert turned[clear & edge].median() < 3 * inside


@pytest.mark.parametrize("name", ["saddle", "cylinder"])
def test_wide_patches_near_the_boundary_mend_what_noise_does_there(name: str) -> None:
    """Errors of directions at the boundary against those over narrow patches, and no other fits away from it."""
    mesh = irregular_triangles(SURFACES[name], 1500)
    vertices = torch.stack([noisy(mesh, 0.1, "normal", seed) for seed in (1, 2)])
    patches, narrow = Patches(mesh.topology, 4), Patches(mesh.topology, 4)
    narrow.wide, narrow.wide_places, narrow.num_rim_groups = narrow.groups, narrow.places, 0
    fits = [fitted_curvature(vertices, mesh.topology, rings=of) for of in (patches, narrow)]
    turned, before = (angles(fit.directions, mesh.principal_directions) for fit in fits)
    edge = distinct(mesh) & mesh.topology.is_boundary_vertex
    assert turned[:, edge].median() < 0.85 * before[:, edge].median()
    torch.testing.assert_close(turned[:, ~patches.border], before[:, ~patches.border])


def test_directions_converge_and_curvatures_with_nearly_the_third_order() -> None:
    sizes, turned, curved = [], [], []
    for count in (300, 1200, 4800):
        mesh = irregular_triangles(SURFACES["catenoid"], count)
        both = errors(mesh, fitted_curvature(mesh.vertices, mesh.topology))
        inside = ~rim(mesh.topology)
        sizes.append(edge_lengths(mesh.vertices, mesh.topology).mean().log())
        turned.append(both[0][inside].median().log())
        curved.append(both[1][inside].median().log())
    for values in (turned, curved):
        assert (values[0] - values[2]) / (sizes[0] - sizes[2]) > 2.7


def test_rings_are_as_many_as_the_noise_needs() -> None:
    mesh = irregular_triangles(SURFACES["saddle"], 1500)
    found = [rings_for_noise(noisy(mesh, level, "normal"), mesh.topology) for level in (0.0, 0.003, 0.02, 0.1)]
    assert found == sorted(found)
    assert found[0] == 2
    assert found[-1] >= 5
    moved = 1e-3 * noisy(mesh, 0.02, "normal") @ random_rotation(1).T + 5
    assert rings_for_noise(moved, mesh.topology) == found[2]


def test_doubts_are_the_errors_that_noise_makes() -> None:
    """Root mean square of the error of ``(k1 - k2) / 2`` in a fixed direction, over many samples of the noise."""
    mesh = irregular_triangles(SURFACES["saddle"], 300)
    middle = (mesh.vertices.square().sum(1)).argmin()
    patches = Patches(mesh.topology, 3)
    batch = torch.stack([noisy(mesh, 0.03, "normal", seed) for seed in range(60)])
    fit = fitted_curvature(batch, mesh.topology, rings=patches)
    plane = fit.traceless[:, middle, :2, :2]
    spread = ((plane - plane.mean(0)).square().sum((-2, -1)).mean() / 4).sqrt()
    assert fit.doubts[:, middle].mean() == pytest.approx(float(spread), rel=0.25)


@pytest.mark.parametrize(
    "faces", [[[0, 1, 2, 3]], [[0, 1, 2], [0, 2, 3]], [[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 1]]]
)
def test_confidence_is_zero_where_nothing_is_left_to_tell_the_error_by(faces: list[list[int]]) -> None:
    places = torch.tensor([[0, 0, 0.3], [1, 0, 0], [1, 1, 0.2], [-0.2, 1, 0], [-0.5, -1, 0]], dtype=DOUBLE)
    topology = Topology.from_faces(faces, num_vertices=5)
    fit = fitted_curvature(places, topology)
    assert float(fit.traceless.abs().max()) > 0.01
    assert float(fit.confidence.max()) == 0.0


def test_fewer_members_than_terms_cost_no_digits() -> None:
    ball = icosphere(0)  # six members of each patch count, of fifteen terms
    fit = fitted_curvature(ball.vertices, ball.topology, rings=2)
    torch.testing.assert_close(fit.normals, ball.vertices, rtol=0, atol=1e-11)
    assert float(fit.traceless.norm(dim=(-2, -1)).max()) < 1e-10


@pytest.mark.parametrize("rings", [2, 4])
def test_what_is_kept_between_both_fits_changes_nothing(rings: int, monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = irregular_triangles(Torus(), 300)
    fits = []
    monkeypatch.setattr(patches_module, "_PAIRS", 500)  # many groups
    for most in (0, 20_000, 1 << 27):
        monkeypatch.setattr(fits_module, "_KEPT", most)
        fits.append(fitted_curvature(mesh.vertices, mesh.topology, rings=rings))
    for fit in fits[1:]:
        assert torch.equal(fit.operators, fits[0].operators)
        assert torch.equal(fit.doubts, fits[0].doubts)


@pytest.mark.parametrize("level", [0.0, 0.02])
def test_rows_make_the_same_fit_as_least_squares_of_each_patch(level: float) -> None:
    mesh = irregular_triangles(Torus(), 300)
    noise = torch.randn(mesh.vertices.shape, generator=torch.Generator().manual_seed(3), dtype=DOUBLE)
    vertices, patches = mesh.vertices + level * noise, Patches(mesh.topology, 3)
    normals = star_normals(vertices, mesh.topology)
    found = fits_module.fitted_normals(vertices, normals, patches)
    members = {
        int(v): row[there]
        for group in patches.groups
        for v, row, there in zip(group.centres, group.members, group.present, strict=True)
    }
    for v in range(0, len(vertices), 17):
        around = members[v]
        apart = vertices[around] - vertices[v]
        weights = (normals[around] @ normals[v]).clamp_min(0).square()
        distance = apart.square().sum(-1)
        weights = weights * torch.exp(-2 * distance / ((distance * weights).sum() / weights.sum()))
        first, second = tangent_bases(normals[v])
        x, y, z = apart @ first, apart @ second, apart @ normals[v]
        terms = torch.stack([torch.ones_like(x), x, y, x * x, x * y, y * y], dim=-1)
        root = weights.sqrt()[:, None]
        slope = torch.linalg.lstsq(root * terms, root * z[:, None], driver="gelsd").solution[1:3, 0]
        normal = normals[v] - slope[0] * first - slope[1] * second
        torch.testing.assert_close(found[v], normal / normal.norm(), rtol=0, atol=1e-9)


def test_confidence_is_zero_where_there_is_no_direction() -> None:
    for mesh in (icosphere(3), irregular_triangles(Sphere(), 1000), parameter_quads(Paraboloid(1e-9, -1e-9), 20, 20)):
        assert fitted_curvature(mesh.vertices, mesh.topology).confidence.max() < 0.05
    assert not fitted_curvature(*flat_squares(), rings=2).confidence.any()
    vertices, topology = wavy_grid(30, 30, triangles=True)
    vertices = vertices * torch.tensor([1.0, 1.0, 0.0], dtype=DOUBLE)
    vertices[:, 2] = 0.05 * torch.randn(len(vertices), generator=torch.Generator().manual_seed(0)).double()
    assert fitted_curvature(vertices, topology).confidence.mean() < 0.1
    mesh = irregular_triangles(SURFACES["monkey"], 2000)
    fit = fitted_curvature(noisy(mesh, 0.03, "normal"), mesh.topology)
    from_middle = mesh.vertices[:, :2].norm(dim=1)
    assert fit.confidence[from_middle < 0.05].mean() < 0.4
    assert fit.confidence[from_middle > 0.5].median() > 0.9
    assert ((fit.confidence >= 0) & (fit.confidence <= 1)).all()
    wrong = angles(fit.directions, mesh.principal_directions)
    assert wrong[fit.confidence > 0.9].median() < wrong[(fit.confidence < 0.6)].median() / 3


def test_operators_fit_together() -> None:
    mesh = irregular_triangles(SURFACES["enneper"], 500)
    fit = fitted_curvature(mesh.vertices, mesh.topology)
    first, second = fit.directions.unbind(1)
    torch.testing.assert_close(torch.linalg.cross(first, second), fit.normals)
    torch.testing.assert_close((fit.operators @ first[..., None]).squeeze(-1), fit.curvatures[:, :1] * first)
    torch.testing.assert_close((fit.operators @ second[..., None]).squeeze(-1), fit.curvatures[:, 1:] * second)
    half = (fit.curvatures[:, :1] - fit.curvatures[:, 1:]) / 2
    torch.testing.assert_close((fit.traceless @ first[..., None]).squeeze(-1), half * first)
    torch.testing.assert_close((fit.traceless @ second[..., None]).squeeze(-1), -half * second)
    torch.testing.assert_close(fit.operators, fit.operators.mT)
    assert (fit.operators @ fit.normals[..., None]).abs().max() < 1e-12
    assert fit.traceless.diagonal(dim1=-2, dim2=-1).sum(-1).abs().max() < 1e-12
    torch.testing.assert_close(principal_directions(mesh.vertices, mesh.topology), fit.directions)
    values = principal_values(mesh.vertices, mesh.topology) / vertex_areas(mesh.vertices, mesh.topology)[:, None]
    torch.testing.assert_close(values, fit.curvatures)


def test_a_tube_bends_round_its_axis() -> None:
    mesh = principal_quads(Cylinder(0.5, 2.0), 8, 32)
    fit = fitted_curvature(mesh.vertices, mesh.topology)
    torch.testing.assert_close(fit.directions[:, 1, 2].abs(), torch.ones(len(mesh.vertices), dtype=DOUBLE))
    assert (fit.curvatures[:, 0] - 2).abs().max() < 0.02
    assert fit.curvatures[:, 1].abs().max() < 1e-6


def test_moves_scales_turns_and_renumbers_with_the_mesh() -> None:
    mesh = irregular_triangles(SURFACES["monkey"], 400)
    vertices, topology = noisy(mesh, 0.02, "all"), mesh.topology
    fit = fitted_curvature(vertices, topology)
    rotation = random_rotation(2)
    moved = fitted_curvature(1e3 * vertices @ rotation.T + 1e3, topology)
    torch.testing.assert_close(1e3 * moved.operators, rotation @ fit.operators @ rotation.T, rtol=1e-7, atol=1e-7)
    torch.testing.assert_close(moved.normals, fit.normals @ rotation.T)
    torch.testing.assert_close(moved.confidence, fit.confidence, rtol=0, atol=1e-6)
    order = torch.randperm(len(vertices), generator=torch.Generator().manual_seed(3))
    places = torch.argsort(order)
    faces = places[topology.triangles]
    renumbered = fitted_curvature(vertices[order], Topology.from_faces(faces.flip(0).roll(1, 1)))
    torch.testing.assert_close(renumbered.operators, fit.operators[order])
    reverse = fitted_curvature(vertices, Topology.from_faces(topology.triangles.flip(1)))
    torch.testing.assert_close(reverse.operators, -fit.operators)
    torch.testing.assert_close(reverse.confidence, fit.confidence)


@pytest.mark.parametrize("mesh", [*GENERIC.values(), *DEGENERATE.values()], ids=[*GENERIC, *DEGENERATE])
def test_any_mesh_has_finite_values_and_derivatives(mesh) -> None:
    vertices, topology = mesh()
    variable = vertices.clone().requires_grad_()
    fit = fitted_curvature(variable, topology)
    torch.testing.assert_close(torch.linalg.cross(*fit.directions.unbind(-2)), fit.normals)
    total = 0.0
    for values in (fit.normals, fit.operators, fit.curvatures, fit.directions, fit.confidence):
        assert values.isfinite().all()
        total = total + (values * torch.linspace(1, 2, values.numel()).double().view(values.shape)).sum()
    (gradient,) = torch.autograd.grad(total, variable)
    assert gradient.isfinite().all()


def test_isolated_vertices_have_nothing() -> None:
    fit = fitted_curvature(*with_isolated(wavy_grid(6, 6)))
    for values in (fit.normals, fit.operators, fit.directions, fit.confidence):
        assert not values[-1].any()


def test_derivatives() -> None:
    vertices, topology = wavy_grid(7, 6, triangles=True)
    patches = Patches(topology, 2)

    def values(points: Tensor) -> Tensor:
        fit = fitted_curvature(points, topology, rings=patches)
        return torch.cat([fit.operators[10:30].flatten(), fit.doubts[10:30]])

    start = vertices.clone().requires_grad_()
    assert torch.autograd.gradcheck(values, start, fast_mode=True, check_forward_ad=True)
    (gradient,) = torch.autograd.grad(values(start).sum(), start)
    for rings in (2, patches):
        found = torch.func.grad(lambda x, r=rings: fitted_curvature(x, topology, rings=r).operators[10:30].sum())(
            vertices
        )
        assert found.isfinite().all()
    torch.testing.assert_close(torch.func.grad(lambda x: values(x).sum())(vertices), gradient)


def test_batches_vmap_and_single_precision() -> None:
    mesh = parameter_quads(Torus(2.0, 0.8), 12, 20)
    batch = torch.stack([mesh.vertices, mesh.vertices * torch.tensor([1.0, 1.2, 0.9], dtype=DOUBLE)])
    together = fitted_curvature(batch, mesh.topology, rings=2)
    alone = fitted_curvature(batch[1], mesh.topology, rings=2)
    torch.testing.assert_close(together.operators[1], alone.operators)
    mapped = torch.func.vmap(lambda v: fitted_curvature(v, mesh.topology, rings=2).directions)(batch)
    torch.testing.assert_close(mapped, together.directions)
    single = fitted_curvature(batch.float(), mesh.topology, rings=2)
    for values in (single.normals, single.operators, single.directions, single.confidence):
        assert values.dtype == torch.float32
    torch.testing.assert_close(single.operators.double(), together.operators, rtol=0, atol=2e-3)
    with pytest.raises(TorchfairError, match="rings cannot be chosen by the noise inside vmap"):
        torch.func.vmap(lambda v: fitted_curvature(v, mesh.topology).operators)(batch)


def test_bad_input() -> None:
    vertices, topology = wavy_grid(5, 5)
    for rings in (1, 0, 2.5):
        with pytest.raises(SettingsError, match="rings must be a whole number of at least"):
            fitted_curvature(vertices, topology, rings=rings)
    with pytest.raises(ShapeError, match="rings: expected patches of"):
        fitted_curvature(vertices, topology, rings=Patches(wavy_grid(4, 4)[1], 2))
    with pytest.raises(ShapeError, match="vertices"):
        fitted_curvature(vertices[:-1], topology)
    with pytest.raises(TorchfairError, match='estimator must be "fitted"'):
        principal_directions(vertices, topology, estimator="cotangent")
    assert math.isfinite(float(fitted_curvature(vertices * 0, topology).operators.sum()))


@pytest.mark.parametrize("noise", [0.0, 0.05])
def test_fits_at_some_vertices(noise: float) -> None:
    """At all that are asked for as everywhere, but for what is pooled over fewer of them; zeros elsewhere."""
    mesh = irregular_triangles(Torus(2.0, 0.8), 1500)
    shake = torch.randn(mesh.vertices.shape, generator=torch.Generator().manual_seed(0), dtype=DOUBLE)
    vertices = mesh.vertices + noise * edge_lengths(mesh.vertices, mesh.topology).mean() * shake
    every = fitted_curvature(vertices, mesh.topology)
    whole = fitted_curvature(vertices, mesh.topology, at=torch.ones(1500, dtype=torch.bool)[: len(vertices)])
    assert whole.operators.equal(every.operators)
    assert whole.doubts.equal(every.doubts)
    at = torch.rand(len(vertices), generator=torch.Generator().manual_seed(1)) < 0.2
    some = fitted_curvature(vertices, mesh.topology, at=at)
    assert some.rings == every.rings
    apart = (some.operators - every.operators)[at].norm(dim=(1, 2)) / every.operators[at].norm(dim=(1, 2))
    assert float(apart.median()) < (0.03 if noise else 1e-3)
    assert (some.operators[~at] == 0).all()
    assert (some.confidence[~at] == 0).all()
    assert all(x.isfinite().all() for x in (some.normals, some.doubts, some.scales, some.curvatures))
