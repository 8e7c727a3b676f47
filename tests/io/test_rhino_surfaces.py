"""Surfaces of 3DM files as grids: closed forms, seams, poles, kinks, and what is refused."""

from __future__ import annotations

import itertools
import json
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from torch import Tensor

from torchfair import MeshFileError, Topology
from torchfair.cli.command import main
from torchfair.errors import SettingsError
from torchfair.geometry import face_area_vectors, face_centres
from torchfair.io import PolygonMesh, RhinoParts, load_mesh

rhino = pytest.importorskip("rhino3dm")
RADIUS, RING = 2.0, 5.0


def sphere() -> Any:
    return rhino.Sphere(rhino.Point3d(0, 0, 0), RADIUS)


def cylinder() -> Any:
    return rhino.Cylinder(rhino.Circle(rhino.Point3d(0, 0, 0), RADIUS), 3.0)


def circle_curve(at: float = RING) -> Any:
    """A circle that the z axis does not meet, in a plane through it."""
    curve = rhino.Circle(rhino.Point3d(0, 0, 0), RADIUS).ToNurbsCurve()
    curve.Rotate(math.pi / 2, rhino.Vector3d(1, 0, 0), rhino.Point3d(0, 0, 0))
    curve.Translate(rhino.Vector3d(at, 0, 0))
    return curve


def torus() -> Any:
    axis = rhino.Line(rhino.Point3d(0, 0, 0), rhino.Point3d(0, 0, 1))
    return rhino.RevSurface.Create(circle_curve(), axis, 0.0, 2.0 * math.pi)


def written(path: Path, *geometry: Any, layer: str = "", name: str = "") -> Path:
    model = rhino.File3dm()
    attributes = rhino.ObjectAttributes()
    attributes.Name = name
    if layer:
        made = rhino.Layer()
        made.Name = layer
        attributes.LayerIndex = model.Layers.Add(made)
    for item in geometry:
        add = model.Objects.AddBrep if isinstance(item, rhino.Brep) else model.Objects.AddSurface
        add = model.Objects.AddExtrusion if isinstance(item, rhino.Extrusion) else add
        add(item, attributes)
    assert model.Write(str(path), 7)
    return path


def from_sphere(points: Tensor) -> Tensor:
    return points.norm(dim=-1) - RADIUS


def from_cylinder(points: Tensor) -> Tensor:
    return points[:, :2].norm(dim=-1) - RADIUS


def from_torus(points: Tensor) -> Tensor:
    return torch.hypot(points[:, :2].norm(dim=-1) - RING, points[:, 2]) - RADIUS


def volume(mesh: PolygonMesh) -> float:
    vectors = face_area_vectors(mesh.vertices, mesh.topology)
    return float((vectors * face_centres(mesh.vertices, mesh.topology)).sum() / 3.0)


def euler(topology: Topology) -> int:
    return topology.num_vertices - topology.num_edges + topology.num_faces


SHAPES: dict[str, tuple[Callable[[], Any], Callable[[Tensor], Tensor], int, int]] = {
    "sphere": (lambda: sphere().ToNurbsSurface(), from_sphere, 2, 0),
    "sphere as a brep": (lambda: sphere().ToBrep(), from_sphere, 2, 0),
    "cylinder": (lambda: cylinder().ToNurbsSurface(), from_cylinder, 0, 2),
    "cylinder as a brep": (lambda: cylinder().ToBrep(False, False), from_cylinder, 0, 2),
    "cylinder as an extrusion": (
        lambda: rhino.Extrusion.CreateCylinderExtrusion(cylinder(), False, False), from_cylinder, 0, 2
    ),
    "torus": (torus, from_torus, 0, 0),
    "torus as a NURBS surface": (lambda: torus().ToNurbsSurface(), from_torus, 0, 0),
}  # fmt: skip


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("cells", [1, 7, (24, 16)])
def test_closed_forms(shape: str, cells: int | tuple[int, int], tmp_path: Path) -> None:
    """Every vertex is on the surface but for rounding; seams and poles are closed as on the smooth surface."""
    make, distance, characteristic, rims = SHAPES[shape]
    mesh = load_mesh(written(tmp_path / "m.3dm", make()), surfaces=cells)
    assert float(distance(mesh.vertices).abs().max()) <= 8.0 * np.finfo(float).eps * (RADIUS + RING)
    assert euler(mesh.topology) == characteristic
    assert len(mesh.topology.boundary_loops()) == rims


