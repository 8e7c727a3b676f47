"""What an OFF file may say, and what it may not."""

from __future__ import annotations

from pathlib import Path

import pytest

from torchfair import MeshFileError
from torchfair.io import load_mesh

POINTS = ["0 0 0", "1 0 0", "1 1 0", "0 1 0.5"]
HYBRID = ["3 0 1 2", "3 0 2 3"]


def load(tmp_path: Path, text: str) -> tuple[list[list[float]], list[list[int]]]:
    path = tmp_path / "m.off"
    path.write_text(text, encoding="latin-1", newline="")
    mesh = load_mesh(path)
    return mesh.vertices.tolist(), mesh.topology.face_lists()


def document(header: str = "OFF\n4 2 0", points: list[str] = POINTS, faces: list[str] = HYBRID) -> str:
    return "\n".join([header, *points, *faces]) + "\n"


EXPECTED = ([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0.5]], [[0, 1, 2], [0, 2, 3]])


@pytest.mark.parametrize(
    "header",
    [
        "OFF\n4 2 0",
        "OFF 4 2 0",
        "OFF\n4 2",
        "# a comment first\n\nOFF # keyword\n# counts\n4 2 5 # the last is ignored",
        "OFF\r\n4 2 0",
    ],
)
def test_headers(tmp_path: Path, header: str) -> None:
    assert load(tmp_path, document(header)) == EXPECTED


@pytest.mark.parametrize(
    "text",
    [
        "OFF 4 2 0 0 0 0 1 0 0 1 1 0 0 1 0.5 3 0 1 2 3 0 2 3",
        "OFF\n4\n2\n0\n" + "\n".join(POINTS) + "\n3 0 1 2 3 0 2 3",
        "OFF 4 2 5 # counts\n0 0 0 1 0 0\n1 1 0 0 1 0.5\n3\n0 1 2\n3\n0 2 3\n",
        "4 2 0\n" + "\n".join([*POINTS, *HYBRID]),
        "4 2\n" + "\n".join([*POINTS, *HYBRID]),
        "COFF 4 2 0\n" + " ".join(f"{point} 1 0 0 1" for point in POINTS) + "\n" + " ".join(HYBRID),
        "COFF 4 2 0\n" + " ".join(f"{point} 255 0 0" for point in POINTS) + "\n" + " ".join(HYBRID),
    ],
)
def test_numbers_may_stand_on_any_lines(tmp_path: Path, text: str) -> None:
    assert load(tmp_path, text) == EXPECTED


def test_faults_in_free_format_have_lines(tmp_path: Path) -> None:
    with pytest.raises(MeshFileError, match="face 1 uses vertex 7") as caught:
        load(tmp_path, "OFF 4 2 0\n0 0 0 1 0 0\n1 1 0 0 1 0.5\n3\n0 1 2\n3\n0 2 7\n")
    assert caught.value.line == 6


@pytest.mark.parametrize(
    ("keyword", "extra"),
    [
        ("COFF", " 255 0 0 255"),
        ("NOFF", " 0 0 1"),
        ("CNOFF", " 0 0 1 1 1 1 1"),
        ("STOFF", " 0.5 0.5"),
        ("OFF", " 1 2 3"),
    ],
)
def test_extra_numbers_of_vertices_are_skipped(tmp_path: Path, keyword: str, extra: str) -> None:
    assert load(tmp_path, document(f"{keyword}\n4 2 0", [point + extra for point in POINTS])) == EXPECTED


@pytest.mark.parametrize("colour", [" 3", " 255 0 0", " 0.1 0.2 0.3 1.0", "   # red"])
def test_colours_of_faces_are_skipped(tmp_path: Path, colour: str) -> None:
    assert load(tmp_path, document(faces=[HYBRID[0] + colour, HYBRID[1]])) == EXPECTED


def test_comments_and_blank_lines(tmp_path: Path) -> None:
    text = document().replace("\n", " # so\n\n#more\n  \n")
    assert load(tmp_path, text) == EXPECTED


