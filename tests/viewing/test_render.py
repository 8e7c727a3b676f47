from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE, cube, grid_faces, wavy_grid

from torchfair import ShapeError, Topology
from torchfair.cameras import OrthographicCamera
from torchfair.viewing.camera import fit_camera
from torchfair.viewing.lines import EdgeStyle
from torchfair.viewing.render import MeshView

UP = torch.tensor([0.0, 0, 1], dtype=DOUBLE)
ASLANT = torch.tensor([1.0, -2, 1.5], dtype=DOUBLE)
FRONTAL = (OrthographicCamera(-UP, half_widths=6.0, ups=torch.tensor([0.0, 1, 0])), (8, 12))


def plate(width: float, height: float) -> tuple[torch.Tensor, Topology]:
    """Two rectangles side by side in the plane z = 0, of the given total size."""
    x, y = torch.meshgrid(
        torch.tensor([-0.5, 0, 0.5], dtype=DOUBLE) * width,
        torch.tensor([-0.5, 0.5], dtype=DOUBLE) * height,
        indexing="ij",
    )
    vertices = torch.stack([x, y, torch.zeros_like(x)], dim=-1).view(-1, 3)
    return vertices, Topology.from_faces(grid_faces(3, 2))


@pytest.mark.parametrize("supersampling", [1, 2, 3])
def test_colours_arrive_unchanged_and_count_exactly(supersampling: int) -> None:
    mesh = MeshView(*plate(8, 4), *FRONTAL, supersampling=supersampling)
    colors = torch.tensor([[0.25, 0.5, 0.75], [1.0, 0, 0.125]])
    picture = mesh.paint(colors, background=(0.0, 1.0, 0.0))
    assert picture.shape == (8, 12, 3)
    for color, (rows, columns) in zip(colors, ((slice(2, 6), slice(2, 6)), (slice(2, 6), slice(6, 10))), strict=True):
        assert torch.allclose(picture[rows, columns], color.expand(4, 4, 3))
    green = torch.tensor([0.0, 1, 0])
    assert int((picture == green).all(-1).sum()) == 12 * 8 - 8 * 4


def test_partly_covered_pixels_are_averages() -> None:
    """A face that covers the left third of a pixel column gives it a third of its colour."""
    vertices, topology = plate(8 + 2 / 3, 4)
    picture = MeshView(vertices, topology, *FRONTAL).paint(torch.zeros(2, 3), background=(1.0, 1.0, 1.0))
    assert torch.allclose(picture[3, 1], torch.full((3,), 2 / 3))
    assert torch.allclose(picture[3, 10], torch.full((3,), 2 / 3))


@pytest.mark.parametrize("field_of_view", [0.0, 60.0])
def test_vertex_colours_are_affine_on_the_surface(field_of_view: float) -> None:
    """Colours that are an affine function of position appear as that function where the ray meets the surface."""
    vertices, topology = plate(2, 1)
    camera, size = fit_camera(vertices, towards_eye=ASLANT, up=UP, width=60, height=40, field_of_view=field_of_view)
    mesh = MeshView(vertices, topology, camera, size, supersampling=1)
    picture = mesh.paint_vertices(0.5 + 0.4 * vertices)
    rows, columns = torch.nonzero(mesh.face_index >= 0).unbind(1)
    places = (picture[rows, columns].to(DOUBLE) - 0.5) / 0.4
    projected = camera.project(places, size)[0, :, :2]
    assert torch.allclose(projected, torch.stack([columns + 0.5, rows + 0.5], dim=1).to(DOUBLE), atol=1e-3)
    assert places[:, 2].abs().max() < 1e-5


def test_vertex_colours_take_shades_and_background() -> None:
    mesh = MeshView(*plate(8, 4), *FRONTAL)
    picture = mesh.paint_vertices(torch.ones(6, 3), face_shades=torch.tensor([0.5, 0.25]), background=(1, 0, 0))
    assert torch.allclose(picture[3, 3], torch.full((3,), 0.5))
    assert torch.allclose(picture[3, 8], torch.full((3,), 0.25))
    assert torch.allclose(picture[0, 0], torch.tensor([1.0, 0, 0]))