@pytest.mark.parametrize(("shape", "exact"), [("sphere", 4 / 3 * math.pi * 8), ("torus", 2 * math.pi**2 * 5 * 4)])
def test_volumes_converge_and_normals_point_outwards(shape: str, exact: float, tmp_path: Path) -> None:
    """With the square of the cell; signed, so that a mesh inside out would have twice the volume as its error."""
    path = written(tmp_path / "m.3dm", SHAPES[shape][0]())
    errors = [exact - volume(load_mesh(path, surfaces=n)) for n in (16, 32, 64)]
    assert all(3.8 < coarse / fine < 4.2 for coarse, fine in itertools.pairwise(errors))


def test_points_are_those_of_the_surface_to_the_bit(tmp_path: Path) -> None:
    """Three hundred metres away in millimetres, where single precision is off by hundredths."""
    surface = sphere().ToNurbsSurface()
    surface.Translate(rhino.Vector3d(3e5, -3e5, 1e5))
    mesh = load_mesh(written(tmp_path / "m.3dm", surface), surfaces=(8, 4))
    stops = [np.linspace(a, b, n) for a, b, n in ((0, math.tau, 9), (-math.pi / 2, math.pi / 2, 5))]
    expected = {(p.X, p.Y, p.Z) for u in stops[0] for v in stops[1] for p in [surface.PointAt(float(u), float(v))]}
    found = {tuple(row) for row in mesh.vertices.tolist()}
    assert found <= expected
    assert len(found) == 8 * 3 + 2


def test_cells_and_triangles_at_poles(tmp_path: Path) -> None:
    mesh = load_mesh(written(tmp_path / "m.3dm", sphere().ToNurbsSurface()), surfaces=(8, 4))
    assert sorted(mesh.topology.valences.tolist()) == [4] * 24 + [8] * 2
    sizes = [len(face) for face in mesh.topology.face_lists()]
    assert (sizes.count(3), sizes.count(4)) == (16, 16)


def test_kinks_are_in_the_grid(tmp_path: Path) -> None:
    """A ruled surface over a polyline as a NURBS curve of degree 1, with its corner at a third."""
    corners = [(0, 0, 0), (1, 0, 0), (1, 2, 0)]
    base = rhino.Polyline([rhino.Point3d(*p) for p in corners]).ToPolylineCurve().ToNurbsCurve()
    top = base.Duplicate()
    top.Translate(rhino.Vector3d(0, 0, 1))
    surface = rhino.NurbsSurface.CreateRuledSurface(base, top)
    mesh = load_mesh(written(tmp_path / "m.3dm", surface), surfaces=(5, 1))
    on_the_corner = (mesh.vertices[:, :2] == torch.tensor([1.0, 0.0], dtype=torch.float64)).all(1)
    assert int(on_the_corner.sum()) == 2
    area = face_area_vectors(mesh.vertices, mesh.topology).norm(dim=-1).sum()
    assert float(area) == pytest.approx(3.0, rel=1e-14)


def test_faces_of_a_box_weld_to_a_solid_turned_outwards(tmp_path: Path) -> None:
    box = rhino.Brep.CreateFromBox(rhino.Box(rhino.BoundingBox(rhino.Point3d(0, 0, 0), rhino.Point3d(1, 2, 3))))
    path = written(tmp_path / "m.3dm", box)
    mesh = load_mesh(path, surfaces=3, weld=True)
    assert euler(mesh.topology) == 2
    assert not mesh.topology.boundary_loops()
    assert volume(mesh) == pytest.approx(6.0, rel=1e-14)
    assert "weld=True" in load_mesh(path, surfaces=3).notes[0]


def test_a_reversed_face_is_turned(tmp_path: Path) -> None:
    brep = sphere().ToBrep()
    brep.Flip()
    mesh = load_mesh(written(tmp_path / "m.3dm", brep), surfaces=12)
    assert volume(mesh) < 0.0


