"""Meshes in DXF files: every digit and polygon, layers, what ezdxf makes of them, and faults with their lines."""

from __future__ import annotations

import contextlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from helpers import cube, wavy_grid
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from torchfair import MeshFileError, Topology, TorchfairError
from torchfair.cli.command import main
from torchfair.io import RhinoParts, load_mesh, save_mesh

FACES = [[2, 0, 1], [0, 2, 3], [2, 1, 4, 5], [3, 2, 5, 6, 7, 8]]
LAYERS = RhinoParts("Millimeters", (("", "Roof"), ("", "Glass")), np.array([0, 1, 0, 1]))


@pytest.fixture
def ezdxf() -> Any:
    return pytest.importorskip("ezdxf")


def meshes_of(ezdxf: Any, path: Path) -> list[tuple[str, list[tuple[float, ...]], list[list[int]]]]:
    """Layer, vertices and faces of each MESH, as ezdxf reads them; the file has no fault that it knows."""
    document = ezdxf.readfile(path)
    audit = document.audit()
    assert (audit.errors, audit.fixes) == ([], [])
    found = document.modelspace().query("MESH")
    return [(m.dxf.layer, [tuple(v) for v in m.vertices], [list(face) for face in m.faces]) for m in found]


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.floats(-1e100, 1e100), min_size=30, max_size=30))
def test_every_digit_and_every_polygon_comes_back(tmp_path: Path, numbers: list[float]) -> None:
    vertices = torch.tensor(numbers, dtype=torch.float64).view(10, 3)
    save_mesh(tmp_path / "m.dxf", vertices, Topology.from_faces(FACES, 10), overwrite=True)
    mesh = load_mesh(tmp_path / "m.dxf")
    assert mesh.vertices.view(torch.int64).equal(vertices.view(torch.int64))  # with the sign of zero
    assert mesh.topology.face_lists() == FACES


def test_layers_and_units_come_back(tmp_path: Path) -> None:
    vertices, topology = wavy_grid(3, 3)
    save_mesh(tmp_path / "m.dxf", vertices, topology, attributes=LAYERS)
    mesh = load_mesh(tmp_path / "m.dxf", weld=0.0)
    assert isinstance(mesh.attributes, RhinoParts)
    assert (mesh.attributes.unit, mesh.attributes.objects) == ("Millimeters", LAYERS.objects)
    assert mesh.attributes.owners.tolist() == [0, 0, 1, 1]
    assert mesh.topology.num_interior_edges == topology.num_interior_edges


@pytest.mark.parametrize(
    ("layer", "expected"),
    [
        ("Roof::Glass", "Roof__Glass"),
        ("\u00e4 \u5c4b", "\u00e4 \u5c4b"),
        ("a\nb", "a b"),
        ("", "0"),
    ],
)
def test_layers_that_dxf_forbids_are_changed(layer: str, expected: str, tmp_path: Path) -> None:
    parts = RhinoParts("Unset", (("shell", layer),), np.zeros(6, np.int64))
    save_mesh(tmp_path / "m.dxf", *cube(), attributes=parts)
    attributes = load_mesh(tmp_path / "m.dxf").attributes
    assert isinstance(attributes, RhinoParts)
    assert (attributes.unit, attributes.objects) == ("None", (("", expected),))


def test_what_ezdxf_reads(ezdxf: Any, tmp_path: Path) -> None:
    vertices, topology = wavy_grid(3, 3)
    vertices = vertices + 1e6 / 3.0
    save_mesh(tmp_path / "m.dxf", vertices, topology, attributes=LAYERS)
    found = meshes_of(ezdxf, tmp_path / "m.dxf")
    assert [layer for layer, _, _ in found] == ["Roof", "Glass"]
    assert ezdxf.readfile(tmp_path / "m.dxf").units == 4
    for number, (_, points, faces) in enumerate(found):
        read = torch.tensor(points, dtype=torch.float64)[torch.tensor(faces)]
        wanted = torch.tensor(topology.face_lists())[torch.from_numpy(LAYERS.owners == number)]
        assert read.equal(vertices[wanted])


