"""Curves in text files."""

from __future__ import annotations

from pathlib import Path

import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from torchfair.errors import MeshFileError
from torchfair.io import load_curve

NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
CORNERS = [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (-1.0, -1.0, 0.0)]


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.tuples(NUMBERS, NUMBERS, NUMBERS), st.floats(1e-300, 1e308), st.sampled_from(" ,;"))
def test_points_come_back_exactly(
    tmp_path: Path, normal: tuple[float, float, float], size: float, separator: str
) -> None:
    """Of any size; normals are whatever is written."""
    path = tmp_path / "curve.txt"
    rows = [(*(size * x for x in corner), *normal) for corner in CORNERS]
    path.write_text("".join(separator.join(map(repr, row)) + "\n" for row in rows))
    points, normals, notes = load_curve(path)
    expected = torch.tensor(rows, dtype=torch.float64)
    assert normals is not None
    assert points.equal(expected[:, :3])
    assert normals.equal(expected[:, 3:])
    assert notes == ()


def test_comments_headings_normals_and_a_repeated_end(tmp_path: Path) -> None:
    path = tmp_path / "curve.csv"
    path.write_text("# made by hand\nx,y,z,nx,ny,nz\n0,0,0,0,0,1\n1,0,0,0,0,1 # corner\n\n1,1,0,0,1,1\n0,0,0,0,0,1\n")
    points, normals, _ = load_curve(path)
    assert points.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
    assert normals is not None
    assert normals.tolist() == [[0, 0, 1], [0, 0, 1], [0, 1, 1]]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "empty"),
        (b"# nothing\n", "no numbers"),
        (b"0 0 0\n1 0\n", "line 2: expected three or six"),
        (b"1 2 3 4\n", "line 1"),
        (b"0 0 0\n1 x 0\n", "line 2"),
        (b"x y z\n\n0 0 0\n1 0 nan\n0 1 0\n", "line 4: expected finite numbers, got 1.0, 0.0, nan"),
        (b"0 0 0\n1 0 0\n0 1e400 0\n", "line 3: expected finite numbers"),
        (b"\x00\x01\x02", "binary"),
    ],
)
def test_bad_files_are_named_with_their_line(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "curve.xyz"
    path.write_bytes(content)
    with pytest.raises(MeshFileError, match=message) as error:
        load_curve(path)
    assert "curve.xyz" in str(error.value)


TRIANGLE = [[0.5, 0.0, 0.0], [1.5, 1.0, 0.0], [0.25, 2.0, -1.5]]


@pytest.mark.parametrize(
    "content",
    [
        "0,5;0,0;0,0\n1,5;1,0;0,0\n0,25;2;-1,5\n",
        "x;y;z\n0,5 ; 0,0 ; 0,0\n1,5 ; 1,0 ; 0,0\n0,25 ; 2 ; -1,5\n",
        "0,5 0,0 0,0\n1,5 1,0 0,0\n25,0e-2 2 -1,5\n",
        "0,5\t0,0\t0,0\n15e-1\t1,0\t0\n0,25\t2,0\t-1,5\n",
        "0.5,0.0,0.0\n1.5,1.0,0.0\n0.25,2,-1.5\n",
        "0.5, 0, 0\n1.5, 1, 0\n0.25, 2, -1.5\n",
        "0.5,0.0,0.0;\n1.5,1.0,0.0;\n0.25,2,-1.5;\n",
        "0.5;0.0;0.0\n1.5;1.0;0.0\n0.25;2;-1.5\n",
    ],
)
def test_decimal_commas_are_told_from_separators(tmp_path: Path, content: str) -> None:
    (tmp_path / "curve.csv").write_text(content)
    points, normals, _ = load_curve(tmp_path / "curve.csv")
    assert points.tolist() == TRIANGLE
    assert normals is None


def test_commas_between_whole_numbers_separate_them(tmp_path: Path) -> None:
    (tmp_path / "curve.csv").write_text("0,0,0 0,0,1\n1,0,0 0,0,1\n1,1,0 0,1,1\n")
    points, normals, _ = load_curve(tmp_path / "curve.csv")
    assert points.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0]]
    assert normals is not None
    assert normals.tolist() == [[0, 0, 1], [0, 0, 1], [0, 1, 1]]


@pytest.mark.parametrize("row", ["0.5;0,5;1", "1.234,5;0;0", "0.5 0,5", "0,5;1;x", "1.0;2,0;3,0"])
def test_commas_that_may_be_either_are_refused(tmp_path: Path, row: str) -> None:
    (tmp_path / "curve.csv").write_text(f"0;0;0\n{row}\n1;1;1\n")
    with pytest.raises(MeshFileError, match=r"line 2: .*not clear whether its comma is a decimal mark"):
        load_curve(tmp_path / "curve.csv")


def test_a_comma_in_a_line_of_one_word_separates(tmp_path: Path) -> None:
    (tmp_path / "curve.csv").write_text("0,0\n1 0 0\n")
    with pytest.raises(MeshFileError, match="found 2"):
        load_curve(tmp_path / "curve.csv")