def test_trimmed_surfaces_are_named(tmp_path: Path) -> None:
    path = written(tmp_path / "m.3dm", cylinder().ToBrep(True, True), layer="Roof", name="drum")
    words = r"2 trimmed surface\(s\), .*: face 1 of drum on layer Roof, face 2 of drum on layer Roof. Hide them"
    with pytest.raises(MeshFileError, match=words):
        load_mesh(path, surfaces=10)
    ell = [(0, 0), (2, 0), (2, 1), (1, 1), (1, 2), (0, 2), (0, 0)]
    curve = rhino.Polyline([rhino.Point3d(x, y, 0) for x, y in ell]).ToPolylineCurve()
    path = written(tmp_path / "n.3dm", rhino.Brep.CreateTrimmedPlane(rhino.Plane.WorldXY(), curve))
    with pytest.raises(MeshFileError, match=r"1 trimmed .*: an object without a name on layer Default. Hide"):
        load_mesh(path, surfaces=10)


def test_a_plane_that_is_trimmed_along_its_domain_is_whole(tmp_path: Path) -> None:
    curve = rhino.Polyline([rhino.Point3d(x, y, 0) for x, y in ((0, 0), (2, 0), (2, 1), (0, 1), (0, 0))])
    brep = rhino.Brep.CreateTrimmedPlane(rhino.Plane.WorldXY(), curve.ToPolylineCurve())
    mesh = load_mesh(written(tmp_path / "m.3dm", brep), surfaces=(4, 3))
    assert (mesh.topology.num_faces, mesh.topology.num_vertices) == (12, 20)


def test_without_being_asked_surfaces_are_left_out_and_the_way_is_told(tmp_path: Path) -> None:
    model = rhino.File3dm()
    model.Objects.AddSurface(sphere().ToNurbsSurface())
    model.Write(str(tmp_path / "m.3dm"), 7)
    with pytest.raises(MeshFileError, match=r"no visible meshes: 1 NurbsSurface. .* surfaces=N \(--surfaces N"):
        load_mesh(tmp_path / "m.3dm")
    mesh = rhino.Mesh()
    for place in ((0, 0, 0), (1, 0, 0), (0, 1, 0)):
        mesh.Vertices.Add(*place)
    mesh.Faces.AddFace(0, 1, 2)
    model.Objects.AddMesh(mesh, rhino.ObjectAttributes())
    model.Write(str(tmp_path / "m.3dm"), 7)
    assert "Surfaces are sampled by surfaces=N" in load_mesh(tmp_path / "m.3dm").notes[0]
    both = load_mesh(tmp_path / "m.3dm", surfaces=4)
    assert isinstance(both.attributes, RhinoParts)
    assert both.attributes.owners.tolist() == [0] * 16 + [1]


@pytest.mark.parametrize("cells", [0, -1, 2.5, True, (3,), (3, 0), "4"])
def test_numbers_of_cells_are_checked(cells: Any, tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="surfaces must be"):
        load_mesh(tmp_path / "m.3dm", surfaces=cells)


@pytest.mark.parametrize("cells", [99_999_999, (1, 10_000_001), (3163, 3162)])
def test_grids_that_would_fill_the_memory_are_refused(cells: Any, tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match="surfaces may ask for 10000000 cells a surface, got "):
        load_mesh(tmp_path / "m.3dm", surfaces=cells)
    with pytest.raises(MeshFileError, match="does not exist"):
        load_mesh(tmp_path / "m.3dm", surfaces=(3162, 3162))


@pytest.mark.parametrize("lost", ["UnderlyingSurface", "DuplicateFace"])
def test_surfaces_that_a_damaged_file_has_lost(lost: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    box = rhino.Box(rhino.BoundingBox(rhino.Point3d(0, 0, 0), rhino.Point3d(1, 1, 1)))
    path = written(tmp_path / "m.3dm", rhino.Brep.CreateFromBox(box))
    monkeypatch.setattr(rhino.BrepFace, lost, lambda *given: None)
    with pytest.raises(MeshFileError, match=r"surfaces of 'an object' are damaged"):
        load_mesh(path, surfaces=3)
    with pytest.raises(MeshFileError, match="no visible meshes: 1 Brep"):
        load_mesh(path)


def test_the_command_line_samples(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = written(tmp_path / "m.3dm", torus())
    assert main(["measure", str(path), "--surfaces", "40,20", "--json"]) == 0
    numbers = json.loads(capsys.readouterr().out)
    assert numbers["faces"] == 800
    for words in ("0", "x", "1,2,3", "4,"):
        assert main(["measure", str(path), "--surfaces", words]) == 2
        assert "expected whole numbers of at least 1, such as 40 or 40,20" in capsys.readouterr().err
