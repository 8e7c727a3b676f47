"""Gradients of pictures: against exact integrals, closed forms and differences; everything that moves counts."""

from __future__ import annotations

from functools import partial

import pytest
import torch
from geometry_meshes import torus
from helpers import DOUBLE, grid_faces, split_quads, wavy_grid
from reflection_tools import (
    EACH_KIND,
    STRIPES,
    exact_functional,
    pixel_places,
    random_soup,
    straight_down,
    vector,
)
from torch import Tensor

from torchfair import Topology
from torchfair.geometry import vertex_normals
from torchfair.reflection import (
    Camera,
    EquirectangularImage,
    OrthographicCamera,
    PerspectiveCamera,
    Stripes,
    cone_directions,
    render_reflection,
)
from torchfair.shapes import Catenoid, FreeFormPatch, Paraboloid, Surface, irregular_triangles

each_kind = pytest.mark.parametrize("kind", EACH_KIND.values(), ids=EACH_KIND)
VIEWS = cone_directions(vector(0.3, 0.2, -1), 120, 2)
SOFT = Stripes(vector(1, 0.3, 0.2), 1.5, 3.0)
SURFACES = {
    "saddle": (Paraboloid(1.0, -0.5), vector(0.3, 0.2, -1)),
    "patch": (FreeFormPatch(), vector(0.1, 0.2, -1)),
    "half a catenoid": (Catenoid(heights=(-0.8, 0.8), angles=(-1.0, 1.0)), None),
}


def weight(places: Tensor) -> Tensor:
    """A smooth weight on the unit picture."""
    return torch.cos(7 * places[..., 0] + 2) * torch.sin(5 * places[..., 1] + 1) + 0.3


def mesh_and_camera(surface: Surface, direction: Tensor | None, kind: type[OrthographicCamera]):  # type: ignore[no-untyped-def]
    mesh = irregular_triangles(surface, 330)
    vertices, topology = mesh.vertices.to(DOUBLE), mesh.topology
    direction = -vertex_normals(vertices, topology).mean(0) if direction is None else direction
    return vertices, topology, kind.fit(vertices, directions=direction)


def weighted_mean(vertices: Tensor, topology: Topology, camera: Camera, size: int, **settings) -> Tensor:  # type: ignore[no-untyped-def]
    """What :func:`exact_functional` is the limit of."""
    image = render_reflection(vertices, topology, camera, SOFT, size=size, **settings).image[0, 0]
    return (image * weight(pixel_places(size)).to(image)).mean()


def gradient_of(vertices: Tensor, function) -> Tensor:  # type: ignore[no-untyped-def]
    moved = vertices.clone().requires_grad_()
    (gradient,) = torch.autograd.grad(function(moved), moved)
    return gradient


@pytest.mark.parametrize(("surface", "direction"), SURFACES.values(), ids=SURFACES)
@each_kind
@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_gradient_is_that_of_the_exact_integral(
    surface: Surface, direction: Tensor | None, kind: type[OrthographicCamera], dtype: torch.dtype
) -> None:
    """1 % at 256 x 256, and 10 % of the part along the surface, are asked for; this is 10 and 20 times better."""
    vertices, topology, camera = mesh_and_camera(surface, direction, kind)
    exact = gradient_of(vertices, lambda v: exact_functional(v, topology, camera, SOFT, weight))
    rendered = gradient_of(vertices.to(dtype), lambda v: weighted_mean(v, topology, camera, 256)).to(DOUBLE)
    normals = vertex_normals(vertices, topology)
    error, size = rendered - exact, exact
    assert torch.linalg.vector_norm(error) < 0.001 * torch.linalg.vector_norm(size)
    error, size = (part - (part * normals).sum(-1, keepdim=True) * normals for part in (error, size))
    assert torch.linalg.vector_norm(error) < 0.005 * torch.linalg.vector_norm(size)


def test_error_of_the_gradient_falls_with_the_size_of_pixels() -> None:
    """Of second order for weights that vary slowly; three doublings make at least a factor of 3^3."""
    vertices, topology, camera = mesh_and_camera(*SURFACES["saddle"], OrthographicCamera)
    exact = gradient_of(vertices, lambda v: exact_functional(v, topology, camera, SOFT, weight))
    errors = []
    for size in (64, 512):
        rendered = gradient_of(vertices, partial(weighted_mean, topology=topology, camera=camera, size=size))
        errors.append(float(torch.linalg.vector_norm(rendered - exact)))
    assert errors[1] < errors[0] / 27


def directional_difference(function, vertices: Tensor, direction: Tensor, step: float = 1e-6) -> float:  # type: ignore[no-untyped-def]
    return float(function(vertices + step * direction) - function(vertices - step * direction)) / (2 * step)


