"""The quick way of reading text gives what the careful one gives, to the bit, or leaves the file to it."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from torchfair import MeshFileError
from torchfair.io import decimals, obj, ply, quick_ply, quick_rows
from torchfair.io.obj_attributes import ObjAttributes
from torchfair.io.ply_header import read_header
from torchfair.io.quick_rows import float_rows, int_rows, portions
from torchfair.io.raw_mesh import RawMesh
from torchfair.io.text import split_words

PATH = Path("folder/mesh.obj")
SQUARE = b"v 0 0 0\nv 1 0 0\nv 1 1 0.1\nv 0 1 1e-3\n"


def assert_same(one: RawMesh, other: RawMesh) -> None:
    for name in ("points", "corners", "offsets"):
        ours, theirs = getattr(one, name), getattr(other, name)
        assert ours.dtype == theirs.dtype
        assert np.array_equal(ours.view(np.int64), theirs.view(np.int64)), name  # signs of zeros, too
    assert (one.names.first, one.notes) == (other.names.first, other.notes)
    assert one.names.line(0) == other.names.line(0)
    ours, theirs = one.attributes, other.attributes
    assert isinstance(ours, ObjAttributes)
    assert isinstance(theirs, ObjAttributes)
    assert (ours.statements, ours.behind, ours.textures) == (theirs.statements, theirs.behind, theirs.textures)
    assert np.array_equal(ours.corner_textures, theirs.corner_textures)
    assert list(ours.dropped.items()) == list(theirs.dropped.items())


@pytest.mark.parametrize(
    "text",
    [
        SQUARE + b"f 1 2 3 4\n",
        SQUARE + b"f 1 2 3\nf 1 3 4",
        b"# by hand\n\n" + SQUARE.replace(b"\n", b"\r\n") + b"f 1 2 3\r\nf -4 -2 -1\r\n",
        SQUARE
        + b"vt 0 0\nvt 1 1\nvn 0 0 1\no a\ng one two\nusemtl red\nf 1/1/1 2/2/1 3/2/1\ns off\nf 1/1/1 3/-2/1 4/-1/1\n",
        SQUARE + b"vt 0 0\nvt 1 1\nf 1/1 2/2 3/2 4/1\n",
        SQUARE + b"vn 0 0 1\nf 1//1 2//1 3//1\nf 1//1 3//1 4//1\n",
        b"\xef\xbb\xbfg a\nv 0 0 0\nv 1 0 0\nf -2 -1 3\nv 0 1 0\nmtllib C:\\glass.mtl\nf 1 3 4\nv 1 1 1\n# end",
        b"v  0   0\t0 \nv 1 0 0\n" + SQUARE + b"f 1  3 4\nl 1 2\nf 1 2 5 6 3\n",
    ],
)
def test_usual_files_go_the_quick_way(text: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    """Also where a portion ends after any line."""
    careful = obj._careful_mesh(PATH, text)
    for size in (1 << 20, 1, 40):
        monkeypatch.setattr(quick_rows, "PORTION", size)
        quick = obj._quick_mesh(PATH, text)
        assert quick is not None
        assert_same(quick, careful)


UNUSUAL = [
    b"f 1/ 2/ 3/ 4/ 2/ 3/\n", b"v 1-2 3 4\nv 1-2 3 4\nv 1-2 3 4\n",
    b"v 1-2 3 4\nv 1 2\n", b"v 1e 2 3\n", b"v 1_0 2 3\n", b"v 0x1 2 3\n", b"v nan 2 3\n", b"v - 2 3\n",
    b"v 1.2.3 4 5\n", b"v 1 2 3 4\n", b"v 1 2 3 .5 .5 .5\n", b"v\t1 2 3\n", b" v 1 2 3\n",
    b"f 1/ 2/ 3/ 4/\n", b"f 1/1/ 2/1/ 3/1/\n",
    b"f 1/1/1/1 2 3\n", b"f /1 /2 /3\n", b"f 1 2/1 3\n", b"f 1 2 +3\n", b"f 1 2 3 # x\n", b"f 1 2 0\n", b"f 1 2 9\n",
    b"f 1 2 -9\n", b"f 1 2\n", b"f\n", b"f 1 2 3\\\n4\n", b"f 1 2 99999999999999999999\n", b"f 1 2 3.0\n",
    b"fo 1 2 3\n", b"vertex 1 2 3\n", b"v 1 2 3\rv 1 2 3\n", b"v 1 2 1e999\n", b"\x1av", b"\0", b"f 1/0 2/0 3/0\n",
    b"vt a\nf 1/1 2/1 3/1\n", b"vt 1\nf 1/2 2/2 3/2\n", b"vt 1\nf 1/1 2/1 3/1\nf 1 2 3\n",
    b"f 1-2 3\n", b"f - 2 3\n", b"f 1-2/3 2/1 3\n", b"f 1-2 - 3\n", b"vn 0 0 1 \\ # c\nv 1 2 3\n", 
    b"s 1 \\# c\nf 1 3 4\n", b"\xef\xbb\xbfg a\n", b"\xef\xbb\xbf# two files in one\n",
]  # fmt: skip


@pytest.mark.parametrize("line", UNUSUAL)
def test_what_is_unusual_is_left_to_the_careful_way(line: bytes) -> None:
    """Errors name what the careful way finds, and nothing that it refuses is read."""
    for text in (SQUARE + line + b"f 1 2 3\n", SQUARE + b"f 1 2 3\n" + line, b"vt 0 0\n" * 4 + SQUARE + line):
        quick = obj._quick_mesh(PATH, text)
        if quick is None:
            continue
        assert_same(quick, obj._careful_mesh(PATH, text))


def test_a_second_byte_order_mark_is_an_error() -> None:
    """As where two files are put together."""
    mark = b"\xef\xbb\xbf"
    with pytest.raises(MeshFileError, match=r"line 6: '.ufeffg' does not start"):
        obj.read_obj(PATH, mark + SQUARE + b"f 1 2 3\n" + mark + b"g a\nf 1 3 4\n")


words = st.sampled_from(
    [b"v", b"f", b"vt", b"vn", b"g", b"#", b"1", b"2", b"3", b"-1", b"1/1", b"2//1", b"3/1/1", b"-1/-1", b"0.1", b"1e5",
     b"-", b"1-2", b"+.5", b"5.", b"\\", b"1/", b"x"]
)  # fmt: skip
blanks = st.sampled_from([b" ", b" ", b" ", b"\n", b"\n", b"\r\n", b"\t", b"  ", b""])


@pytest.fixture(scope="module", params=[0, 1 << 30], ids=["many", "few"], autouse=True)
def reader_of_digits(request: pytest.FixtureRequest) -> Iterator[None]:
    """Every test with the reader of many numbers and with that of few."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(decimals, "FEW", request.param)
        yield


