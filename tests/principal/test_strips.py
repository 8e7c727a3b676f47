"""Developable strips: closed forms on surfaces of revolution, isometry, and quads that are planar or not."""

from __future__ import annotations

import itertools
import math

import pytest
import torch
from helpers import DOUBLE, random_rotation
from principal_lattices import LATTICES
from torch import Tensor

from torchfair import MeshError, ShapeError, Topology, TorchfairError
from torchfair.principal import developable_strips, principal_edges_of_lattice, strip_limits
from torchfair.shapes import Cylinder, Enneper, Torus, principal_triangles

every_lattice = pytest.mark.parametrize("name", LATTICES)


def circle(count: int, radius: float, z: float, tilt: float) -> tuple[Tensor, Tensor, Tensor]:
    """Points on a circle, normals that rise by ``tilt`` from its plane, and the closed polyline."""
    angle = torch.arange(count, dtype=DOUBLE) * (math.tau / count)
    outward = torch.stack([angle.cos(), angle.sin(), 0 * angle], dim=1)
    up = torch.tensor([0.0, 0, 1], dtype=DOUBLE)
    return radius * outward + z * up, math.cos(tilt) * outward + math.sin(tilt) * up, closed(count)


def closed(count: int) -> Tensor:
    return torch.arange(count + 1) % count


def distances(points: Tensor) -> Tensor:
    return torch.linalg.vector_norm(points[:, None] - points[None], dim=-1)


def quads(strips) -> Tensor:
    """(Q, 4, 2) corners on the sheet."""
    return strips.uv[strips.topology.corners.view(-1, 4)]


# ---- closed forms ----------------------------------------------------------------------------------------


def test_a_planar_strip_is_laid_flat_as_it_is() -> None:
    """Round the equator of a torus: a ring, which closes on the sheet up to the cut."""
    points, normals, line = circle(24, 4.0, 0.0, 0.0)
    strips = developable_strips(points, [line], normals, 0.7, depth=0.2)
    assert strips.names == ("1",)
    assert torch.allclose(distances(strips.uv), distances(strips.vertices), atol=1e-12)
    assert torch.allclose(strips.uv[:2], strips.uv[-2:], atol=1e-12)


@pytest.mark.parametrize("tilt", [0.3, 1.0, -0.8])
def test_a_strip_on_a_circle_of_latitude_is_a_sector_of_an_annulus(tilt: float) -> None:
    """Rulings lie on a cone and meet in its apex, on the sheet too."""
    count, radius, height = 30, 3.0, 0.5
    points, normals, line = circle(count, radius, 0.4, tilt)
    strips = developable_strips(points, [line], normals, height)
    rulings = strips.uv.view(-1, 2, 2)
    slant = radius / math.cos(tilt)
    apex = rulings[:, 0] - slant / height * (rulings[:, 1] - rulings[:, 0])
    assert torch.allclose(apex, apex[:1].expand_as(apex), atol=1e-11)
    across = rulings[:, 0] - apex
    assert torch.allclose(torch.linalg.vector_norm(across, dim=1), torch.tensor(slant, dtype=DOUBLE))
    x, y = across.unbind(1)
    turn = torch.atan2(x[:-1] * y[1:] - y[:-1] * x[1:], x[:-1] * x[1:] + y[:-1] * y[1:]).abs().sum()
    assert float(turn) == pytest.approx(2 * count * math.asin(math.cos(tilt) * math.sin(math.pi / count)))


def test_a_strip_on_the_topmost_circle_of_a_torus_is_a_rectangle() -> None:
    count, radius, height = 20, 3.0, 0.5
    points, normals, line = circle(count, radius, 1.0, math.pi / 2)
    strips = developable_strips(points, [line], normals, height, gap=0.0)
    length = 2 * count * radius * math.sin(math.pi / count)
    assert strips.sheet == pytest.approx((length, height))
    rulings = strips.uv.view(-1, 2, 2)
    assert torch.allclose((rulings[:, 1] - rulings[:, 0]).abs(), torch.tensor([0.0, height], dtype=DOUBLE), atol=1e-12)


def test_strips_along_the_lines_of_a_cylinder_are_rectangles() -> None:
    mesh = principal_triangles(Cylinder(), 6, 12, along="v")
    lines = principal_edges_of_lattice(mesh).polylines()
    strips = developable_strips(mesh.vertices, lines, mesh.normals, 0.25, depth=0.25)
    (low, high) = mesh.surface.domain[1]
    for outline in strips.outlines():
        assert (outline.amax(0) - outline.amin(0)).tolist() == pytest.approx([high - low, 0.5])