def precise_difference(function, vertices: Tensor, direction: Tensor) -> float:  # type: ignore[no-untyped-def]
    """Of fourth order: colours of tiny faces change fast."""
    fine, coarse = (directional_difference(function, vertices, direction, step) for step in (1e-6, 2e-6))
    return (4 * fine - coarse) / 3


def apart(count: int, seed: int) -> tuple[Tensor, Topology]:
    """Triangles in layers of different depth: they hide each other without penetration."""
    vertices, topology = random_soup(count, seed)
    layers = torch.arange(count, dtype=DOUBLE).repeat_interleave(3)
    return torch.stack([vertices[:, 0], vertices[:, 1], 0.02 * vertices[:, 2] - 0.3 * layers], dim=1), topology


SCENES = {
    "torus": lambda: torus(12, 8),
    "torus of triangles": lambda: (torus(12, 8)[0], Topology.from_faces(split_quads(grid_torus()))),
    "layers": lambda: apart(25, 5),
    "quads not planar": wavy_grid,
}


def grid_torus():  # type: ignore[no-untyped-def]
    return torch.tensor(torus(12, 8)[1].face_lists()).numpy()


@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES)
@each_kind
@pytest.mark.parametrize("size", [5, 40])
def test_gradient_is_that_of_the_exact_mean_colours(scene, kind: type[OrthographicCamera], size: int) -> None:  # type: ignore[no-untyped-def]
    """With antialias value and gradient belong together, occlusion and faces smaller than pixels included."""
    vertices, topology = scene()
    generator = torch.Generator().manual_seed(1)
    vertices = vertices + 0.01 * torch.randn(vertices.shape, dtype=DOUBLE, generator=generator)
    camera = kind.fit(vertices, directions=VIEWS)
    weights = torch.randn(2, 3, size, size, dtype=DOUBLE, generator=generator)

    def functional(v: Tensor, antialias: bool = True) -> Tensor:
        seen = render_reflection(v, topology, camera, STRIPES, size=size, antialias=antialias)
        return (torch.cat([seen.image, seen.coverage[:, None]], dim=1) * weights).sum()

    gradient = gradient_of(vertices, functional)
    assert torch.equal(gradient, gradient_of(vertices, lambda v: functional(v, antialias=False)))
    for _ in range(3):
        direction = torch.randn(vertices.shape, dtype=DOUBLE, generator=generator)
        expected = precise_difference(functional, vertices, direction)
        assert float((gradient * direction).sum()) == pytest.approx(expected, abs=1e-5 * float(gradient.abs().amax()))


@each_kind
def test_gradients_on_the_way_add_up_to_the_change_of_a_finely_sampled_picture(kind: type[OrthographicCamera]) -> None:
    """A triangle moves before a bumpy grid: its outline passes over the colours behind it."""
    behind, grid = wavy_grid(6, 6, triangles=True)
    before = torch.tensor([[0.5, 0.5, 3], [3, 1, 3.4], [1, 2.7, 2.8]], dtype=DOUBLE)
    vertices = torch.cat([behind, before])
    topology = Topology.from_faces([*grid.face_lists(), [36, 37, 38]])
    camera = kind.fit(vertices, directions=vector(0.1, 0.1, -1))
    move = vector(1.5, 1.2, 0) * (torch.arange(39) >= 36)[:, None]

    def functional(v: Tensor, samples: int) -> Tensor:
        seen = render_reflection(v, topology, camera, SOFT, size=12, supersampling=samples)
        return (seen.image * pixel_places(12).sum(-1)).sum()

    steps = ((torch.arange(100, dtype=DOUBLE) + 0.5) / 100).tolist()
    gradients = (gradient_of(vertices + step * move, partial(functional, samples=2)) for step in steps)
    change = sum(float((gradient * move).sum()) for gradient in gradients) / 100
    first, last = (float(functional(v, samples=50)) for v in (vertices, vertices + move))
    assert abs(last - first) > 1
    assert change == pytest.approx(last - first, rel=0.01)


def test_moving_triangle_over_background_has_the_derivative_of_its_area() -> None:
    triangle = torch.tensor([[-3.1, -2.2, 0], [4.3, -1, 0.5], [0.7, 5.1, 1]], dtype=DOUBLE)
    topology = Topology.from_faces([[0, 1, 2]])
    camera = straight_down(10.0)
    rendered = gradient_of(triangle, lambda v: render_reflection(v, topology, camera, STRIPES, size=64).coverage.sum())

    def pixels(v: Tensor) -> Tensor:
        (ax, ay), (bx, by) = (v[1] - v[0])[:2], (v[2] - v[0])[:2]
        return (ax * by - ay * bx) / 2 * (64 / 20) ** 2

    assert torch.allclose(rendered, gradient_of(triangle, pixels), atol=1e-9)
    # A picture that shows its inside only: no edge moves.
    inside = lambda v: render_reflection(v, topology, straight_down(1.0), STRIPES, size=8).coverage.sum()  # noqa: E731
    assert float(inside(10 * triangle)) == 64
    assert torch.equal(gradient_of(10 * triangle, inside), torch.zeros_like(triangle))


