"""What an OBJ file may say, and what it may not."""

from __future__ import annotations

import random
from pathlib import Path

import pytest
from helpers import wavy_grid
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from torchfair import MeshError, MeshFileError
from torchfair.io import load_mesh, save_mesh

SQUARE = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n"


def load(tmp_path: Path, text: str | bytes) -> tuple[list[list[float]], list[list[int]]]:
    path = tmp_path / "m.obj"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    mesh = load_mesh(path)
    return mesh.vertices.tolist(), mesh.topology.face_lists()


@pytest.mark.parametrize(
    "face",
    [
        "1 2 3 4",
        "1/1 2/2 3/3 4/4",
        "1//1 2//1 3//2 4//1",
        "1/1/1 2/2/1 3/3/1 4/4/1",
        "1/1 2 3//7 4/-1/-2",
        "-4 -3 -2 -1",
    ],
)
def test_forms_of_corners(tmp_path: Path, face: str) -> None:
    assert load(tmp_path, f"{SQUARE}f {face}\n")[1] == [[0, 1, 2, 3]]


@pytest.mark.parametrize("extra", ["", " 1.0", " 0.5 0.5 0.25", " 1 255 0 0"])
def test_weights_and_colours_are_ignored(tmp_path: Path, extra: str) -> None:
    text = "".join(line + extra + "\n" for line in SQUARE.splitlines())
    vertices, faces = load(tmp_path, text + "f 1 2 3 4\n")
    assert vertices == [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]
    assert faces == [[0, 1, 2, 3]]


def test_other_statements_are_skipped(tmp_path: Path) -> None:
    text = f"""# exported
mtllib some file.mtl
o a
{SQUARE}vt 0 0
vn 0 0 1
vp 0.5
g one two
usemtl v
s off
f 1 2 3 4 # the square
l 1 2 3
p 1
"""
    assert load(tmp_path, text)[1] == [[0, 1, 2, 3]]


def test_what_other_programs_write_is_passed_over(tmp_path: Path) -> None:
    """Materials in the file itself, old outlines, and the sign that ends files of old systems."""
    text = f"{SQUARE}newmtl C:\\glass\\\nKd 1 1 1\nmap_Kd a.png\nt 0 0\nf 1 2 3\nfo 1 3 4\n\x1a\0\xffv 1"
    assert load(tmp_path, text.encode("latin-1"))[1] == [[0, 1, 2], [0, 2, 3]]


def attributes_text(tmp_path: Path, text: str, **options: bool) -> list[str]:
    """A file read, and written back with what goes with its faces."""
    (tmp_path / "in.obj").write_text(text)
    mesh = load_mesh(tmp_path / "in.obj", **options)
    save_mesh(tmp_path / "out.obj", mesh.vertices, mesh.topology, attributes=mesh.attributes, overwrite=True)
    return [line for line in (tmp_path / "out.obj").read_text().splitlines() if not line.startswith("v ")]


def test_what_goes_with_faces_comes_back(tmp_path: Path) -> None:
    body = "vt 0 0\nvt 1 0 0\nvt .5 1\no part\ng a b\nf 1/1 2/2 3/3\nusemtl red\ns 1\nf 1/-3 3/-1 4\ng end\n"
    kept = [
        "vt 0 0",
        "vt 1 0 0",
        "vt .5 1",
        "o part",
        "g a b",
        "f 1/1 2/2 3/3",
        "usemtl red",
        "s 1",
        "f 1 3 4",
        "g end",
    ]
    assert attributes_text(tmp_path, SQUARE + body) == kept  # texture coordinates of whole faces alone are a face's
    twice = body.replace("f 1/1 2/2 3/3\n", "f 1/1 2/2 3/3\nf 2/2 3/3 1/1\nf 1 2 2\n")
    assert attributes_text(tmp_path, SQUARE + twice, repair=True) == kept


def test_corners_of_faces_that_are_turned_over_keep_their_texture(tmp_path: Path) -> None:
    text = f"{SQUARE}vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nf 1/1 2/2 3/3\nf 4/4 3/3 1/1\n"
    assert attributes_text(tmp_path, text, repair=True)[-2:] == ["f 1/1 2/2 3/3", "f 4/4 1/1 3/3"]