FAULTS = [
    ("4OFF\n4 2 0\n", 1, "first word, got '4OFF'"),
    ("nOFF\n3\n", 1, "first word"),
    ("off\n", 1, "first word"),
    ("# only a comment\n", 1, "first word, got ''"),
    ("OFF\n", 1, "expected the numbers of vertices"),
    ("OFF BINARY\n4 2 0\n", 1, "got 'BINARY'"),
    ("OFF\n4\n", 2, "expected the numbers of vertices, faces and edges, got '4'"),
    ("OFF\n4 2 0 0\n", 2, "expected the numbers"),
    ("OFF\n4 two 0\n", 2, "whole number .* got 'two'"),
    ("OFF\n-4 2 0\n", 2, "negative counts"),
    ("OFF\n9000000000000000000 2 0\n0 0 0\n", 3, "promises 9000000000000000000 vertices and 2 faces, but 1 lines"),
    ("OFF\n90000000000000000000000 2 0\n", 2, "reasonable size"),
    ("OFF\n4 2 0\n", 2, "but 0 lines follow"),
    (document(faces=HYBRID[:1]), 7, "promises 4 vertices and 2 faces, but 5 lines"),
    (document() + "3 0 1 2\n", 9, "but 7 lines"),
    (document(points=["0 0 0", "1 0", "1 1 0", "0 1 0"]), 4, "expected 3, as on the first one, numbers"),
    (document(points=["0 0", "1 0", "1 1", "0 1"]), 3, "expected at least 3 numbers in a vertex line, got 2"),
    (document(points=["0 0 0", "1 0 q", "1 1 0", "0 1 0"]), 4, "expected a number, got 'q'"),
    (document(points=["0 0 0", "1 0 inf", "1 1 0", "0 1 0"]), 4, "vertex 1 .* not finite"),
    (document("COFF\n4 2 0", [point + " red" for point in POINTS]), 3, "expected a number, got 'red'"),
    (document(faces=["3 0 1 2", "3 0 2 4"]), 8, r"face 1 uses vertex 4, but the vertices are numbered 0\.\.3"),
    (document(faces=["3 0 1 2", "3 0 2 -1"]), 8, "face 1 uses vertex -1"),
    (document(faces=["3 0 1 2", "3 0 2"]), 8, "a face of 3 corners cannot have 2 numbers"),
    (document(faces=["3 0 1 2", "3 0 2 3 1 1"]), 8, "a face of 3 corners cannot have 5 numbers"),
    (document(faces=["3 0 1 2", "2 0 2"]), 8, r"face 1 has 2 corner\(s\)"),
    (document(faces=["3 0 1 2", "0"]), 8, r"face 1 has 0 corner\(s\)"),
    (document(faces=["3 0 1 2", "-1"]), 8, "a face of -1 corners"),
    (document(faces=["3 0 1 2", "9223372036854775807 1 2 3"]), 8, "cannot have 3 numbers"),
    (document(faces=["3 0 1 2", "3 0 2 3 0 0 blue"]), 8, "expected a number, got 'blue'"),
    (document(faces=["3 0 1 2", "3 0 2 1.0"]), 8, "whole number .* got '1.0'"),
    ("OFF\n4 0 0\n" + "\n".join(POINTS), None, "the mesh has no faces"),
    ("OFF\n0 0 0\n", None, "the mesh has no vertices"),
    (document(faces=["3 0 1 2", "3 0 1 3"]), 7, r"faces 0 \(line 7\) and 1 \(line 8\) along edge \(0, 1\)"),
]


@pytest.mark.parametrize(("text", "line", "message"), FAULTS, ids=range(len(FAULTS)))
def test_faults_have_lines(tmp_path: Path, text: str, line: int | None, message: str) -> None:
    with pytest.raises(MeshFileError, match=message) as caught:
        load(tmp_path, text)
    assert caught.value.line == line


def test_every_truncation_by_lines_is_noticed(tmp_path: Path) -> None:
    lines = document().splitlines(keepends=True)
    for kept in range(1, len(lines)):
        with pytest.raises(MeshFileError):
            load(tmp_path, "".join(lines[:kept]))