def test_edges_have_their_colour_width_and_opacity() -> None:
    vertices, topology = plate(8, 4)
    colors = torch.zeros(topology.num_edges, 3)
    colors[0] = torch.tensor([1.0, 0, 0])  # the one interior edge, between the plates
    widths = torch.zeros(topology.num_edges)
    widths[0] = 2.0
    mesh = MeshView(vertices, topology, *FRONTAL)
    for opacity in (1.0, 0.25):
        picture = mesh.paint(torch.full((2, 3), 0.5), edges=EdgeStyle(colors, widths, opacity=opacity))
        expected = opacity * colors[0] + (1 - opacity) * 0.5
        assert torch.allclose(picture[3, 5:7], expected.expand(2, 3))
        assert torch.allclose(picture[3, 4], torch.full((3,), 0.5))


def test_edge_order_decides_what_is_on_top() -> None:
    vertices, topology = cube()
    camera, size = fit_camera(vertices, towards_eye=ASLANT, up=UP, width=40, height=40)
    mesh = MeshView(vertices, topology, camera, size, supersampling=1)
    colors = torch.linspace(0, 1, 12)[:, None].expand(12, 3)
    white = torch.ones(6, 3)
    up = mesh.paint(white, edges=EdgeStyle(colors, 3.0, torch.arange(12)))
    down = mesh.paint(white, edges=EdgeStyle(colors, 3.0, -torch.arange(12)))
    assert bool((up >= down).all())
    assert bool((up > down).any())
    assert torch.equal(up, mesh.paint(white, edges=EdgeStyle(colors, 3.0)))


@pytest.mark.parametrize("seed", range(4))
def test_of_lines_that_overlap_the_one_with_the_largest_order_is_on_top_whatever_the_order(seed: int) -> None:
    """As of the lines that cover a pixel when each is drawn alone."""
    vertices, topology = plate(8, 4)
    mesh, white = MeshView(vertices, topology, *FRONTAL, supersampling=1), torch.ones(2, 3)
    count = topology.num_edges
    colors, nothing = torch.linspace(0.1, 0.9, count)[:, None].expand(count, 3), torch.zeros(count)
    order = torch.randperm(count, generator=torch.Generator().manual_seed(seed)) * 3 - 5
    alone = [nothing.index_fill(0, torch.tensor(edge), 3.0) for edge in range(count)]
    pictures = [mesh.paint(white, edges=EdgeStyle(torch.zeros(3), widths)) for widths in alone]
    covered = torch.stack(pictures)[..., 0] < 1
    assert int(covered.sum(0).max()) >= 3
    on_top = torch.where(covered, order[:, None, None], order.min() - 1).argmax(0)
    expected = torch.where(covered.any(0), colors[on_top, 0], torch.ones(()))
    picture = mesh.paint(white, edges=EdgeStyle(colors, 3.0, order))
    assert torch.allclose(picture[..., 0], expected)


def test_the_same_mesh_gives_the_same_picture() -> None:
    vertices, topology = wavy_grid()
    camera, size = fit_camera(vertices, towards_eye=ASLANT, up=UP, width=80, height=60)
    colors = torch.linspace(0, 1, 3 * topology.num_faces).view(-1, 3)
    first, second = (
        MeshView(vertices, topology, camera, size).paint(colors, edges=EdgeStyle(torch.zeros(3), 1.0)) for _ in range(2)
    )
    assert torch.equal(first, second)


def test_an_empty_mesh_is_background() -> None:
    mesh = MeshView(torch.zeros(3, 3), Topology.from_faces([], 3), *FRONTAL)
    nothing = torch.zeros(0, 3)
    picture = mesh.paint(nothing, edges=EdgeStyle(torch.zeros(3), 1.0))
    assert torch.equal(picture, torch.ones(8, 12, 3))
    assert torch.equal(mesh.paint_vertices(torch.zeros(3, 3)), torch.ones(8, 12, 3))


def test_batches_are_refused() -> None:
    vertices, topology = plate(8, 4)
    with pytest.raises(ShapeError, match="not a batch"):
        MeshView(vertices[None], topology, *FRONTAL)