def test_attributes_of_another_mesh_are_refused(tmp_path: Path) -> None:
    (tmp_path / "in.obj").write_text(f"{SQUARE}vt 0 0\nf 1/1 2/1 3/1\n")
    mesh = load_mesh(tmp_path / "in.obj")
    vertices, topology = wavy_grid(3, 3)
    with pytest.raises(MeshError, match="attributes: they are those of a mesh with other"):
        save_mesh(tmp_path / "out.obj", vertices, topology, attributes=mesh.attributes)
    with pytest.raises(MeshFileError, match="not those of such a file"):
        save_mesh(tmp_path / "out.off", mesh.vertices, mesh.topology, attributes=mesh.attributes)


@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
@pytest.mark.parametrize("last", [True, False])
def test_line_ends(tmp_path: Path, line_end: str, last: bool) -> None:
    text = (SQUARE + "\n \t\n  f\t1 2  3 4 " + "\n" * last).replace("\n", line_end)
    assert load(tmp_path, text)[1] == [[0, 1, 2, 3]]


@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
def test_lines_are_counted_with_every_line_end(tmp_path: Path, line_end: str) -> None:
    text = (SQUARE + "\n\nf 1 2 3\nf 1 2 x\n").replace("\n", line_end)
    with pytest.raises(MeshFileError, match="'x'") as caught:
        load(tmp_path, text)
    assert caught.value.line == 8


def test_byte_order_mark_and_foreign_letters(tmp_path: Path) -> None:
    text = b"\xef\xbb\xbf# \xe4\xf6\xfc in Latin-1\no caf\xc3\xa9\n" + SQUARE.encode() + b"f 1 2 3 4\n"
    assert load(tmp_path, text)[1] == [[0, 1, 2, 3]]


def test_a_byte_order_mark_alone_is_no_mesh(tmp_path: Path) -> None:
    with pytest.raises(MeshFileError, match="no vertices"):
        load(tmp_path, b"\xef\xbb\xbf")


def test_continued_lines(tmp_path: Path) -> None:
    text = "v 0 \\\n0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nl 1 2 \\\n3\nf 1 2 \\ \n 3 \\\n4\nf 1 2 x"
    with pytest.raises(MeshFileError, match="'x'") as caught:
        load(tmp_path, text)
    assert caught.value.line == 11
    assert load(tmp_path, text.rpartition("\n")[0])[1] == [[0, 1, 2, 3]]
    assert load(tmp_path, text.rpartition("\n")[0] + " \\")[1] == [[0, 1, 2, 3]]


def test_a_backslash_behind_a_name_or_comment_continues_nothing(tmp_path: Path) -> None:
    text = "# C:\\models\\\no C:\\models\\\n" + SQUARE + "g C:\\\nf 1 2 3 4\n"
    vertices, faces = load(tmp_path, text)
    assert len(vertices) == 4
    assert faces == [[0, 1, 2, 3]]


def test_negative_numbers_count_from_where_they_stand(tmp_path: Path) -> None:
    text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf -3 -2 -1\nv 1 1 0\nf -1 -2 -3\nv 5 5 5\nf 4 2 5"
    assert load(tmp_path, text)[1] == [[0, 1, 2], [3, 2, 1], [3, 1, 4]]


def test_faces_may_stand_before_their_vertices(tmp_path: Path) -> None:
    assert load(tmp_path, "f 1 2 3 4\n" + SQUARE)[1] == [[0, 1, 2, 3]]


