"""Files of formats that repeat vertices where normals, textures or materials differ, and meshes of loose patches."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from helpers import wavy_grid
from torch import Tensor

from torchfair import MeshFileError, Topology
from torchfair.cli.command import main
from torchfair.energies import normal_variation
from torchfair.io import PolygonMesh, load_mesh, save_mesh
from torchfair.shapes import builtin_mesh
from torchfair.triangulation import triangulate

FORMATS = {".glb": "trimesh", ".gltf": "trimesh", ".dae": "collada", ".3mf": "lxml"}
formats = pytest.mark.parametrize("suffix", FORMATS)


def needs(suffix: str) -> None:
    pytest.importorskip(FORMATS[suffix])


def export(path: Path, points: np.ndarray[Any, Any], triangles: np.ndarray[Any, Any]) -> Path:
    """The file as trimesh writes it, vertex by vertex."""
    import trimesh

    data: Any = trimesh.Trimesh(points, triangles, process=False).export(file_type=path.suffix[1:])
    if isinstance(data, dict):  # of a .gltf file and its buffers
        for name, part in data.items():
            (path.parent / name).write_bytes(part)
        return path.parent / next(name for name in data if name.endswith(".gltf"))
    path.write_bytes(data)
    return path


def roof() -> tuple[Tensor, Tensor]:
    """Vertices in single precision, and triangles."""
    vertices, topology = builtin_mesh("roof")
    return vertices.float().double(), triangulate(vertices, topology).triangles


def energy(mesh: PolygonMesh) -> float:
    return float(normal_variation(mesh.vertices, mesh.topology))


@formats
def test_flat_shading_does_not_hide_the_energy(suffix: str, tmp_path: Path) -> None:
    """Three vertices for each triangle, as Blender writes faces that are shaded flat."""
    needs(suffix)
    vertices, triangles = roof()
    corners = vertices[triangles].reshape(-1, 3)
    loose = Topology.from_faces(np.arange(len(corners)).reshape(-1, 3), len(corners))
    assert float(normal_variation(corners, loose)) == 0.0
    mesh = load_mesh(export(tmp_path / f"m{suffix}", corners.numpy(), np.arange(len(corners)).reshape(-1, 3)))
    expected = float(normal_variation(vertices, Topology.from_faces(triangles, len(vertices))))
    assert energy(mesh) == pytest.approx(expected, rel=1e-6)  # .dae and .3mf hold decimal digits
    assert mesh.topology.num_vertices == len(vertices)
    (note,) = mesh.notes
    assert note.startswith("files of this format repeat vertices where normals, textures or materials differ: welded ")
    assert mesh.repairs == ()


def test_what_was_joined_is_counted_and_mapped(tmp_path: Path) -> None:
    """Exact in GLB: the energy of the welded mesh to the bit, each vertex of the file where it was."""
    vertices, triangles = roof()
    corners = vertices[triangles].reshape(-1, 3)
    mesh = load_mesh(export(tmp_path / "m.glb", corners.numpy(), np.arange(len(corners)).reshape(-1, 3)))
    assert f"welded {len(corners) - len(vertices)} vertex(es)" in mesh.notes[0]
    assert "at most 0 away" in mesh.notes[0]
    assert mesh.vertex_map is not None
    assert mesh.vertices[mesh.vertex_map].equal(corners)
    same = Topology.from_faces(mesh.vertex_map.reshape(-1, 3), mesh.topology.num_vertices)
    assert energy(mesh) == float(normal_variation(mesh.vertices, same))


@pytest.mark.parametrize("scale", [1.0, 1e4])
@pytest.mark.parametrize(("off", "closed"), [(0.0, True), (2.0**-23, True), (2e-3, False)])
def test_texture_seams_are_closed_whatever_the_size(tmp_path: Path, scale: float, off: float, closed: bool) -> None:
    """Along one row of a grid, with one side a unit in the last place off; a gap that can be seen stays."""
    vertices, topology = wavy_grid(6, 6, triangles=True)
    row = torch.arange(18, 24)
    beyond = (topology.triangles >= 18).all(1, keepdim=True)
    triangles = torch.where(beyond & (topology.triangles < 24), topology.triangles + 18, topology.triangles)
    points = scale * torch.cat([vertices.float().double(), vertices[row].float().double() * (1.0 + off)])
    mesh = load_mesh(export(tmp_path / "m.glb", points.numpy(), triangles.numpy()))
    assert (mesh.topology.num_interior_edges == topology.num_interior_edges) == closed
    assert ("welded 6 vertex(es)" in " ".join(mesh.notes)) == closed
    exact = load_mesh(tmp_path / "m.glb", weld=0.0)
    assert (exact.topology.num_interior_edges == topology.num_interior_edges) == (off == 0.0)


def test_meshes_that_share_vertices_already_stay_as_they_are(tmp_path: Path) -> None:
    vertices, topology = wavy_grid(6, 6, triangles=True)
    save_mesh(tmp_path / "m.glb", vertices, topology)
    mesh = load_mesh(tmp_path / "m.glb")
    assert mesh.notes == ()
    assert mesh.vertex_map is None
    assert mesh.topology.face_lists() == topology.face_lists()


def test_two_sided_faces_are_named_with_what_mends_them(tmp_path: Path) -> None:
    """Each triangle twice, turned over: no edge can be said to be that of two faces."""
    vertices, triangles = roof()
    corners = vertices[torch.cat([triangles, triangles.flip(1)])].reshape(-1, 3)
    path = export(tmp_path / "m.glb", corners.numpy(), np.arange(len(corners)).reshape(-1, 3))
    with pytest.raises(MeshFileError, match=r"mends this"):
        load_mesh(path)
    assert load_mesh(path, repair=True).topology.num_faces == len(triangles)


@pytest.mark.parametrize("suffix", [".dae", ".3mf"])
def test_a_missing_package_is_named(suffix: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import trimesh

    def load(*_: object, **__: object) -> None:
        raise ModuleNotFoundError("No module named 'xyz'")

    monkeypatch.setattr(trimesh, "load", load)
    (tmp_path / f"m{suffix}").write_text("x")
    with pytest.raises(MeshFileError, match=r"needs more packages \(No module named 'xyz'\): pip install"):
        load_mesh(tmp_path / f"m{suffix}")


@pytest.mark.parametrize("suffix", [".obj", ".off", ".ply", ".glb"])
def test_patches_far_apart_are_told_in_every_format(suffix: str, tmp_path: Path) -> None:
    """Triangles a tenth smaller than where they would touch."""
    vertices, triangles = roof()
    corners = vertices[triangles]
    corners = corners + 0.1 * (corners.mean(1, keepdim=True) - corners)
    topology = Topology.from_faces(np.arange(corners.numel() // 3).reshape(-1, 3), corners.numel() // 3)
    save_mesh(tmp_path / f"m{suffix}", corners.reshape(-1, 3), topology)
    (note,) = load_mesh(tmp_path / f"m{suffix}").notes
    count = 3 * len(triangles)
    assert note.startswith(f"most edges ({count} of {count}) are boundary, and those carry no E. If its faces are")


def test_half_of_the_edges_are_not_most(tmp_path: Path) -> None:
    """Two quads in a row: 6 of 7; 3 by 3 quads: 12 of 24."""
    for cells, told in (((2, 1), True), ((3, 3), False)):
        save_mesh(tmp_path / "m.obj", *wavy_grid(cells[0] + 1, cells[1] + 1), overwrite=True)
        assert bool(load_mesh(tmp_path / "m.obj").notes) == told


def test_the_command_line_measures_the_welded_mesh(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    vertices, triangles = roof()
    corners = vertices[triangles].reshape(-1, 3)
    path = export(tmp_path / "m.glb", corners.numpy(), np.arange(len(corners)).reshape(-1, 3))
    assert main(["measure", str(path)]) == 0
    printed = capsys.readouterr()
    assert "files of this format repeat vertices" in printed.out + printed.err