@settings(deadline=None, max_examples=300)
@given(st.lists(st.tuples(words, blanks), max_size=40), st.integers(1, 200))
@example([(b"f", b" "), (b"1/1", b" "), (b"2//1", b" "), (b"3", b"\n")], 7)
def test_any_text(parts: list[tuple[bytes, bytes]], size: int) -> None:
    text = SQUARE + b"f 1 2 3\n" + b"".join(word + blank for word, blank in parts)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(quick_rows, "PORTION", size)
        quick = obj._quick_mesh(PATH, text)
    if quick is not None:
        assert_same(quick, obj._careful_mesh(PATH, text))


@settings(deadline=None, max_examples=200)
@given(st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=3, max_size=30), st.integers(1, 25))
@example([5e-324, -0.0, 1.7976931348623157e308, 2.2250738585072011e-308, 0.1, 9007199254740993.0], 17)
def test_digits_are_rounded_as_python_does(values: list[float], digits: int) -> None:
    """In the shortest form and in any number of digits."""
    for written in ([repr(v) for v in values], [f"{v:.{digits}e}" for v in values]):
        (text,) = portions(" ".join(written).encode())
        rows = float_rows(text)
        assert rows is not None
        assert np.array_equal(rows[0].view(np.int64), np.array(list(map(float, written))).view(np.int64))
        assert rows[1].tolist() == [len(values)]


@settings(deadline=None, max_examples=1500)
@given(
    st.lists(st.text("0123456789+-.eE", min_size=1, max_size=7), min_size=1, max_size=5),
    st.sampled_from([" ", "\n", " \t ", "\r\n", "\x0b", "\x1f", "\xa0"]),
)
@example(["+1", "-0", "+.5", "1.e5", "-.5E-3"], " ")
@example(["1e", "1"], " ")
@example(["1", "2-3"], " ")
@example(["1.2e3.4", "1"], " ")
@example(["1e2e3", "1", "1"], "\n")
@example(["1.2.3", "1", "1"], "\n")
@example(["1.5e3", "-2.5", ".5e-1"], " ")
@example(["1e2.5", "3.5"], " ")
@example(["1.5e2e3", "3.5"], " ")
@example(["1.5", "2e3.5", "3.5e1"], "\n")
@example(["1.5e1", "2", "3.5e1"], "\n")
def test_words_are_what_python_takes_for_numbers(words: list[str], blank: str) -> None:
    """Or at least none of them is anything else."""
    (text,) = portions(blank.join(words).encode("latin1") + b"\n")
    rows = float_rows(text)
    try:
        expected = [float(word) for word in text.codes.tobytes().split()]
    except ValueError:
        assert rows is None
        return
    if rows is None:
        assert ord(blank[0]) not in b" \t\r\n"
    else:
        assert np.array_equal(rows[0].view(np.int64), np.array(expected).view(np.int64))


