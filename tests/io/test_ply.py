"""What a PLY file may say, and what it may not."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from helpers import wavy_grid

from torchfair import MeshFileError, Topology
from torchfair.io import load_mesh, save_mesh
from torchfair.io.ply import read_ply

POINTS = [(0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 1.0, 0.0), (0.0, 1.0, 0.5), (2.0, 2.0, 2.0)]
FACES = [[0, 1, 2, 3], [3, 2, 4]]
HEADER = """ply
format {format} 1.0
comment made by hand
obj_info nothing
element vertex 5
property float x
property double y
property short quality
property float z
element face 2
property uchar flag
property list uchar int vertex_indices
property list ushort float texcoord
element edge 1
property int vertex1
property int vertex2
end_header
"""


def by_hand(kind: str) -> bytes:
    """A file with every kind of property and element, in one of the three formats."""
    if kind == "ascii":
        lines = [f"{x} {y} -7 {z}" for x, y, z in POINTS]
        lines += [f"9 {len(face)} {' '.join(map(str, face))} 2 0.5 0.25" for face in FACES]
        return (HEADER.format(format=kind) + "\n".join([*lines, "0 1"]) + "\n").encode()
    order = "<" if "little" in kind else ">"
    body = b"".join(struct.pack(order + "fdhf", x, y, -7, z) for x, y, z in POINTS)
    for face in FACES:
        body += struct.pack(f"{order}BB{len(face)}iHff", 9, len(face), *face, 2, 0.5, 0.25)
    return HEADER.format(format=kind).encode() + body + struct.pack(order + "ii", 0, 1)


def load(tmp_path: Path, data: bytes | str) -> tuple[list[tuple[float, ...]], list[list[int]]]:
    path = tmp_path / "m.ply"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    mesh = load_mesh(path)
    return [tuple(point) for point in mesh.vertices.tolist()], mesh.topology.face_lists()


KINDS = ("ascii", "binary_little_endian", "binary_big_endian")
kinds = pytest.mark.parametrize("kind", KINDS)


@kinds
def test_all_three_formats(tmp_path: Path, kind: str) -> None:
    assert load(tmp_path, by_hand(kind)) == (POINTS, FACES)


@kinds
@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
def test_line_ends_of_the_header(tmp_path: Path, kind: str, line_end: str) -> None:
    header, end, body = by_hand(kind).partition(b"end_header\n")
    data = (header + end).replace(b"\n", line_end.encode()) + body
    assert load(tmp_path, data) == (POINTS, FACES)


@kinds
def test_elements_in_another_order(tmp_path: Path, kind: str) -> None:
    """Faces first, under the older name of their property; equal sizes take the fast way."""
    header = (
        f"ply\nformat {kind} 1.0\nelement face 2\nproperty list uint8 uint32 vertex_index\n"
        "element nothing 7\nelement vertex 4\nproperty int8 z\nproperty uint16 y\nproperty float64 x\nend_header\n"
    )
    if kind == "ascii":
        body = b"3 0 1 2\n3 1 3 2\n0 0 0\n0 0 1\n0 1 0\n-5 1 1\n"
    else:
        order = "<" if "little" in kind else ">"
        body = struct.pack(order + "BIIIBIII", 3, 0, 1, 2, 3, 1, 3, 2)
        body += b"".join(struct.pack(order + "bHd", *p) for p in ((0, 0, 0), (0, 0, 1), (0, 1, 0), (-5, 1, 1)))
    assert load(tmp_path, header.encode() + body) == (
        [(0, 0, 0), (1, 0, 0), (0, 1, 0), (1, 1, -5)],
        [[0, 1, 2], [1, 3, 2]],
    )


@kinds
def test_every_truncation_is_noticed(tmp_path: Path, kind: str) -> None:
    """Whole lines of text, single bytes of binary files."""
    data = by_hand(kind)
    if kind == "ascii":
        lines = data.splitlines(keepends=True)
        prefixes = [b"".join(lines[:kept]) for kept in range(1, len(lines))]
    else:
        prefixes = [data[:kept] for kept in range(1, len(data))]
    for prefix in prefixes:
        with pytest.raises(MeshFileError):
            load(tmp_path, prefix)


@kinds
def test_what_follows_the_last_element(tmp_path: Path, kind: str) -> None:
    assert load(tmp_path, by_hand(kind) + b"\n\n") == (POINTS, FACES)
    assert load(tmp_path, by_hand(kind) + b"1 2\n") == (POINTS, FACES)
    notes = load_mesh(tmp_path / "m.ply").notes
    assert any("behind the last element" in note for note in notes)
    assert any("left out of the file: vertex quality, face flag, face texcoord, element edge" in note for note in notes)


@kinds
def test_triangle_strips(tmp_path: Path, kind: str) -> None:
    """Two strips in one row, the second with a vertex twice to change its side, and one in a row of its own."""
    rows = [[0, 1, 2, 3, -1, 2, 3, 3, 4], [0, 1, 4]]
    header = (
        f"ply\nformat {kind} 1.0\nelement vertex 5\nproperty float x\nproperty float y\nproperty float z\n"
        "element tristrips 2\nproperty list int int vertex_indices\nend_header\n"
    )
    if kind == "ascii":
        body = "".join(f"{x} {y} {z}\n" for x, y, z in POINTS) + "".join(
            f"{len(r)} {' '.join(map(str, r))}\n" for r in rows
        )
        data = (header + body).encode()
    else:
        order = "<" if "little" in kind else ">"
        data = header.encode() + b"".join(struct.pack(order + "fff", *point) for point in POINTS)
        data += b"".join(struct.pack(f"{order}{len(row) + 1}i", len(row), *row) for row in rows)
    (tmp_path / "m.ply").write_bytes(data)
    raw = read_ply(tmp_path / "m.ply", data)
    assert raw.corners.reshape(-1, 3).tolist() == [[0, 1, 2], [1, 3, 2], [0, 1, 4]]


@pytest.mark.parametrize("order", ["<", ">"])
def test_integers_of_64_bits(tmp_path: Path, order: str) -> None:
    kind = "binary_little_endian" if order == "<" else "binary_big_endian"
    header = (
        f"ply\nformat {kind} 1.0\nelement vertex 5\nproperty double x\nproperty double y\nproperty double z\n"
        "element face 2\nproperty list uint64 int64 vertex_indices\nend_header\n"
    )
    data = header.encode() + b"".join(struct.pack(order + "ddd", *point) for point in POINTS)
    data += b"".join(struct.pack(f"{order}Q{len(face)}q", len(face), *face) for face in FACES)
    assert load(tmp_path, data) == (POINTS, FACES)


def test_rows_may_stand_on_any_lines(tmp_path: Path) -> None:
    header, end, body = by_hand("ascii").partition(b"end_header\n")
    words = body.split()
    for count in (1, 3, len(words)):
        lines = [b" ".join(words[i : i + count]) for i in range(0, len(words), count)]
        assert load(tmp_path, header + end + b"\n".join(lines) + b"\n") == (POINTS, FACES)
    with pytest.raises(MeshFileError, match="ends within"):
        load(tmp_path, header + end + b" ".join(words[:-1]))


def test_rows_on_any_lines_may_end_with_an_empty_list(tmp_path: Path) -> None:
    """The line of such a face is that of its length, behind which nothing stands."""
    header = "".join(f"property float {axis}\n" for axis in "xyz")
    header = f"ply\nformat ascii 1.0\nelement vertex 3\n{header}element face 2\nproperty list uchar int vertex_index\n"
    with pytest.raises(MeshFileError, match=r"face 1 has 0 corner\(s\)") as caught:
        load(tmp_path, header + "end_header\n0 0 0 1 0 0\n0 1 0\n3 0 1 2\n0\n")
    assert caught.value.line == 13


def test_what_trimesh_writes(tmp_path: Path) -> None:
    import trimesh

    vertices, topology = wavy_grid(triangles=True)
    mesh = trimesh.Trimesh(vertices.numpy(), topology.triangles.numpy(), process=False)
    for encoding in ("ascii", "binary"):
        (tmp_path / "m.ply").write_bytes(mesh.export(file_type="ply", encoding=encoding))
        read = load_mesh(tmp_path / "m.ply")
        assert torch.allclose(read.vertices, vertices, atol=1e-6)
        assert torch.equal(read.topology.corners, topology.corners)


@pytest.mark.parametrize("binary", [False, True])
def test_what_trimesh_reads(tmp_path: Path, binary: bool) -> None:
    import trimesh

    vertices, topology = wavy_grid(triangles=True)
    save_mesh(tmp_path / "m.ply", vertices, topology, binary=binary)
    mesh: Any = trimesh.load(tmp_path / "m.ply", process=False)
    assert np.array_equal(mesh.vertices, vertices.numpy())
    assert np.array_equal(mesh.faces, topology.triangles.numpy())


def changed(old: str, new: str, kind: str = "ascii") -> bytes:
    data = by_hand(kind)
    assert old.encode() in data
    return data.replace(old.encode(), new.encode(), 1)


LITTLE = "binary_little_endian"
FAULTS = [
    (b"plyx\n", 1, "expected 'ply' alone"),
    (b"ply", 1, "expected 'ply' alone"),
    (b"ply\nformat ascii 1.0\n", 3, "no end_header"),
    (b"ply\nend_header\n", 2, "no format line"),
    (b"ply\nelement vertex 3\nend_header\n", 2, "expected the format line"),
    (changed("ascii 1.0", "ascii 2.0"), 2, "expected 'format ascii"),
    (changed("format ascii 1.0", "format"), 2, "expected 'format ascii"),
    (changed("comment", "comet"), 3, "no statement of a PLY header"),
    (changed("vertex 5", "verte\0 5"), 5, r"'element verte\\x00 5' is no text"),
    (changed("vertex 5", "vertex five"), 5, "no statement"),
    (changed("vertex 5", "vertex -5"), 5, "no statement"),
    (changed("vertex 5", "vertex " + "9" * 30), 5, "no statement"),
    (changed("float x", "huge x"), 6, "no property with known types"),
    (changed("list uchar int", "list float int"), 12, "no property with known types"),
    (changed("element edge", "element face"), 14, "a second element 'face'"),
    (changed("property float x", "property float u"), 17, "element 'vertex' has no number 'x'"),
    (changed("property float x", "property list uchar float x"), 17, "has no number 'x'"),
    (changed("vertex_indices", "corners"), 17, "element 'face' has no list of whole numbers 'vertex_indices'"),
    (changed("uchar int vertex", "uchar float vertex"), 17, "has no list of whole numbers"),
    (changed("element face 2", "element strips 2"), 17, r"no element 'face' \(elements: vertex, strips, edge\)"),
    (
        changed("vertex 5", "vertex 900000000000000000"),
        25,
        "ends within the 900000000000000000 rows of element 'vertex'",
    ),
    (changed("vertex 5", "vertex 4"), 22, "whole number .* got '2.0'"),
    (changed("1.0 0.0 -7 0.0", "1.0 0.0 -7"), 19, r"3 number\(s\) do not fit the properties of element 'vertex'"),
    (changed("1.0 0.0 -7 0.0", "1.0 zero -7 0.0"), 19, "expected a number, got 'zero'"),
    (changed("1.0 0.0 -7 0.0", "1.0 nan -7 0.0"), 19, "vertex 1 .* not finite"),
    (changed("9 4 0 1 2 3", "9 4 0 1 2 7"), 23, "face 0 uses vertex 7"),
    (changed("9 4 0 1 2 3", "9 4 0 1 2 2.5"), 23, "whole number .* got '2.5'"),
    (changed("9 4 0 1 2 3", "9 400 0 1 2 3"), 23, "do not fit"),
    (changed("9 4 0 1 2 3", "9 -4 0 1 2 3"), 23, "do not fit"),
    (changed("9 4 0 1 2 3 2", "9 2 0 1 2"), 23, r"face 0 has 2 corner\(s\)"),
    (changed("0.5 0.25\n0 1\n", "0.5 0.25\n0 \x001\n"), 25, "binary data"),
    (changed("vertex 5", "vertex 900000000000000000", LITTLE), None, "ends within vertex"),
    (changed("vertex 5", "vertex 6", LITTLE), None, "ends within face 1 of 2"),
    (changed("face 2", "face 900000000", LITTLE), None, "ends within face 4 of 900000000"),
    (
        changed("list uchar int", "list char int", LITTLE).replace(b"\x09\x03", b"\x09\x83"),
        None,
        "negative length -125",
    ),
    (by_hand(LITTLE).replace(struct.pack("<i", 3), struct.pack("<i", 8), 1), None, "face 0 uses vertex 8"),
    (by_hand(LITTLE).replace(struct.pack("<f", 2), struct.pack("<f", np.nan), 1), None, "vertex 4 .* not finite"),
]


@pytest.mark.parametrize(("data", "line", "message"), FAULTS, ids=range(len(FAULTS)))
def test_faults_have_lines(tmp_path: Path, data: bytes, line: int | None, message: str) -> None:
    with pytest.raises(MeshFileError, match=message) as caught:
        load(tmp_path, data)
    assert caught.value.line == line


def test_mixed_sizes_in_binary(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    faces, first = [], 0
    for size in rng.integers(3, 9, 50).tolist():
        faces.append(list(range(first, first + size)))
        first += size
    vertices = torch.from_numpy(rng.normal(size=(first, 3)))
    save_mesh(tmp_path / "m.ply", vertices, Topology.from_faces(faces), binary=True)
    mesh = load_mesh(tmp_path / "m.ply")
    assert mesh.topology.face_lists() == faces
    assert torch.equal(mesh.vertices, vertices)