FAULTS = [
    ("v 0 0\n", 1, r"three coordinates, got 2"),
    ("v 0 0 0 1 1\n", 1, r"three coordinates, got 5"),
    ("\nv 0 0 zero\n", 2, r"expected a number, got 'zero'"),
    ("v 0 0 1_0\n", 1, r"expected a number, got '1_0'"),
    ("v 0 0 0\nv 1 1 1 red 0 0\n", 2, r"expected a number, got 'red'"),
    (SQUARE + "v 0 nan 0\nf 1 2 3\n", 5, r"vertex 5 has coordinates that are not finite numbers: 0\.0, nan, 0\.0"),
    (SQUARE + "v 0 1e999 0\nf 1 2 3\n", 5, "not finite"),
    (SQUARE + "f 1 2\n", 5, r"face 1 has 2 corner\(s\)"),
    (SQUARE + "vt 0 0\nf 1/1 2/2 3/1\n", 6, "names texture coordinates 2, but there are 1"),
    (SQUARE + "f\n", 5, r"face 1 has 0 corner\(s\)"),
    (SQUARE + "f 1 2 3\n\nf 1 2 5\n", 7, r"face 2 uses vertex 5, but the vertices are numbered 1\.\.4"),
    (SQUARE + "f 0 1 2\n", 5, "face 1 uses vertex 0"),
    (SQUARE + "f -1 -2 -5\n", 5, "face 1 uses vertex -5"),
    ("v 0 0 0\nv 1 0 0\nf -1 -2 -3\nv 0 1 0\n", 3, "face 1 uses vertex -3"),
    (SQUARE + "f 1 2 3.0\n", 5, "a whole number .* got '3.0'"),
    (SQUARE + "f 1 2 99999999999999999999\n", 5, "reasonable size, got '99999999999999999999'"),
    (SQUARE + "f 1 2 " + "9" * 6000 + "\n", 5, r"got '9{24}'\.\.\."),
    (SQUARE + "f 1/1 2/2 3/x\n", 5, "a face corner must look like .* got '3/x'"),
    (SQUARE + "f 1/1/1/1 2 3\n", 5, "a face corner must look like"),
    (SQUARE + "f 1 2 /3\n", 5, "whole number .* got ''"),
    (SQUARE + "w 1 2 3\nf 1 2 3\n", 5, "'w' does not start an OBJ statement"),
    (SQUARE + "f 1 2 3\nx\ny\n", 6, "'x' does not start"),
    (SQUARE, None, "the mesh has no faces"),
    ("f 1 2 3\n", None, "the mesh has no vertices"),
    ("# nothing\n", None, "no vertices"),
    (SQUARE + "f 1 2 3 3\n", 5, r"more than once: faces 1 \(line 5\)\. .*repair=True.* mends this"),
    (b"v 0 0 0\nv \x00", 2, "binary data"),
    ("v 0 0 0\n".encode("utf-16"), None, "UTF-16"),
    (b"v 0 0 \xff\n", 1, "expected a number"),
]


@pytest.mark.parametrize(("text", "line", "message"), FAULTS, ids=range(len(FAULTS)))
def test_faults_have_lines(tmp_path: Path, text: str | bytes, line: int | None, message: str) -> None:
    with pytest.raises(MeshFileError, match=message) as caught:
        load(tmp_path, text)
    assert caught.value.line == line
    assert str(tmp_path / "m.obj") in str(caught.value)


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1))
def test_the_way_of_writing_does_not_matter(tmp_path: Path, seed: int) -> None:
    """The same mesh with corners, line ends, comments and continued lines mixed at random."""
    choose = random.Random(seed)
    vertices, topology = wavy_grid(4, 4)
    lines: list[str] = []
    for point in vertices.tolist():
        lines.append(" ".join(["v", *map(repr, point), *choose.choice([[], ["1"], ["0.5", "1", "0"]])]))
        lines += choose.choice([[], ["vt 0 0"], ["# v 1 2 3"], ["", "o v"]])
    for face in topology.face_lists():
        behind = choose.choice(["", "/1", "//2", "/1/2"])
        numbers = [choose.choice([v + 1, v - topology.num_vertices]) for v in face]
        lines.append("f " + " ".join(f"{number}{behind}" for number in numbers))
        lines += choose.choice([[], ["l 1 2"], ["usemtl f"]])
    text = ""
    for line in lines:
        if line[:2] in ("v ", "f "):
            line = line.replace(" ", choose.choice([" ", "  ", "\t", " \\\n", "\\\r\n "])) + choose.choice(
                ["", " # 7", " "]
            )
        text += line + choose.choice(["\n", "\r\n", "\r"])
    assert load(tmp_path, text) == (vertices.tolist(), topology.face_lists())