# ---- isometry and planarity ------------------------------------------------------------------------------


@every_lattice
def test_principal_strips_are_isometric(name: str) -> None:
    mesh, _ = LATTICES[name]
    lines = principal_edges_of_lattice(mesh).polylines()
    strips = developable_strips(mesh.vertices, lines, mesh.normals, 0.2, depth=0.1)
    assert strips.isometry_errors.max() < 1e-6
    assert strips.planarity.max() < 1e-3
    foot = strips.vertices.view(-1, 2, 3)
    assert torch.allclose((2 * foot[:, 0] + foot[:, 1]) / 3, mesh.vertices[strips.mesh_vertices])
    used = sorted(len(line) for line in lines)
    assert sorted(strips.offsets.diff().tolist()) == used
    assert strips.topology.num_faces == sum(used) - len(used)


def test_isometry_error_against_a_slow_loop() -> None:
    mesh = principal_triangles(Enneper(), 6, 8)
    strips = developable_strips(mesh.vertices, principal_edges_of_lattice(mesh).polylines(), mesh.normals, 0.3)
    for error, face in zip(strips.isometry_errors.tolist(), strips.topology.face_lists(), strict=True):
        ratios = [
            float(torch.dist(strips.uv[a], strips.uv[b]) / torch.dist(strips.vertices[a], strips.vertices[b]))
            for a, b in itertools.combinations(face, 2)
        ]
        assert error == pytest.approx(max(abs(ratio - 1) for ratio in ratios), abs=1e-15)


def test_long_strips_keep_their_lengths() -> None:
    angle = torch.arange(5_001, dtype=DOUBLE) / 100
    points = torch.stack([10 * angle.cos(), 10 * angle.sin(), angle], dim=1)
    outward = torch.stack([angle.cos(), angle.sin(), 0 * angle], dim=1)
    strips = developable_strips(points, [torch.arange(5_001)], outward, 0.05, depth=0.05)
    assert strips.isometry_errors.max() < 1e-6
    rulings = strips.uv.view(-1, 2, 2)
    assert torch.allclose(torch.linalg.vector_norm(rulings[:, 1] - rulings[:, 0], dim=1), torch.tensor(0.1).double())


