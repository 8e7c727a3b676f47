from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE, cube

from torchfair import Topology
from torchfair.rasterisation.rasterise import visible_triangles
from torchfair.shapes import icosphere
from torchfair.viewing import hiding, lines
from torchfair.viewing.camera import fit_camera
from torchfair.viewing.lines import Surface, visible_lines
from torchfair.viewing.render import MeshView

WALL = torch.tensor([[0.0, 0, 1], [0, 20, 1], [20, 20, 1], [20, 0, 1]], dtype=DOUBLE)
WALL_TRIANGLES = torch.tensor([[0, 1, 2], [0, 2, 3]])


def draw(ends: list[list[list[float]]], widths: list[float], wall: bool = False) -> torch.Tensor:
    """Lines (one after the other) over nothing or over a wall at depth 1, on 20 x 20 pixels."""
    points = torch.cat([WALL, torch.tensor(ends, dtype=DOUBLE).view(-1, 3)])
    triangles = WALL_TRIANGLES if wall else torch.zeros(0, 3, dtype=torch.int64)
    edges = 4 + torch.arange(2 * len(ends)).view(-1, 2)
    surface = Surface(points, triangles, visible_triangles(points, triangles, 20, 20))
    return visible_lines(surface, edges, torch.tensor(widths))


def test_line_has_its_width_and_square_ends() -> None:
    drawn = draw([[[5, 10, 0], [15, 10, 0]]], [4.0])
    expected = torch.full((20, 20), -1, dtype=torch.int32)
    expected[8:12, 3:17] = 0
    assert torch.equal(drawn, expected)


@pytest.mark.parametrize(("depth", "seen"), [(0.0, True), (1.0, True), (2.0, False)])
def test_line_before_on_and_behind_a_wall(depth: float, seen: bool) -> None:
    drawn = draw([[[5, 10, depth], [15, 10, depth]], [[0, 0, 0], [0, 0, 2]]], [2.0, 0.0], wall=True)
    assert bool((drawn == 0).any()) == seen


def test_line_through_a_wall_is_seen_in_front_of_it() -> None:
    drawn = draw([[[2, 10, 0], [18, 10, 2]]], [2.0], wall=True)
    columns = torch.nonzero((drawn == 0).any(0)).squeeze(1)
    assert columns.min() == 1
    assert abs(int(columns.max()) - 10) <= 1


def test_later_lines_are_on_top() -> None:
    crossing = [[[5.0, 10, 0], [15, 10, 0]], [[10, 5, 0], [10, 15, 0]]]
    assert draw(crossing, [2.0, 2.0])[10, 10] == 1
    assert draw(crossing[::-1], [2.0, 2.0])[10, 10] == 1


def test_lines_without_width_or_with_infinite_ends_are_left_out() -> None:
    lines = [[[5.0, 10, 0], [15, 10, 0]], [[5, 5, torch.nan], [15, 5, 0]]]
    assert bool((draw(lines, [0.0, 2.0]) == -1).all())


def test_point_like_line_is_harmless() -> None:
    assert bool((draw([[[5, 10, 0], [5, 10, 0]]], [2.0]) == -1).all())


@pytest.mark.parametrize("field_of_view", [0.0, 40.0])
def test_nine_edges_of_a_cube_are_seen(field_of_view: float) -> None:
    vertices, topology = cube()
    view = torch.tensor([1.0, -2, 1.5], dtype=DOUBLE)
    up = torch.tensor([0.0, 0, 1], dtype=DOUBLE)
    camera, size = fit_camera(vertices, towards_eye=view, up=up, width=200, height=200, field_of_view=field_of_view)
    mesh = MeshView(vertices, topology, camera, size, supersampling=1)
    surface = Surface(mesh.points, mesh.triangulation.triangles, mesh.triangle_index)
    drawn = visible_lines(surface, topology.edges, torch.full((12,), 2.0))
    hidden = vertices[topology.edges] @ (torch.sign(view)) == vertices.matmul(torch.sign(view)).min()
    counts = torch.bincount(drawn[drawn >= 0], minlength=12)
    at_hidden_vertex = hidden.any(1)
    assert at_hidden_vertex.sum() == 3
    assert bool((counts[at_hidden_vertex] < 12).all())  # nothing but the ends where they meet the outline
    assert bool((counts[~at_hidden_vertex] > 60).all())