@each_kind
def test_inner_vertices_of_a_flat_mesh_may_move_in_the_plane(kind: type[OrthographicCamera]) -> None:
    """All faces show the same: moving inner edges changes nothing; leaving the plane does."""
    vertices, topology = wavy_grid(6, 6)
    flat = vertices * vector(1, 1, 0)
    camera = kind.fit(flat, directions=vector(0.2, -0.1, -1))
    gradient = gradient_of(flat, lambda v: weighted_mean(v, topology, camera, 40))
    inner = ~topology.is_boundary_vertex
    assert gradient[inner, :2].abs().max() < 1e-9 * gradient.abs().max()
    assert gradient[inner, 2].abs().max() > 1e-3 * gradient.abs().max()
    assert gradient[~inner, :2].abs().max() > 1e-3 * gradient.abs().max()


@each_kind
def test_smooth_shading_has_the_gradient_of_the_exact_integral(kind: type[OrthographicCamera]) -> None:
    vertices, topology, camera = mesh_and_camera(*SURFACES["saddle"], kind)
    exact = gradient_of(vertices, lambda v: exact_functional(v, topology, camera, SOFT, weight, smooth=True))
    rendered = gradient_of(vertices, lambda v: weighted_mean(v, topology, camera, 256, shading="smooth"))
    assert torch.linalg.vector_norm(rendered - exact) < 0.002 * torch.linalg.vector_norm(exact)


def test_gradients_of_normals_and_environment() -> None:
    vertices, topology = torus(12, 8)
    camera = PerspectiveCamera.fit(vertices, directions=VIEWS)
    normals = vertex_normals(vertices, topology)
    picture = torch.rand(2, 8, 16, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))

    def functional(n: Tensor, p: Tensor) -> Tensor:
        seen = render_reflection(
            vertices, topology, camera, EquirectangularImage(p), size=16, shading="smooth", normals=n, antialias=True
        )
        return (seen.image**2).sum()

    assert torch.autograd.gradcheck(
        functional, (normals.requires_grad_(), picture.requires_grad_()), eps=1e-7, atol=1e-4, fast_mode=True
    )


def test_batches_and_views_have_the_gradients_of_their_pictures() -> None:
    vertices, topology = torus(12, 8)
    batch = torch.stack([vertices, vertices * vector(1, 0.8, 1.2)])
    camera = OrthographicCamera.fit(batch, directions=VIEWS)
    together = gradient_of(batch, lambda v: (render_reflection(v, topology, camera, STRIPES, size=24).image ** 2).sum())
    for i in range(2):
        parts = [
            gradient_of(
                batch[i],
                lambda v, view=view: (  # type: ignore[misc]
                    render_reflection(v, topology, camera.select(slice(view, view + 1)), STRIPES, size=24).image ** 2
                ).sum(),
            )
            for view in range(2)
        ]
        assert torch.allclose(together[i], sum(parts), atol=1e-9)  # type: ignore[arg-type]


def test_separate_triangles_have_the_gradient_of_the_mesh_that_they_form() -> None:
    """Triangles that share places but no vertices: edges upon each other count once."""
    vertices, topology = torus(12, 8)
    topology = Topology.from_faces(split_quads(grid_torus()))
    corners = topology.corners
    alone = Topology.from_faces(torch.arange(len(corners)).view(-1, 3))
    camera = PerspectiveCamera.fit(vertices, directions=VIEWS)
    weights = torch.randn(2, 2, 24, 24, dtype=DOUBLE, generator=torch.Generator().manual_seed(3))
    pictures, gradients = [], []
    for build in (lambda v: (v, topology), lambda v: (v[corners], alone)):
        moved = vertices.clone().requires_grad_()
        picture = render_reflection(*build(moved), camera, STRIPES, size=24, antialias=True).image
        pictures.append(picture.detach())
        gradients.append(torch.autograd.grad((picture * weights).sum(), moved)[0])
    assert torch.allclose(*pictures, atol=1e-12)
    assert torch.allclose(*gradients, atol=1e-9)


