"""Cameras of another kind: linear ones work everywhere by the same four properties, others are refused by name."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import pytest
import torch
from helpers import DOUBLE, tetrahedron, wavy_grid
from reflection_tools import STRIPES, random_soup, ray_cast, vector
from torch import Tensor

from torchfair import ShapeError
from torchfair.cameras import Camera, OrthographicCamera, PerspectiveCamera
from torchfair.geometry import face_areas, face_centres, face_normals
from torchfair.reflection import (
    ReflectionLoss,
    ReflectionSetup,
    SmoothReference,
    Stripes,
    edge_visibility,
    face_mirror_directions,
    mirror_directions,
    reflection_score,
    reflection_variation,
    reflection_variation_from_eyes,
    render_reflection,
)
from torchfair.viewing import MeshView
from torchfair.viewing.shading import shade_faces

UP = vector(0, 0, 1)


@dataclass(frozen=True, eq=False)
class Sheared(Camera):
    """A view along -z with y upwards, in which depth runs to the right and up: oblique, or with a shifted lens.

    ``eyes`` at infinite height are those of an oblique view.
    """

    slopes: Tensor
    eyes: Tensor

    @property
    def axes(self) -> Tensor:
        rows = torch.diag(vector(1, 1, -1)).repeat(self.slopes.shape[0], 1, 1)
        rows[:, :2, 2] = self.slopes
        return rows

    @property
    def origins(self) -> Tensor:
        return torch.where(torch.isinf(self.eyes), 0.0, self.eyes)

    @property
    def distances(self) -> Tensor | None:
        if bool(torch.isinf(self.eyes).any()):
            return None
        return self.eyes[:, 2] * (1 + (self.slopes**2).sum(1)).sqrt()  # to the plane z = 0, along the middle

    def scales(self, width: int) -> Tensor:
        scale = width / 3 if self.distances is None else width / 3 * self.eyes[:, 2]
        return torch.as_tensor(scale, dtype=DOUBLE).expand(self.slopes.shape[0])


OBLIQUE = Sheared(torch.tensor([[0.4, -0.3], [-0.2, 0.6]], dtype=DOUBLE), vector(0, 0, math.inf).expand(2, 3))
EYES = torch.tensor([[0.0, 0, 4], [1, 0, 3]], dtype=DOUBLE)
SHIFTED = Sheared(torch.tensor([[0.1, -0.2], [-0.2, 0.1]], dtype=DOUBLE), EYES)
each_kind = pytest.mark.parametrize("camera", [OBLIQUE, SHIFTED], ids=["oblique", "shifted lens"])


class Fisheye:
    """Sees almost all around itself, and straight lines bent."""

    num_views = 1
    central = True

    def project(self, vertices: Tensor, size: int) -> Tensor:
        angle = torch.atan2(torch.linalg.vector_norm(vertices[..., :2], dim=-1), -vertices[..., 2])
        return torch.cat([angle[..., None] * vertices[..., :2], vertices[..., 2:]], dim=-1)[None]


# ---- linear cameras --------------------------------------------------------------------------------------


@each_kind
def test_points_pixels_and_rays_agree(camera: Sheared) -> None:
    origins, directions = camera.rays((4, 6))
    rows, columns = torch.meshgrid(torch.arange(4), torch.arange(6), indexing="ij")
    expected = torch.stack([columns, rows], dim=-1).reshape(-1, 2).to(DOUBLE) + 0.5
    for view in range(2):
        points = (origins + 1.7 * directions)[view].reshape(-1, 3)
        assert torch.allclose(camera.project(points, (4, 6))[view, :, :2], expected, atol=1e-12)
        assert torch.allclose(camera.view_directions(points)[view], directions[view].reshape(-1, 3), atol=1e-14)
    at = camera.directions_at(expected.expand(2, -1, -1), (4, 6))
    assert torch.allclose(at, directions.view(2, -1, 3), atol=1e-14)
    one_by_one = camera.directions_at(expected.repeat(2, 1), (4, 6), torch.arange(2).repeat_interleave(24))
    assert torch.allclose(one_by_one.view(2, -1, 3), at, atol=1e-14)
    assert torch.allclose(torch.linalg.vector_norm(directions, dim=-1), torch.ones(1, dtype=DOUBLE))
    assert not torch.allclose(camera.middle_directions, camera.axes[:, 2])


def test_lines_of_sight_of_an_oblique_view_are_those_along_which_nothing_moves() -> None:
    points = torch.randn(5, 3, dtype=DOUBLE, generator=torch.Generator().manual_seed(0))
    moved = points + 0.3 * OBLIQUE.middle_directions[:, None]
    for view in range(2):
        before, after = (OBLIQUE.project(p, 90)[view] for p in (points, moved[view]))
        assert torch.allclose(before[:, :2], after[:, :2])
        assert bool((after[:, 2] > before[:, 2]).all())  # into the scene


@each_kind
def test_visible_faces_agree_with_rays(camera: Sheared) -> None:
    soup, topology = random_soup(60, 3)
    soup = 2 * soup - 1
    seen = render_reflection(soup, topology, camera, STRIPES, size=48).face_index
    assert (seen == ray_cast(soup, topology, camera, 48)).to(DOUBLE).mean() >= 0.999
    assert (seen >= 0).to(DOUBLE).mean() > 0.2


@each_kind
@pytest.mark.parametrize("shading", ["flat", "smooth"])
def test_mirrors_reflect_the_line_of_sight_of_each_place(camera: Sheared, shading: str) -> None:
    """A tilted plane fills the picture, so that the mirrored direction is known everywhere."""
    normal = torch.nn.functional.normalize(vector(0.3, -0.1, 1), dim=0)
    x, y = torch.meshgrid(*2 * (torch.tensor([-9.0, 9], dtype=DOUBLE),), indexing="ij")
    vertices = torch.stack([x, y, -(normal[0] * x + normal[1] * y) / normal[2]], dim=-1).view(-1, 3)
    topology = tetrahedron()[1].from_faces([[0, 2, 3, 1]])
    picture = render_reflection(vertices, topology, camera, lambda r: r, size=8, shading=shading)
    _, directions = camera.rays(8)
    expected = mirror_directions(directions, normal)
    assert torch.allclose(picture.image.movedim(-3, -1), expected, atol=1e-12)
    middle = face_mirror_directions(vertices, topology, camera)
    sight = camera.view_directions(face_centres(vertices, topology))
    assert torch.allclose(middle, mirror_directions(sight, face_normals(vertices, topology)))


@each_kind
def test_score_takes_the_variation_of_its_own_lines_of_sight(camera: Sheared) -> None:
    vertices, topology = wavy_grid(7, 7, triangles=True)
    vertices = vertices - vertices.mean(0)
    score = reflection_score(vertices, topology, camera=camera, frequency=1.0, size=64, supersampling=2)
    visibility = edge_visibility(vertices, topology, camera, size=128)
    if camera.distances is None:
        sights = torch.cat([camera.slopes, -torch.ones(2, 1, dtype=DOUBLE)], dim=1)
        values = reflection_variation(vertices, topology, sights, visibility=visibility)
    else:
        values = reflection_variation_from_eyes(vertices, topology, camera.eyes, visibility=visibility)
        values = values * camera.distances
    expected = values.mean() / face_areas(vertices, topology).sum().sqrt()
    torch.testing.assert_close(score.reflection_variation, expected)
    assert score.reflection_variation > 0
    assert score.score > 0


def test_a_steep_eye_far_away_is_an_oblique_view() -> None:
    """The same lines of sight in the limit, so the same numbers: the two formulas meet."""
    vertices, topology = wavy_grid(7, 7, triangles=True)
    vertices, far = vertices - vertices.mean(0), 1e5
    slopes = torch.tensor([[0.4, -0.3]], dtype=DOUBLE)
    oblique = Sheared(slopes, vector(0, 0, math.inf)[None])
    central = Sheared(slopes, far * vector(-0.4, 0.3, 1)[None])
    options = {"frequency": 1.0, "size": 64, "supersampling": 2}
    scores = [reflection_score(vertices, topology, camera=c, **options) for c in (oblique, central)]
    for name in ("score", "reflection_variation", "rms", "wobble"):
        torch.testing.assert_close(*(getattr(score, name) for score in scores), rtol=2e-3, atol=1e-4)


@each_kind
def test_pictures_are_drawn_with_it(camera: Sheared) -> None:
    """Colours that are affine in space appear as that function where the ray meets the surface."""
    view = camera.select(slice(1, 2))
    vertices, topology = wavy_grid(2, 2)
    vertices = (vertices - vertices.mean(0)) * vector(0.5, 0.5, 0)
    mesh = MeshView(vertices, topology, view, 40, supersampling=1)
    picture = mesh.paint_vertices(0.5 + 0.4 * vertices)
    rows, columns = torch.nonzero(mesh.face_index >= 0).unbind(1)
    places = (picture[rows, columns].to(DOUBLE) - 0.5) / 0.4
    expected = torch.stack([columns, rows], dim=1).to(DOUBLE) + 0.5
    assert torch.allclose(view.project(places, 40)[0, :, :2], expected, atol=1e-4)
    assert len(rows) > 20
    assert bool(torch.isfinite(shade_faces(vertices, topology, view)).all())


# ---- refusals --------------------------------------------------------------------------------------------

MESH = wavy_grid(4, 4)
USES = {
    "render_reflection": lambda camera: render_reflection(*MESH, camera, STRIPES),
    "edge_visibility": lambda camera: edge_visibility(*MESH, camera),
    "reflection_score": lambda camera: reflection_score(*MESH, camera=camera, frequency=1.0),
    "ReflectionSetup": lambda camera: ReflectionSetup(camera, Stripes(UP), None),
    "for_reference": lambda camera: ReflectionSetup.for_reference(SmoothReference.of_mesh(*MESH), camera=camera),
    "ReflectionLoss": lambda camera: ReflectionLoss(MESH[1], MESH, camera=camera),
    "face_mirror_directions": lambda camera: face_mirror_directions(*MESH, camera),
    "MeshView": lambda camera: MeshView(*MESH, camera, 32),
    "shade_faces": lambda camera: shade_faces(*MESH, camera),
}


@pytest.mark.parametrize("use", USES.values(), ids=USES)
def test_what_is_no_camera_is_refused_by_name(use: Callable[[object], object]) -> None:
    with pytest.raises(TypeError, match=r"OrthographicCamera, a PerspectiveCamera .* got Fisheye"):
        use(Fisheye())
    with pytest.raises(TypeError, match="got str"):
        use("from above")


def test_a_camera_that_bends_lines_cannot_be_made() -> None:
    with pytest.raises(TypeError, match="Bent overrides project, to_screen"):

        class Bent(PerspectiveCamera):
            def to_screen(self, local: Tensor, size: object, view: Tensor | None = None) -> Tensor:  # type: ignore[misc]
                return local

            def project(self, vertices: Tensor, size: object) -> Tensor:  # type: ignore[misc]
                return vertices


def test_a_camera_must_say_whether_its_lines_of_sight_meet() -> None:
    class Undecided(Camera):
        axes = origins = property(lambda self: torch.eye(3)[None])

        def scales(self, width: int) -> Tensor:
            return torch.ones(1)

    with pytest.raises(TypeError, match="distances"):
        Undecided()


def test_pictures_show_one_view() -> None:
    several = OrthographicCamera(torch.eye(3))
    for use in (USES["MeshView"], USES["shade_faces"]):
        with pytest.raises(ShapeError, match=r"camera\.select.*3 views"):
            use(several)
        use(several.select(slice(2, 3)))