@every_lattice
def test_planarity_is_the_determinant_of_normals_and_edge(name: str) -> None:
    """The diagonals p, q of a quad from b - a have det(p, q, b - a) = h^2 det(n(w), n(v), w - v)."""
    mesh, _ = LATTICES[name]
    generator = torch.Generator().manual_seed(3)
    normals = mesh.normals + 0.1 * torch.randn(mesh.normals.shape, generator=generator, dtype=DOUBLE)
    normals = normals / torch.linalg.vector_norm(normals, dim=1, keepdim=True)
    height = 0.05
    strips = developable_strips(mesh.vertices, principal_edges_of_lattice(mesh).polylines(), normals, height)
    corners = strips.topology.corners.view(-1, 4)
    v, w = strips.mesh_vertices[corners[:, 0] // 2], strips.mesh_vertices[corners[:, 1] // 2]
    determinant = torch.linalg.det(torch.stack([normals[v], normals[w], mesh.vertices[w] - mesh.vertices[v]], 1))
    a, b, c, d = strips.vertices[corners].unbind(1)
    area = torch.linalg.vector_norm(torch.linalg.cross(c - a, d - b), dim=1)
    edges = torch.stack([b - a, c - b, d - c, a - d])
    mean = torch.linalg.vector_norm(edges, dim=-1).mean(0)
    assert torch.allclose(strips.planarity, height**2 * determinant.abs() / (area * mean), atol=1e-12)
    assert determinant.abs().max() > 1e-3


def test_isometry_errors_are_of_second_order_in_planarity() -> None:
    points, normals, line = circle(12, 3.0, 0.0, 0.5)
    errors, deviations = [], []
    for twist in (0.02, 0.01, 0.005):
        turned = normals + twist * torch.linalg.cross(normals, points)
        turned = turned / torch.linalg.vector_norm(turned, dim=1, keepdim=True)
        strips = developable_strips(points, [line], turned, 1.0)
        errors.append(float(strips.isometry_errors.max()))
        deviations.append(float(strips.planarity.max()))
    for a, b in itertools.pairwise(range(3)):
        assert deviations[a] / deviations[b] == pytest.approx(2, rel=0.02)
        assert errors[a] / errors[b] == pytest.approx(4, rel=0.05)


@every_lattice
def test_the_sheet_is_oriented_like_the_strips(name: str) -> None:
    mesh, _ = LATTICES[name]
    strips = developable_strips(mesh.vertices, principal_edges_of_lattice(mesh).polylines(), mesh.normals, 0.2)
    a, b, c, d = quads(strips).unbind(1)
    for p, q, r in ((a, b, c), (b, c, d), (c, d, a), (d, a, b)):
        assert (torch.linalg.det(torch.stack([q - p, r - q], dim=1)) > 0).all()
    for outline in strips.outlines():
        x, y = outline.unbind(1)
        assert (x * y.roll(-1) - y * x.roll(-1)).sum() > 0


def test_rotation_scale_and_length_of_normals_do_not_matter() -> None:
    mesh = principal_triangles(Enneper(), 6, 8)
    lines, rotation = principal_edges_of_lattice(mesh).polylines(), random_rotation(1)
    first = developable_strips(mesh.vertices, lines, mesh.normals, 0.3)
    moved = 5.0 * mesh.vertices @ rotation.T + torch.tensor([1.0, 2, 3])
    second = developable_strips(moved, lines, 0.1 * mesh.normals @ rotation.T, 1.5)
    assert second.names == first.names
    assert torch.allclose(first.planarity, second.planarity, atol=1e-12)
    for one, other in zip(first.outlines(), second.outlines(), strict=True):
        assert torch.allclose(5 * distances(one), distances(other), atol=1e-9)
    single = developable_strips(mesh.vertices.float(), lines, mesh.normals.float(), 0.3)
    assert single.vertices.dtype == single.uv.dtype == torch.float64
    assert torch.allclose(single.vertices, first.vertices, atol=1e-5)


# ---- how far rulings reach -------------------------------------------------------------------------------


def test_limits_are_radii_of_curvature() -> None:
    torus = principal_triangles(Torus(), 8, 12, along="v")
    limits = strip_limits(torus.vertices, principal_edges_of_lattice(torus).polylines(), torus.normals)
    assert limits.height == math.inf
    assert limits.depth == pytest.approx(Torus().minor_radius)
    points, normals, line = circle(16, 2.5, 0.0, 0.0)
    assert strip_limits(points, [line], -normals) == pytest.approx((2.5, math.inf))
    assert strip_limits(points, [], normals) == (math.inf, math.inf)


@pytest.mark.parametrize("factor", [0.99, 1.01])
def test_quads_are_convex_below_the_limits_only(factor: float) -> None:
    generator = torch.Generator().manual_seed(5)
    angle = torch.linspace(0, 3, 20, dtype=DOUBLE)
    points = torch.stack([angle.cos(), angle.sin(), 0 * angle], dim=1)
    lean = angle + 0.05 * torch.randn(20, generator=generator, dtype=DOUBLE)
    normals = -torch.stack([lean.cos(), lean.sin(), 0 * angle], dim=1)
    height = factor * strip_limits(points, [torch.arange(20)], normals).height
    a, b = points[:-1], points[1:]
    c, d = b + height * normals[1:], a + height * normals[:-1]
    turns = [torch.linalg.cross(q - p, r - q)[:, 2] for p, q, r in ((a, b, c), (b, c, d), (c, d, a), (d, a, b))]
    assert bool((torch.stack(turns) > 0).all()) == (factor < 1)


def test_rulings_that_meet_are_refused() -> None:
    points, normals, line = circle(16, 2.5, 0.0, 0.0)
    developable_strips(points, [line], normals, 0.1, depth=2.49)
    with pytest.raises(MeshError, match=r"16 edge\(s\) of the polylines, \(0, 1\).* a depth below 2\.5 will do"):
        developable_strips(points, [line], normals, 0.1, depth=2.51)


def test_edges_without_length_and_normals_along_edges_are_refused() -> None:
    points, normals, line = circle(6, 1.0, 0.0, 0.0)
    same = points.clone()
    same[3] = same[2]
    with pytest.raises(MeshError, match=r"1 edge\(s\) of the polylines, \(2, 3\), have no length or a normal along"):
        developable_strips(same, [line], normals, 0.1)
    along = normals.clone()
    along[2] = points[2] - points[3]
    with pytest.raises(MeshError, match="have no length or a normal along them"):
        developable_strips(points, [line], along, 0.1)
    assert strip_limits(points, [line], along) == (0, 0)


# ---- input -----------------------------------------------------------------------------------------------


def test_strips_leave_out_what_has_no_normal() -> None:
    points, normals, line = circle(10, 2.0, 0.0, 0.4)
    normals[[0, 4]] = 0
    strips = developable_strips(points, [line], normals, 0.1)
    assert strips.names == ("1a", "1b")
    assert strips.mesh_vertices.tolist() == [1, 2, 3, 5, 6, 7, 8, 9]
    normals[[0, 4]] = normals[1].clone()
    normals[3] = 0
    round_the_gap = developable_strips(points, [line], normals, 0.1)
    assert round_the_gap.mesh_vertices.tolist() == [4, 5, 6, 7, 8, 9, 0, 1, 2]
    open_line = developable_strips(points, [torch.arange(5), torch.arange(3, 5)], normals, 0.1)
    assert open_line.mesh_vertices.tolist() == [0, 1, 2]
    assert open_line.polylines.tolist() == [0]


@pytest.mark.parametrize("is_closed", [True, False])
@pytest.mark.parametrize("missing", [0, 1, 2, 3])
def test_strips_cover_each_edge_between_two_normals_once(missing: int, is_closed: bool) -> None:
    """However many normals are missing, and wherever along the polyline; no strip goes on across a gap."""
    count = 7
    points, normals, line = circle(count, 2.0, 0.0, 0.4)
    line = line if is_closed else line[:-1]
    for gaps in itertools.combinations(range(count), missing):
        some = normals.clone()
        some[list(gaps)] = 0
        expected = [(v, w) for v, w in itertools.pairwise(line.tolist()) if v not in gaps and w not in gaps]
        strips = developable_strips(points, [line], some, 0.1)
        parts = [strips.mesh_vertices[a:b].tolist() for a, b in itertools.pairwise(strips.offsets.tolist())]
        assert sorted(step for part in parts for step in itertools.pairwise(part)) == sorted(expected)
        starts = {v for v, _ in expected} - {w for _, w in expected}
        assert len(parts) == (1 if is_closed and not gaps else len(starts))


def test_no_polylines_no_strips() -> None:
    points, normals, line = circle(6, 1.0, 0.0, 0.0)
    for lines, n in (([], normals), ([line], 0 * normals)):
        strips = developable_strips(points, lines, n, 0.1)
        assert strips.topology.num_faces == strips.topology.num_vertices == 0
        assert strips.vertices.shape == (0, 3)
        assert strips.uv.shape == (0, 2)
        assert strips.names == ()
        assert strips.outlines() == []
        assert strips.sheet == (0, 0)
        assert strips.planarity.shape == strips.isometry_errors.shape == (0,)


def test_bad_input() -> None:
    points, normals, line = circle(6, 1.0, 0.0, 0.0)
    for height, depth in ((-1.0, 0.0), (math.nan, 0.0), (0.0, 0.0), (0.1, -0.1)):
        with pytest.raises(TorchfairError, match=r"^(height|depth): "):
            developable_strips(points, [line], normals, height, depth=depth)
    for name in ("gap", "sheet_width"):
        with pytest.raises(TorchfairError, match=f"{name}: expected a length that is finite and not negative"):
            developable_strips(points, [line], normals, 0.1, **{name: -1.0})
    with pytest.raises(ShapeError, match="normals: expected"):
        developable_strips(points, [line], normals[:5], 0.1)
    with pytest.raises(ShapeError, match="vertices: expected a floating"):
        developable_strips(points[None], [line], normals, 0.1)
    for bad in (line[:1], line.double(), line[None]):
        with pytest.raises(ShapeError, match="polylines: expected vertex numbers"):
            developable_strips(points, [bad], normals, 0.1)
    with pytest.raises(MeshError, match=r"polylines: no such vertices: \[6\]; the mesh has 6"):
        developable_strips(points, [torch.tensor([5, 6])], normals, 0.1)
    broken = points.clone()
    broken[2, 0] = math.nan
    with pytest.raises(TorchfairError, match="vertices: not finite at vertices 2 of polylines"):
        developable_strips(broken, [line], normals, 0.1)
    developable_strips(broken, [line[:3] % 2 + 3], normals, 0.1)  # not on the polyline, does not matter


def test_representation_and_topology() -> None:
    points, normals, line = circle(8, 1.0, 0.0, 0.0)
    strips = developable_strips(points, [line, line[:4]], normals, 0.1)
    assert repr(strips) == "DevelopableStrips(2 strips, 11 quads)"
    assert isinstance(strips.topology, Topology)
    assert strips.topology.is_quadrangular
    assert len(strips.topology.boundary_loops()) == 2
    face_normal = torch.linalg.cross(points[1] - points[0], normals[0])
    a, b, _, d = strips.vertices[strips.topology.corners[:4]]
    assert torch.dot(torch.linalg.cross(b - a, d - a), face_normal) > 0