@pytest.mark.parametrize("text", [b"1-2 3 .", b"1-2 1e 3", b"1-2 1-2 .", b"1 2 -", b"."])
def test_numbers_that_end_early_are_none(text: bytes) -> None:
    """Also where numpy only warns, and as many numbers come out as there are words."""
    (portion,) = portions(text)
    assert float_rows(portion) is None


def test_words_are_counted_line_by_line() -> None:
    (text,) = portions(b"1 2\n\n 3\n4 5 6\n")
    rows = int_rows(text)
    assert rows is not None
    assert (rows[0].tolist(), rows[1].tolist()) == ([1, 2, 3, 4, 5, 6], [2, 0, 1, 3])


def ply_text(vertices: bytes, faces: bytes, counts: tuple[int, int], more: str = "") -> bytes:
    header = (
        f"ply\nformat ascii 1.0\nelement vertex {counts[0]}\nproperty double x\nproperty double y\nproperty double z\n"
    )
    header += f"{more}element face {counts[1]}\nproperty list uchar int vertex_indices\nend_header\n"
    return header.encode() + vertices + faces


ROWS = b"0 0 0\n1 0 0\n1 1 0.1\n0 1 1e-3\n"


@pytest.mark.parametrize("size", [1 << 20, 1, 9])
@pytest.mark.parametrize(
    "faces",
    [b"4 0 1 2 3\n3 0 1 2", b"3 0 1 2\r\n4 3 2 1 0\r\n", b"4 0 1 2 3\n3 0 1 2\n5 0 1 2 3 0\n", b"3 0 1 2 \n" * 9],
)
def test_text_of_ply_goes_the_quick_way(size: int, faces: bytes, monkeypatch: pytest.MonkeyPatch) -> None:
    data = ply_text(ROWS, faces, (4, len(faces.splitlines())))
    header = read_header(PATH, data)
    wanted = {"vertex": [2, 0], "face": [0]}
    text = split_words(data[header.body_start :], header.num_lines + 1)
    careful, careful_lines, notes = ply._read_lines(PATH, text, header, wanted)
    monkeypatch.setattr(quick_rows, "PORTION", size)
    quick = quick_ply.quick_body(data, header, wanted)
    assert quick is not None
    assert not notes
    for name in ("vertex", "face"):
        assert quick[1][name].tolist() == careful_lines[name].tolist()
        for ours, theirs in zip(quick[0][name], careful[name], strict=True):
            assert [part.tolist() for part in ours] == [part.tolist() for part in theirs]


@pytest.mark.parametrize(
    "data",
    [
        ply_text(ROWS, b"3 0 1 2\n", (4, 2)),
        ply_text(ROWS, b"3 0 1 2\n3 0 1 2\n3 0 1 3\n", (4, 2)),
        ply_text(ROWS, b"4 0 1 2\n3 0 1 2 3\n", (4, 2)),
        ply_text(ROWS, b"3 0 1 2\n\n", (4, 2)),
        ply_text(ROWS.replace(b"1 1", b"1-1"), b"3 0 1 2\n", (4, 1)),
        ply_text(ROWS.replace(b"\n1 1", b" 1\n1"), b"3 0 1 2\n", (4, 1)),
        ply_text(ROWS.replace(b"0.1", b"0.1 7"), b"3 0 1 2\n", (4, 1)),
        ply_text(ROWS, b"3 0 1 2.0\n", (4, 1)),
        ply_text(ROWS, b"3 0 1 -\n", (4, 1)),
        ply_text(ROWS, b"3 0 1-2 - 3\n4 0 1 2 3\n", (4, 2)),
        ply_text(ROWS, b"", (4, 0)),
        ply_text(ROWS, b"3 0 1 2\n", (4, 1), "element edge 0\nproperty int a\n"),
    ],
)
def test_unusual_text_of_ply_is_left_to_the_careful_way(data: bytes) -> None:
    header = read_header(PATH, data)
    assert quick_ply.quick_body(data, header, {"vertex": [0, 1, 2], "face": [0]}) is None


def test_the_line_of_a_fault_is_named_in_a_long_file(tmp_path: Path) -> None:
    """In the last portion as in the first."""
    path = tmp_path / "m.obj"
    body = b"v 0.25 0.5 0.75\n" * 3 + b"f 1 2 3\n" * (quick_rows.PORTION // 4)
    for line, count in ((b"v 1 2 x\n", 0), (b"f 1 2 9\n", 1)):
        path.write_bytes(body + line)
        with pytest.raises(MeshFileError) as caught:
            obj.read_obj(path, path.read_bytes())
        assert caught.value.line == body.count(b"\n") + 1, count