def test_what_ezdxf_writes(ezdxf: Any, tmp_path: Path) -> None:
    document = ezdxf.new("R2010", units=6)
    space = document.modelspace()
    points = (1e5 * np.random.default_rng(3).normal(size=(9, 3))).tolist()
    made = space.add_mesh(dxfattribs={"layer": "Schale", "subdivision_levels": 2})
    with made.edit_data() as data:
        data.vertices, data.faces = points, FACES
        data.add_edge_crease(0, 1, 3.0)
    space.add_line((0, 0, 0), (1, 1, 1))
    with document.layout("Layout1").add_mesh().edit_data() as data:  # on a sheet
        data.vertices, data.faces = points, FACES
    document.saveas(tmp_path / "m.dxf")
    mesh = load_mesh(tmp_path / "m.dxf")
    assert mesh.vertices.tolist() == points
    assert mesh.topology.face_lists() == FACES
    assert isinstance(mesh.attributes, RhinoParts)
    assert (mesh.attributes.unit, mesh.attributes.objects) == ("Meters", (("", "Schale"),))
    assert mesh.notes[:2] == (
        "left out of the file: 1 LINE",
        "1 mesh(es) are shown subdivided in the drawing; their control meshes are read",
    )


@pytest.mark.parametrize("version", ["R12", "R2000", "R2018"])
def test_polyface_meshes_of_ezdxf(ezdxf: Any, tmp_path: Path, version: str) -> None:
    """Two of them on layers, with polylines of another kind between them."""
    vertices, topology = cube()
    document = ezdxf.new(version)
    space = document.modelspace()
    shifts = (0.0, 10.0)
    for number, shift in enumerate(shifts):
        made = space.add_polyface(dxfattribs={"layer": f"L{number}"})
        made.append_faces([(vertices[face] + shift).tolist() for face in topology.face_lists()])
        made.optimize()
        space.add_polyline3d([(0, 0, 0), (1, 0, 0), (2, 0, 1)])
    document.saveas(tmp_path / "m.dxf")
    mesh = load_mesh(tmp_path / "m.dxf")
    assert mesh.topology.num_vertices == 16
    assert not mesh.topology.boundary_loops()
    assert isinstance(mesh.attributes, RhinoParts)
    assert mesh.attributes.objects == (("", "L0"), ("", "L1"))
    assert mesh.notes == ("left out of the file: 2 POLYLINE",)
    expected = torch.cat([vertices[topology.corners] + shift for shift in shifts])
    assert mesh.vertices[mesh.topology.corners].equal(expected)


PLACES = "".join(f"0\nVERTEX\n70\n192\n10\n{x}\n20\n{y}\n30\n0.0\n" for x, y in ((0, 0), (1, 0), (1, 1), (0, 1)))
RECORDS = "0\nVERTEX\n70\n128\n71\n1\n72\n2\n73\n-3\n0\nVERTEX\n70\n128\n71\n-1\n72\n3\n73\n4\n74\n0\n"
POLYFACE = f"0\nSECTION\n2\nENTITIES\n0\nPOLYLINE\n66\n1\n70\n64\n{PLACES}{RECORDS}"


def test_hidden_edges_of_polyface_meshes_have_numbers_below_zero(tmp_path: Path) -> None:
    (tmp_path / "m.dxf").write_text(f"{POLYFACE}0\nSEQEND\n0\nENDSEC\n0\nEOF\n")
    mesh = load_mesh(tmp_path / "m.dxf")
    assert mesh.topology.face_lists() == [[0, 1, 2], [0, 2, 3]]


@pytest.mark.parametrize("change", [lambda data: data.replace(b"\n", b"\r\n"), lambda data: b"\xef\xbb\xbf" + data])
def test_ends_of_lines_and_marks_of_bytes(tmp_path: Path, change: Any) -> None:
    vertices, topology = wavy_grid()
    save_mesh(tmp_path / "m.dxf", vertices, topology)
    (tmp_path / "n.dxf").write_bytes(change((tmp_path / "m.dxf").read_bytes()))
    assert load_mesh(tmp_path / "n.dxf").vertices.equal(vertices)


