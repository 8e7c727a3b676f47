"""Groups, materials, layers and units of a file are written back, also from session files."""

from __future__ import annotations

import io
import json
import zipfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from design_tools import Bench, triangle_document
from helpers import wavy_grid

from torchfair import MeshFileError, load_mesh, save_mesh
from torchfair.design.effects import Deliver
from torchfair.design.engine.requests import Open
from torchfair.design.session_file import read_session
from torchfair.design.session_writing import session_bytes
from torchfair.io import ObjAttributes, RhinoParts

TEXT = """mtllib shop.mtl
v 0 0 0 .1 .2 .3
v 1 0 0 1 0 0
v 2 0 .2 0 1 0
v 0 1 .1 0 0 1
v 1 1 .3 1 1 0
v 2 1 0 1 1 1
vt 0 0
vt 1 .5
g left
usemtl glass
f 1/1 2/2 5/1 4/2
g right
usemtl steel
f 2/2 3/1 6/2 5/1
"""
GROUPS = ("mtllib shop.mtl", "g left", "usemtl glass", "g right", "usemtl steel", "vt 1 .5")


def opened(path: Path) -> Bench:
    bench = Bench(path.parent, Open(0, str(path), None, path.name))
    assert not bench.errors
    return bench


def pulled(bench: Bench, vertex: int = 1) -> None:
    place = bench.vertices[vertex] + np.array([0, 0, 0.05])
    bench.say(type="move", places=[[vertex, *map(float, place)]], count=1)
    bench.say(type="release", id=1)


def saved(bench: Bench, format: str, path: Path) -> Path:
    bench.stored.clear()
    bench.say(type="save", format=format, to="download", id=7)
    assert not bench.errors
    path.write_bytes(next(effect for effect in bench.stored if isinstance(effect, Deliver)).content())
    return path


def reopened(bench: Bench, tmp_path: Path) -> Bench:
    """From a session file."""
    return opened(saved(bench, "session", tmp_path / "kept.torchfair"))


@pytest.mark.parametrize("through_session", [False, True])
def test_an_obj_file_keeps_groups_materials_textures_and_colours(tmp_path: Path, through_session: bool) -> None:
    (tmp_path / "shop.obj").write_text(TEXT)
    bench = opened(tmp_path / "shop.obj")
    pulled(bench)
    if through_session:
        bench = reopened(bench, tmp_path)
    lines = saved(bench, "obj", tmp_path / "new.obj").read_text().splitlines()
    assert [line for line in lines if line.split()[0] not in ("v", "f", "#")] == [
        "vt 0 0", "vt 1 .5", "mtllib shop.mtl", "g left", "usemtl glass", "g right", "usemtl steel",
    ]  # fmt: skip
    assert [line for line in lines if line.startswith("f")] == ["f 1/1 2/2 5/1 4/2", "f 2/2 3/1 6/2 5/1"]
    assert next(line.split()[4:] for line in lines if line.startswith("v ")) == [".1", ".2", ".3"]
    mesh = load_mesh(tmp_path / "new.obj")
    assert np.array_equal(mesh.vertices.numpy(), bench.vertices)


def test_other_faces_have_no_groups(tmp_path: Path) -> None:
    (tmp_path / "shop.obj").write_text(TEXT)
    bench = opened(tmp_path / "shop.obj")
    bench.say(type="subdivide")
    text = saved(bench, "obj", tmp_path / "fine.obj").read_text()
    assert not any(word in text for word in GROUPS)
    bench.say(type="undo")
    text = saved(bench, "obj", tmp_path / "again.obj").read_text()
    assert all(word in text for word in GROUPS)


def test_a_3dm_file_keeps_unit_layers_and_names(tmp_path: Path) -> None:
    pytest.importorskip("rhino3dm")
    parts = RhinoParts("Millimeters", (("left", "Roof::Glass"), ("right", "Roof")), np.array([0, 0, 0, 0, 1, 1, 1, 1]))
    vertices, topology = wavy_grid(3, 5)
    parts = replace(parts, owners=np.arange(topology.num_faces) * 2 // topology.num_faces)
    save_mesh(tmp_path / "roof.3dm", vertices, topology, attributes=parts)
    mesh = load_mesh(tmp_path / "roof.3dm", weld=True)
    save_mesh(tmp_path / "one.3dm", mesh.vertices, mesh.topology, attributes=replace(parts, objects=parts.objects[:1],
        owners=np.zeros_like(parts.owners)))  # fmt: skip
    bench = opened(tmp_path / "one.3dm")
    pulled(bench, 2)
    for again in (bench, reopened(bench, tmp_path)):
        kept = load_mesh(saved(again, "3dm", tmp_path / "new.3dm")).attributes
        assert isinstance(kept, RhinoParts)
        assert (kept.unit, kept.objects) == ("Millimeters", (("left", "Roof::Glass"),))
    bench.say(type="subdivide")
    kept = load_mesh(saved(bench, "3dm", tmp_path / "fine.3dm")).attributes
    assert isinstance(kept, RhinoParts)
    assert kept.unit == "Millimeters"


def test_states_of_a_session_share_what_the_file_says(tmp_path: Path) -> None:
    (tmp_path / "shop.obj").write_text(TEXT)
    bench = opened(tmp_path / "shop.obj")
    first = bench.session.history.now.attributes
    pulled(bench)
    assert bench.session.history.now.attributes is first
    stored = read_session(saved(bench, "session", tmp_path / "kept.torchfair")).documents
    assert isinstance(stored[0].attributes, ObjAttributes)
    assert all(document.attributes is stored[0].attributes for document in stored)


ALIEN: list[Any] = [
    {"statements": [[0, "g a\nv 1 1 1"]]},
    {"statements": [[0, "call evil.obj"]]},
    {"statements": [[3, "g a"]]},
    {"statements": [[1, "g a"], [0, "g b"]]},
    {"statements": [[0, "g a"], [2, "g b"], [1, "g c"]]},
    {"statements": [["x", "g a"]]},
    {"textures": ["v 1 1"]},
    {"behind": ["1"]},
    {"corner_textures": "array1"},
    {"corner_textures": None},
    {"folder": None, "dropped": 3},
    {"unit": "Meters; rm", "objects": [["a", "b"]], "owners": "array0"},
    {"unit": "Meters", "objects": [["a", "b"]], "owners": "array0"},
]


@pytest.mark.parametrize("parts", ALIEN, ids=str)
def test_attributes_that_are_none_are_refused(tmp_path: Path, parts: dict[str, Any]) -> None:
    attributes = ObjAttributes(tmp_path, ((0, b"g a"), (1, b"g b")))
    data = session_bytes([replace(triangle_document(), attributes=attributes)], 0)
    path = tmp_path / "two.torchfair"
    path.write_bytes(data)
    assert read_session(path).documents[0].attributes is not None
    with zipfile.ZipFile(io.BytesIO(data)) as source, zipfile.ZipFile(path, "w") as target:
        for name in source.namelist():
            content = source.read(name)
            if name == "design.json":
                head = json.loads(content)
                head["attributes"][0] |= parts
                content = json.dumps(head).encode()
            target.writestr(name, content)
    with pytest.raises(MeshFileError, match="is no session file"):
        read_session(path)
