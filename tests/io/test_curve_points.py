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
        (b"# nothing\n", "no points"),
        (b"0 0 0\n1 0\n", "line 2: expected three or six"),
        (b"1 2 3 4\n", "line 1"),
        (b"0 0 0\n1 x 0\n", "line 2"),
        (b"\x00\x01\x02", "binary"),
    ],
)
def test_bad_files_are_named_with_their_line(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "curve.xyz"
    path.write_bytes(content)
    with pytest.raises(MeshFileError, match=message) as error:
        load_curve(path)
    assert "curve.xyz" in str(error.value)