def test_what_is_cut_away_behind_the_eye_has_the_right_gradient() -> None:
    ground = torch.tensor([[-50.0, -50, 0], [50, -50, 0], [50, 50, 0], [-50, 50, 0]], dtype=DOUBLE)
    camera = PerspectiveCamera(vector(0, 0, 2), vector(5, 1, 1.5), 60.0)
    generator = torch.Generator().manual_seed(0)
    weights = torch.randn(1, 2, 20, 30, dtype=DOUBLE, generator=generator)
    for faces in ([[0, 1, 2], [0, 2, 3]], [[0, 1, 2, 3]]):
        topology = Topology.from_faces(faces)

        def functional(v: Tensor) -> Tensor:
            seen = render_reflection(v, topology, camera, STRIPES, size=(20, 30), antialias=True)  # noqa: B023
            return (seen.image * weights).sum()

        gradient = gradient_of(ground, functional)
        for _ in range(3):
            direction = torch.randn(4, 3, dtype=DOUBLE, generator=generator)
            expected = directional_difference(functional, ground, direction, step=1e-5)
            assert float((gradient * direction).sum()) == pytest.approx(expected, rel=1e-5)


def test_forward_mode_follows_edges_too() -> None:
    vertices, topology = torus(12, 8)
    camera = OrthographicCamera.fit(vertices, directions=VIEWS)
    functional = lambda v: (render_reflection(v, topology, camera, STRIPES, size=24).image ** 2).sum()  # noqa: E731
    direction = torch.randn(vertices.shape, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    _, forward = torch.func.jvp(functional, (vertices,), (direction,))
    assert float(forward) == pytest.approx(float((gradient_of(vertices, functional) * direction).sum()))
    assert torch.allclose(torch.func.grad(functional)(vertices), gradient_of(vertices, functional))


@pytest.mark.filterwarnings("ignore:The .grad attribute of a Tensor")  # torch looks at it where it resumes
def test_pictures_in_compiled_functions() -> None:
    vertices, topology = wavy_grid()
    camera: Camera = OrthographicCamera.fit(vertices, directions=VIEWS)
    functional = lambda v: (2 * render_reflection(v, topology, camera, STRIPES, size=8).image ** 2).sum()  # noqa: E731
    compiled = torch.compile(functional, backend="eager")
    assert torch.equal(functional(vertices), compiled(vertices))
    assert torch.equal(gradient_of(vertices, functional), gradient_of(vertices, compiled))


DEGENERATE = {
    "a face of zero area": torch.tensor([[0.0, 0, 0], [1, 0, 0], [0.5, 0, 0], [0.5, 1, 0]]),
    "a face on edge": torch.tensor([[0.0, 0, 0], [1, 0, 0], [0.5, 0, 0.7], [0.5, 1, 0]]),
    "equal corners": torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 0, 0], [0.5, 1, 0]]),
    "a needle": torch.tensor([[0.0, 0, 0], [1, 0, 0], [0.5, 1e-9, 0], [0.5, 1, 0]]),
    "far beyond the picture": torch.tensor([[-1e6, 0, 0], [1e6, -3, 0], [0.5, -1e7, 0], [0.5, 1e6, 0]]),
}


@pytest.mark.parametrize("vertices", DEGENERATE.values(), ids=DEGENERATE)
@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
@pytest.mark.parametrize("shading", ["flat", "smooth"])
def test_gradients_of_degenerate_faces_are_finite(vertices: Tensor, dtype: torch.dtype, shading: str) -> None:
    topology = Topology.from_faces([[0, 1, 2], [1, 0, 3]])
    for camera in (straight_down(1.2), PerspectiveCamera(vector(0, 0, 3), vector(0, 0, 0), 50.0)):
        moved = vertices.to(dtype).requires_grad_()
        image, coverage, _ = render_reflection(
            moved, topology, camera, STRIPES, size=10, antialias=True, shading=shading  # type: ignore[arg-type]
        )  # fmt: skip
        (gradient,) = torch.autograd.grad(image.square().sum() + coverage.square().sum(), moved)
        assert bool(torch.isfinite(image).all() & torch.isfinite(coverage).all() & torch.isfinite(gradient).all())
        assert bool((coverage > 0.1).any())


def test_grid_of_squares_is_even() -> None:
    """A plane grid whose vertices lie on pixel centres: scaling it changes its area, nothing else."""
    x, y = torch.meshgrid(torch.arange(8, dtype=DOUBLE), torch.arange(8, dtype=DOUBLE), indexing="ij")
    plane = torch.stack([x.flatten(), y.flatten(), 0 * x.flatten()], dim=1) - vector(4.5, 4.5, 0)
    topology = Topology.from_faces(grid_faces(8, 8))
    camera = straight_down(10.0)
    gradient = gradient_of(plane, lambda v: render_reflection(v, topology, camera, STRIPES, size=20).coverage.sum())
    assert float((gradient * plane).sum()) == pytest.approx(2 * 49)
