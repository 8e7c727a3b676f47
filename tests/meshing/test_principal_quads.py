"""Principal quads: angles, topology, invariance, what is refused."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
import torch
from helpers import random_rotation
from meshing_tools import Flat, Graph, MonkeySaddle, ellipsoid, irregular, nearest, punched, side_by_side
from torch import Tensor

from torchfair import MeshError, Topology, load_mesh, save_mesh
from torchfair.errors import SettingsError, ShapeError, TorchfairError
from torchfair.geometry import ReferenceSurface, face_areas, face_normals
from torchfair.meshing import MeshingSettings, NoMeshError, QuadMesh, principal_quads
from torchfair.meshing.components import read_surface
from torchfair.meshing.verification import shape_of, verified_topology, verify_corners
from torchfair.shapes import (
    Catenoid,
    Cylinder,
    Enneper,
    FreeFormPatch,
    PrincipalParaboloid,
    Sphere,
    Surface,
    Torus,
    icosphere,
    irregular_triangles,
)
from torchfair.shapes import (
    principal_quads as analytic_quads,
)

SADDLE = PrincipalParaboloid(1.0, -0.5, (0.8, 0.8))


def quads_inside(mesh: QuadMesh) -> bool:
    at_boundary = mesh.topology.is_boundary_vertex[mesh.topology.corners]
    touches = torch.zeros(mesh.topology.num_faces, dtype=torch.bool)
    touches[mesh.topology.corner_faces[at_boundary]] = True
    return bool((mesh.topology.face_sizes[~touches] == 4).all())


def check(mesh: QuadMesh, vertices: Tensor, topology: Topology) -> None:
    """What is promised of every mesh."""
    assert shape_of(mesh.topology) == shape_of(topology)
    assert quads_inside(mesh)
    surface = ReferenceSurface(vertices, topology)
    assert surface.closest(mesh.vertices).distances.max() < 0.1 * mesh.report["mean_edge"]
    centres = torch.stack([mesh.vertices[face].mean(0) for face in mesh.topology.face_lists()])
    normals = face_normals(mesh.vertices, mesh.topology)
    assert ((surface.closest(centres).normals * normals).sum(1) > 0.3).all()
    areas = face_areas(mesh.vertices, mesh.topology)
    assert areas.min() > 0.05 * areas.mean()
    valences = mesh.topology.valences
    irregular_vertices = (valences != 4) & ~mesh.topology.is_boundary_vertex & (valences > 0)
    at_singular = (mesh.vertices[:, None] == mesh.singular_points).all(-1).any(1)
    assert at_singular[irregular_vertices].all()
    assert irregular_vertices[at_singular & ~mesh.topology.is_boundary_vertex].all()


class Bumps(Graph):
    """Lines diverge so much that quads are twice as large in the mean as the spacing says."""

    def height(self, u: Tensor, v: Tensor) -> Tensor:
        return 0.3 * torch.sin(4 * u) * torch.sin(4 * v)


def test_faces_at_the_boundary_are_no_slivers_where_quads_are_larger_than_asked_for() -> None:
    """One had 4.5 % of the mean area."""
    vertices, topology = irregular(Bumps(), 1200)
    found = principal_quads(vertices, topology, count=300)
    areas = face_areas(found.vertices, found.topology)
    assert areas.mean() > 1.3 * found.report["spacing"] ** 2
    assert areas.min() > 0.055 * areas.mean()


@pytest.mark.parametrize("surface", [Torus(), SADDLE, Catenoid()], ids=lambda surface: type(surface).__name__)
@pytest.mark.parametrize("count", [150, pytest.param(600, marks=pytest.mark.slow)])
def test_edges_follow_exact_directions(surface: Surface, count: int) -> None:
    mesh = irregular_triangles(surface, 2000)
    found = principal_quads(mesh.vertices, mesh.topology, count=count)
    check(found, mesh.vertices, mesh.topology)
    assert found.report["singular"] == {}
    assert found.notes == []
    assert abs(found.report["faces"] / count - 1) < 0.15
    # At the vertices of the surface nearest to the middles of edges directions are exact.
    ends = found.vertices[found.topology.interior_edges]
    near = torch.cdist(ends.mean(1), mesh.vertices).argmin(1)
    along = torch.nn.functional.normalize(ends[:, 1] - ends[:, 0], dim=1)
    cosines = (mesh.principal_directions[near] * along[:, None]).sum(-1).abs().amax(1).clamp(max=1)
    off = torch.rad2deg(cosines.acos())
    assert off.mean() < 3  # directions turn between a vertex and the middle of an edge
    assert found.report["angle_mean_degrees"] < 1
    assert found.report["angle_95_degrees"] < 3
    assert found.report["planarity_mean"] < 0.006


@pytest.mark.parametrize(
    "surface", [Cylinder(), Enneper(), Torus(tube_angles=(1.6, 4.7))], ids=lambda s: type(s).__name__
)
def test_the_curvature_that_energy_is_measured_against_reaches_up_to_the_boundary(surface: Surface) -> None:
    """That of the triangles is 10 % too large on the cylinder, and 1 and 4 % too small on the others."""
    mesh = irregular_triangles(surface, 1000)
    found = read_surface(mesh.vertices, mesh.topology, MeshingSettings())
    assert found.total_absolute_curvature == pytest.approx(surface.total_absolute_curvature(), rel=0.007)


def test_creases_count_with_their_energy() -> None:
    """A folded strip has no other curvature."""
    vertices = torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 2, 0], [0, 2, 0], [0, 0, 1], [0, 2, 1]], dtype=torch.float64)
    faces = [[0, 1, 2], [0, 2, 3], [0, 3, 4], [4, 3, 5]]
    found = read_surface(vertices, Topology.from_faces(faces), MeshingSettings())
    assert found.total_absolute_curvature == pytest.approx(2 * 2 * math.sin(math.pi / 4))


def test_energy_is_the_total_absolute_curvature() -> None:
    mesh = irregular_triangles(Torus(), 3000)
    found = principal_quads(mesh.vertices, mesh.topology, count=1000)
    assert found.report["total_absolute_curvature"] == pytest.approx(Torus().total_absolute_curvature(), rel=0.01)
    assert found.report["variation_over_curvature"] == pytest.approx(1, abs=0.02)


def test_a_patch_of_aligned_sides_is_all_quads() -> None:
    vertices, topology = irregular(SADDLE, 1500)
    found = principal_quads(vertices, topology, count=300)
    assert found.topology.is_quadrangular
    corners = vertices[topology.is_boundary_vertex]
    corners = corners[
        [
            int((corners[:, :2] @ torch.tensor(d, dtype=torch.float64)).argmax())
            for d in ((1.0, 1), (1, -1), (-1, 1), (-1, -1))
        ]
    ]
    assert (corners[:, None] == found.vertices).all(-1).any(1).all()  # to the last bit
    without = principal_quads(vertices, topology, count=300, settings=MeshingSettings(align_boundary=False))
    check(without, vertices, topology)
    assert (corners[:, None] == without.vertices).all(-1).any(1).all()


RIGHT = {
    "monkey": (irregular(MonkeySaddle()), {"-0.5": 1}),
    "ellipsoid": (ellipsoid(), {"0.25": 8}),
    "sphere": ((icosphere(3).vertices, icosphere(3).topology), None),
    "flat": (irregular(Flat()), {}),
    "cap": (irregular(Sphere(latitudes=(0.6, math.pi / 2))), None),
    "free form": (irregular(FreeFormPatch(), 2000), None),
    "cylinder": (irregular(Cylinder()), {}),
    "holes": (punched(*irregular(SADDLE, 1500), *nearest(irregular(SADDLE, 1500)[0], (0.4, 0.3), (-0.4, -0.2))), {}),
}


@pytest.mark.parametrize("name", RIGHT)
def test_right_answers(name: str) -> None:
    (vertices, topology), singular = RIGHT[name]
    found = principal_quads(vertices, topology, count=400)
    check(found, vertices, topology)
    assert singular is None or found.report["singular"] == singular
    assert found.report["euler_number"] == shape_of(topology).euler_number
    closed = shape_of(topology).boundary_loops == 0
    assert not closed or found.report["total_index"] == found.report["euler_number"]


def test_components_are_meshed_with_one_spacing() -> None:
    vertices, topology = side_by_side(irregular(SADDLE), irregular(Torus()))
    found = principal_quads(vertices, topology, count=500)
    check(found, vertices, topology)
    assert found.report["components"] == 2
    first = principal_quads(*irregular(SADDLE), spacing=found.report["spacing"])
    assert first.topology.num_faces < found.topology.num_faces
    assert torch.equal(found.vertices[: first.topology.num_vertices], first.vertices)


def test_the_mesh_does_not_depend_on_motion_scale_and_numbering() -> None:
    vertices, topology = irregular(MonkeySaddle(), 900)
    found = principal_quads(vertices, topology, count=300)
    for scale in (1e-3, 1e3):
        turn = random_rotation(2)
        again = principal_quads(scale * vertices @ turn.T + scale, topology, count=300)
        assert again.report["faces"] == found.report["faces"]
        moved = scale * found.vertices @ turn.T + scale
        assert torch.cdist(moved, again.vertices).amin(1).max() < 1e-4 * scale
    order = torch.randperm(topology.num_vertices, generator=torch.Generator().manual_seed(1))
    faces = order.argsort()[topology.triangles].roll(1, 1).flip(0)
    again = principal_quads(vertices[order], Topology.from_faces(faces), count=300)
    assert again.report["faces"] == found.report["faces"]
    assert torch.cdist(found.vertices, again.vertices).amin(1).max() < 1e-4
    assert torch.cdist(found.singular_points, again.singular_points).amin(1).max() < 0.1 * found.report["spacing"]


def test_a_finer_surface_is_no_other() -> None:
    """A surface of few large triangles is cut finer: edges may be shorter than those of the surface."""
    vertices, topology = irregular(SADDLE, 150)
    found = principal_quads(vertices, topology, count=500)
    check(found, vertices, topology)


def test_polygons_are_cut_into_triangles() -> None:
    mesh = analytic_quads(SADDLE, 20, 20)
    found = principal_quads(mesh.vertices, mesh.topology, count=200)
    assert shape_of(found.topology) == shape_of(mesh.topology)
    assert found.report["angle_mean_degrees"] < 0.5


@pytest.mark.parametrize("noise", [0.05, pytest.param(0.2, marks=pytest.mark.slow)])
def test_noise_is_averaged_away(noise: float) -> None:
    mesh = irregular_triangles(SADDLE, 2000)
    edge = (mesh.vertices[mesh.topology.edges[:, 1]] - mesh.vertices[mesh.topology.edges[:, 0]]).norm(dim=1).mean()
    shift = torch.randn(mesh.vertices.shape, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    vertices = mesh.vertices + noise * edge * shift
    found = principal_quads(vertices, mesh.topology, count=150)
    assert shape_of(found.topology) == shape_of(mesh.topology)
    assert "rings" in found.notes[0]


@pytest.mark.parametrize("count", [150, pytest.param(500, marks=pytest.mark.slow)])
def test_the_count_is_about_that_asked_for(count: int) -> None:
    """On this surface lines diverge: with the spacing of the count there are a fifth fewer faces."""
    vertices, topology = irregular(FreeFormPatch(), 2000)
    found = principal_quads(vertices, topology, count=count)
    assert abs(found.report["faces"] / count - 1) < 0.15
    same = principal_quads(vertices, topology, spacing=found.report["spacing"])
    assert same.report["faces"] == found.report["faces"]


def test_types_come_back() -> None:
    vertices, topology = irregular(SADDLE)
    found = principal_quads(vertices.float(), topology, count=100)
    assert found.vertices.dtype == found.singular_points.dtype == torch.float32
    assert found.topology.is_quadrangular


def test_where_no_mesh_is_found_that_is_said_in_one_line() -> None:
    vertices, topology = irregular(Flat(), 300)
    vertices = vertices + 0.1 * torch.randn(vertices.shape, generator=torch.Generator().manual_seed(0))
    settings = MeshingSettings(fallback=False, noise=2)
    with pytest.raises(
        NoMeshError, match=r"no valid mesh was found near vertex \d+ at \(.*one setting tried"
    ) as caught:
        principal_quads(vertices, topology, count=60, settings=settings)
    assert "\n" not in str(caught.value)
    assert 0 <= caught.value.vertex < topology.num_vertices


def test_a_moebius_strip_is_refused(tmp_path: Path) -> None:
    turn = torch.arange(40) * 2 * math.pi / 40  # half a twist: the last rows meet crosswise
    rows = []
    for side in (-0.2, 0.2):
        radius, height = 1 + side * (turn / 2).cos(), side * (turn / 2).sin()
        rows += torch.stack([radius * turn.cos(), radius * turn.sin(), height], 1).tolist()
    last = [[39, 40, 0], [39, 0, 79]]
    faces = [[k, k + 1, k + 41] for k in range(39)] + [[k, k + 41, k + 40] for k in range(39)] + last
    path = tmp_path / "strip.obj"
    lines = ["v {} {} {}".format(*row) for row in rows]
    lines += ["f {} {} {}".format(*(number + 1 for number in face)) for face in faces]
    path.write_text("\n".join(lines) + "\n")
    with pytest.raises(TorchfairError, match="one-sided"):
        load_mesh(path, repair=True)


@pytest.mark.filterwarnings("error")
def test_a_single_triangle_is_meshed() -> None:
    triangle = torch.tensor([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.3, 0.8, 0.0]], dtype=torch.float64)
    mesh = principal_quads(triangle, Topology.from_faces([[0, 1, 2]]), count=50)
    assert mesh.topology.num_faces == pytest.approx(50, rel=0.1)
    areas = face_areas(mesh.vertices, mesh.topology)
    assert float(areas.sum()) == pytest.approx(0.4, rel=1e-9)
    assert shape_of(mesh.topology) == shape_of(Topology.from_faces([[0, 1, 2]]))


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("height", [1e-6, 1e-9, 1e-11])
def test_triangles_that_are_too_thin_are_refused_in_one_line(height: float) -> None:
    sliver = torch.tensor([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.3, height, 0.0]], dtype=torch.float64)
    with pytest.raises(NoMeshError, match=r"^no valid mesh[^\n]*$"):
        principal_quads(sliver, Topology.from_faces([[0, 1, 2]]), count=100, settings=MeshingSettings(time_limit=1))


@pytest.mark.parametrize("size", [1e-100, 1e100])
def test_sizes_that_cannot_be_squared_are_refused(size: float) -> None:
    vertices, topology = irregular(Flat(), 60)
    with pytest.raises(MeshError, match="in another unit"):
        principal_quads(size * vertices, topology, count=20)


def test_what_is_wrong_with_the_input_is_said() -> None:
    vertices, topology = irregular(SADDLE)
    with pytest.raises(SettingsError, match="either count or spacing"):
        principal_quads(vertices, topology)
    with pytest.raises(SettingsError, match="either count or spacing"):
        principal_quads(vertices, topology, count=10, spacing=0.1)
    with pytest.raises(SettingsError, match="count must be a whole number of at least 1"):
        principal_quads(vertices, topology, count=0)
    with pytest.raises(SettingsError, match="spacing must be a finite number above 0"):
        principal_quads(vertices, topology, spacing=math.inf)
    with pytest.raises(ShapeError, match="one mesh"):
        principal_quads(vertices[None], topology, count=10)
    broken = vertices.clone()
    broken[7, 1] = math.nan
    with pytest.raises(MeshError, match="not finite numbers: 7"):
        principal_quads(broken, topology, count=10)
    flat = vertices.clone()
    flat[topology.triangles[5]] = vertices[topology.triangles[5][0]]
    with pytest.raises(MeshError, match=r"have no area: faces .*5"):
        principal_quads(flat, topology, count=10)
    with pytest.raises(MeshError, match="no faces"):
        principal_quads(torch.zeros(3, 3), Topology.from_faces(np.zeros((0, 3), int), 3), count=10)


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("smoothing", 0.0, "smoothing"),
        ("noise", 1, "noise"),
        ("noise", "much", "noise"),
        ("merging", -1.0, "merging"),
        ("align_boundary", 1, "align_boundary"),
        ("boundary_angle", 1.0, "boundary_angle"),
        ("corner_angle", 0.0, "corner_angle"),
        ("adaptive", 1, "adaptive"),
        ("spacing_range", 0.9, "spacing_range"),
        ("spacing_range", math.inf, "spacing_range"),
        ("time_limit", -1.0, "time_limit"),
    ],
)
def test_settings_out_of_range(name: str, value: object, message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        MeshingSettings(**{name: value})  # type: ignore[arg-type]


def test_verification_says_what_is_wrong() -> None:
    _, topology = irregular(SADDLE, 300)
    faces, wanted = topology.face_lists(), shape_of(topology)
    assert wanted == (1, 1, 1)
    assert verified_topology(faces, topology.num_vertices, wanted).num_faces == topology.num_faces
    inner = next(face for face in faces if not topology.is_boundary_vertex[face].any())
    with pytest.raises(MeshError, match="euler number 0 instead of 1, boundary loops 2 instead of 1"):
        verified_topology([face for face in faces if face != inner], topology.num_vertices, wanted)
    with pytest.raises(MeshError, match="no face is left"):
        verified_topology([], 0, wanted)
    with pytest.raises(MeshError):
        verified_topology([*faces, faces[0]], topology.num_vertices, wanted)


def test_verification_finds_corners_without_an_angle() -> None:
    square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0]])
    verify_corners(square, [[0, 1, 2, 3], [0, 1, 2]])
    verify_corners(square, [[0, 1, 4, 2, 3]])  # straight on at the second
    for flat in ([0, 1, 4], [0, 4, 1, 3]):
        with pytest.raises(MeshError, match="corner of 0 degrees"):
            verify_corners(square, [[0, 1, 2, 3], flat])


def test_a_report_can_be_written(tmp_path: Path) -> None:
    vertices, topology = irregular(SADDLE)
    found = principal_quads(vertices, topology, count=100)
    path = tmp_path / "mesh.obj"
    save_mesh(path, found.vertices, found.topology)
    assert load_mesh(path).topology.num_faces == found.report["faces"]