HEAD = "0\nSECTION\n2\nENTITIES\n0\nMESH\n8\nA\n100\nAcDbSubDMesh\n"  # 10 lines
POINTS = "92\n3\n" + "10\n0\n20\n0\n30\n0\n10\n1\n20\n0\n30\n0\n10\n0\n20\n1\n30\n0\n"  # to line 30
MESH = HEAD + POINTS
FAULTS = {
    "nothing": ("0\nSECTION\n2\nENTITIES\n0\nLINE\n0\nENDSEC\n", "no MESH and no polyface.*: 1 LINE", None),
    "no drawing": ("hello\nworld\n", "'hello' is no group code", 1),
    "a long number": ("0\nSECTION\n" + "9" * 30 + "\nx\n", "'99999999999999999999' is no group code", 3),
    "binary": ("AutoCAD Binary DXF\r\n\x1a\0abc", "binary DXF file. Save it as text", None),
    "no count": (HEAD + "10\n0\n", "no number of vertices", 6),
    "a wrong count": (HEAD + POINTS.replace("92\n3", "92\n4"), "promises 4 vertices", 12),
    "a count without end": (HEAD + POINTS.replace("92\n3", "92\n99999999999"), "more than the file holds", 12),
    "a word": (HEAD + POINTS.replace("10\n1", "10\nx") + "93\n0\n", "'x' is no number", 20),
    "no faces": (MESH, "no list of faces", 12),
    "an empty list": (MESH + "93\n0\n0\nENDSEC\n", "no faces", None),
    "a short list": (MESH + "93\n4\n90\n3\n90\n0\n90\n1\n94\n0\n", "promises 4 numbers", 32),
    "two corners": (MESH + "93\n3\n90\n2\n90\n0\n90\n1\n", "a face of a MESH has 2 corners", 34),
    "corners beyond": (MESH + "93\n3\n90\n3\n90\n0\n90\n1\n", "a face of a MESH has 3 corners", 34),
    "a vertex beyond": (MESH + "93\n4\n90\n3\n90\n0\n90\n1\n90\n3\n", r"vertex 3, but .* 0\.\.2", 40),
    "half a number": (MESH + "93\n4\n90\n3\n90\n0\n90\n1.5\n90\n2\n", "'1.5' is no whole number", 38),
    "infinity": (MESH.replace("10\n1", "10\n1e999") + "93\n4\n90\n3\n90\n0\n90\n1\n90\n2\n", "not finite", None),
    "no end": (POLYFACE, "does not end", 6),
    "a record beyond": (POLYFACE.replace("73\n4", "73\n5") + "0\nSEQEND\n", r"vertex 5, but .* 1\.\.4", None),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_named_with_their_lines(fault: str, tmp_path: Path) -> None:
    text, words, line = FAULTS[fault]
    (tmp_path / "m.dxf").write_text(text, newline="")
    with pytest.raises(MeshFileError, match=words) as caught:
        load_mesh(tmp_path / "m.dxf")
    assert line is None or caught.value.line == line


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.data())
def test_damaged_files_are_refused_or_read(tmp_path: Path, data: st.DataObject) -> None:
    save_mesh(tmp_path / "m.dxf", *wavy_grid(3, 3), overwrite=True)
    lines = (tmp_path / "m.dxf").read_text().split("\n")
    for _ in range(data.draw(st.integers(1, 3))):
        place = data.draw(st.integers(0, len(lines) - 1))
        lines[place] = data.draw(st.sampled_from(["", "0", "-1", "90", "x", "1e999", "9" * 30, lines[place // 2]]))
    (tmp_path / "n.dxf").write_text("\n".join(lines[: data.draw(st.integers(1, len(lines)))]))
    with contextlib.suppress(TorchfairError):  # and no other error
        load_mesh(tmp_path / "n.dxf")


def test_commands_write_dxf(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With the layer of the first object, and its unit."""
    save_mesh(tmp_path / "in.dxf", *wavy_grid(3, 3), attributes=LAYERS)
    assert main(["subdivide", str(tmp_path / "in.dxf"), "--weld", "-o", str(tmp_path / "out.dxf")]) == 0
    made = load_mesh(tmp_path / "out.dxf").attributes
    assert isinstance(made, RhinoParts)
    assert (made.unit, made.objects) == ("Millimeters", (("", "Roof"),))
    assert "does not hold the single objects" in capsys.readouterr().out
    named = RhinoParts("Meters", (("shell", "Roof"),), np.zeros(4, np.int64))
    assert named.left_out(".dxf", True) == "the names of objects"
    assert RhinoParts("Meters", (("", "Roof"),), np.zeros(4, np.int64)).left_out(".dxf", True) == ""