@pytest.mark.parametrize("portion", [1, 7])
def test_lines_are_the_same_however_many_are_looked_at_together(portion: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Lines of many widths on a shaken sphere, half of them hidden, some off the screen."""
    mesh, generator = icosphere(2), torch.Generator().manual_seed(0)
    vertices = mesh.vertices + 0.1 * torch.rand(mesh.vertices.shape, generator=generator, dtype=DOUBLE)
    towards_eye, up = torch.tensor([[1.0, 0.4, 0.3], [0.0, 0.0, 1.0]], dtype=DOUBLE)
    camera, size = fit_camera(vertices[vertices[:, 1] > -0.8], towards_eye=towards_eye, up=up, width=120)
    view = MeshView(vertices, mesh.topology, camera, size)
    surface = Surface(view.points, view.triangulation.triangles, view.triangle_index)
    count = mesh.topology.num_edges
    widths = 5.0 * torch.rand(count, generator=generator)
    edges = mesh.topology.edges[torch.randperm(count, generator=generator)]
    at_once = visible_lines(surface, edges, widths)
    monkeypatch.setattr(lines, "_PORTION", portion)
    assert torch.equal(visible_lines(surface, edges, widths), at_once)
    assert 0.3 * count < len(torch.unique(at_once)) < 0.8 * count


@pytest.mark.parametrize("block", [8, 11, 16])
def test_lines_hidden_as_a_whole_are_told_by_blocks(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """As one by one: a fine sphere with a hole that shows its back, partly off the screen; and many are told."""
    mesh, generator = icosphere(5), torch.Generator().manual_seed(1)
    vertices = mesh.vertices * (1.0 + 0.01 * torch.rand(len(mesh.vertices), 1, generator=generator, dtype=DOUBLE))
    front = (mesh.vertices[mesh.topology.triangles].mean(1) @ torch.tensor([0.9, 0.3, 0.3], dtype=DOUBLE)) > 0.97
    topology = Topology.from_faces(mesh.topology.triangles[~front], num_vertices=len(vertices))
    towards_eye, up = torch.tensor([[1.0, 0.4, 0.3], [0.0, 0.0, 1.0]], dtype=DOUBLE)
    camera, size = fit_camera(vertices[vertices[:, 1] > -0.8], towards_eye=towards_eye, up=up, width=150)
    view = MeshView(vertices, topology, camera, size)
    surface = Surface(view.points, view.triangulation.triangles, view.triangle_index)
    widths = 1.0 + 2.0 * torch.rand(topology.num_edges, generator=generator)
    monkeypatch.setattr(lines, "_PORTION", topology.num_edges)
    looked_at, put = [], lines._put_lines
    monkeypatch.setattr(lines, "_put_lines", lambda *a: (looked_at.append(len(a[2].ends)), put(*a)))
    one_by_one = visible_lines(surface, topology.edges, widths)
    monkeypatch.setattr(lines, "_MANY", 1)
    monkeypatch.setattr(hiding, "_BLOCK", block)
    assert torch.equal(visible_lines(surface, topology.edges, widths), one_by_one)
    assert looked_at[0] == topology.num_edges
    assert looked_at[1] < 0.8 * looked_at[0]
    assert (one_by_one >= 0).any()


def shaken_sphere() -> tuple[Surface, torch.Tensor, torch.Tensor]:
    """A surface, partly off the screen, its edges, and widths."""
    mesh, generator = icosphere(2), torch.Generator().manual_seed(2)
    vertices = mesh.vertices + 0.15 * torch.rand(mesh.vertices.shape, generator=generator, dtype=DOUBLE)
    towards_eye, up = torch.tensor([[1.0, 0.4, 0.3], [0.0, 0.0, 1.0]], dtype=DOUBLE)
    camera, size = fit_camera(vertices[vertices[:, 1] > -0.8], towards_eye=towards_eye, up=up, width=90)
    view = MeshView(vertices, mesh.topology, camera, size, supersampling=1)
    surface = Surface(view.points, view.triangulation.triangles, view.triangle_index)
    return surface, mesh.topology.edges, 5.0 * torch.rand(mesh.topology.num_edges, generator=generator)


def test_lines_with_numbers_may_come_in_any_order() -> None:
    surface, edges, widths = shaken_sphere()
    order = torch.randperm(len(edges), generator=torch.Generator().manual_seed(3))
    ordered = visible_lines(surface, edges, widths)
    assert torch.equal(visible_lines(surface, edges[order], widths[order], order), ordered)
    widths[::3] = 0.0
    again = visible_lines(surface, edges[order], widths[order], order)
    assert torch.equal(again, visible_lines(surface, edges, widths))
    assert not torch.equal(again, ordered)


def test_lines_together_are_the_largest_of_lines_alone() -> None:
    """Some seen from end to end, some in part and some not at all; depths of all stay what they are."""
    surface, edges, widths = shaken_sphere()
    beside = torch.stack([surface.points.amin(0), surface.points.amax(0)])
    beside[:, 0] = -50.0
    surface = surface._replace(points=torch.cat([surface.points, beside]))
    depths = torch.tensor([[len(surface.points) - 2, len(surface.points) - 1]])
    together = visible_lines(surface, torch.cat([depths, edges]), torch.cat([torch.ones(1), widths]))
    expected = torch.full_like(together, -1)
    for number in range(len(edges)):
        alone = visible_lines(surface, torch.cat([depths, edges[number : number + 1]]), widths[[0, number]])
        expected = torch.where(alone == 1, number + 1, expected)
    assert torch.equal(together, expected)
