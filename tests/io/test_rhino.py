"""Meshes in 3DM files: exact, with unit, layers, names and polygons."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from helpers import cube, wavy_grid

from torchfair import MeshFileError, Topology, TorchfairError
from torchfair.io import RhinoParts, load_mesh, save_mesh


@pytest.fixture
def rhino() -> Any:
    return pytest.importorskip("rhino3dm")


def test_the_package_is_asked_for(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "rhino3dm", None)
    with pytest.raises(TorchfairError, match="torchfair\\[rhino\\]"):
        save_mesh(tmp_path / "m.3dm", *cube())
    assert list(tmp_path.iterdir()) == []


def test_every_digit_and_every_polygon_comes_back(rhino: Any, tmp_path: Path) -> None:
    """Far from the origin, where single precision would move vertices by centimetres."""
    faces = [[2, 0, 1], [0, 2, 3], [2, 1, 4, 5], [3, 2, 5, 6, 7, 8]]
    vertices = 3e5 + torch.from_numpy(np.random.default_rng(1).normal(size=(10, 3)))
    topology = Topology.from_faces(faces, 10)
    save_mesh(tmp_path / "m.3dm", vertices, topology)
    mesh = load_mesh(tmp_path / "m.3dm")
    assert mesh.vertices.equal(vertices)
    assert mesh.topology.face_lists() == faces
    count, inner = topology.num_edges, topology.num_interior_edges
    assert [note.split(" are")[0] for note in mesh.notes] == [f"most edges ({count - inner} of {count})"]


def test_unit_layers_and_names_come_back(rhino: Any, tmp_path: Path) -> None:
    vertices, topology = wavy_grid(3, 3)
    parts = RhinoParts("Meters", (("left", "Roof::Glass"), ("right", "Roof")), np.array([0, 1, 0, 1]))
    save_mesh(tmp_path / "m.3dm", vertices, topology, attributes=parts)
    mesh = load_mesh(tmp_path / "m.3dm", weld=True)
    assert isinstance(mesh.attributes, RhinoParts)
    assert mesh.attributes.unit == "Meters"
    assert mesh.attributes.objects == parts.objects
    assert mesh.attributes.owners.tolist() == [0, 0, 1, 1]
    assert mesh.topology.num_interior_edges == topology.num_interior_edges
    assert "pair(s) of boundary edges lie on each other" in load_mesh(tmp_path / "m.3dm").notes[0]


def test_blocks_are_put_where_they_are_inserted(rhino: Any, tmp_path: Path) -> None:
    """Scaled, and mirrored with faces turned back."""
    model = rhino.File3dm()
    mesh = rhino.Mesh()
    for place in ((0, 0, 0), (1, 0, 0), (0, 1, 0)):
        mesh.Vertices.Add(*place)
    mesh.Faces.AddFace(0, 1, 2)
    attributes = rhino.ObjectAttributes()
    number = model.InstanceDefinitions.Add("block", "", "", "", rhino.Point3d(0, 0, 0), (mesh,), (attributes,))
    block = model.InstanceDefinitions[number]
    for factors in ((2.0, 2.0, 2.0), (-1.0, 1.0, 1.0)):
        transform = rhino.Transform(1.0)
        for axis, factor in enumerate(factors):
            setattr(transform, f"M{axis}{axis}", factor)
        model.Objects.AddInstanceObject(rhino.InstanceReference(block.Id, transform))
    model.Objects.AddPoint(rhino.Point3d(1, 1, 1))
    model.Write(str(tmp_path / "m.3dm"), 7)
    read = load_mesh(tmp_path / "m.3dm")
    assert read.vertices[:, 0].tolist() == [0, 2, 0, 0, -1, 0]
    assert read.topology.face_lists() == [[0, 1, 2], [5, 4, 3]]
    assert read.notes[0] == "left out of the file: 1 Point"


def test_files_without_meshes_are_named(rhino: Any, tmp_path: Path) -> None:
    (tmp_path / "m.3dm").write_text("nothing of the kind")
    with pytest.raises(MeshFileError, match="no 3DM file"):
        load_mesh(tmp_path / "m.3dm")
    model = rhino.File3dm()
    model.Objects.AddCircle(rhino.Circle(rhino.Point3d(0, 0, 0), 2.0))
    model.Write(str(tmp_path / "m.3dm"), 7)
    with pytest.raises(MeshFileError, match=r"no visible meshes: 1 \w+Curve. Mesh its surfaces"):
        load_mesh(tmp_path / "m.3dm")


def test_a_command_keeps_unit_layer_and_name(rhino: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from torchfair.cli.command import main

    parts = RhinoParts("Meters", (("shell", "Roof"),), np.zeros(4, np.int64))
    save_mesh(tmp_path / "in.3dm", *wavy_grid(3, 3), attributes=parts)
    assert main(["subdivide", str(tmp_path / "in.3dm"), "-o", str(tmp_path / "out.3dm")]) == 0
    made = load_mesh(tmp_path / "out.3dm").attributes
    assert isinstance(made, RhinoParts)
    assert (made.unit, made.objects) == ("Meters", parts.objects)
    assert main(["subdivide", str(tmp_path / "in.3dm"), "-o", str(tmp_path / "out.obj")]) == 0
    assert "out.obj does not hold the unit (Meters) and names and layers of objects" in capsys.readouterr().out
    assert main(["subdivide", str(tmp_path / "out.obj"), "-o", str(tmp_path / "back.3dm")]) == 0
