"""Whatever is in a file, and wherever it lies: a mesh or a MeshFileError, nothing else."""

from __future__ import annotations

import bz2
import gzip
import logging
import lzma
import os
import zipfile
from pathlib import Path

import pytest
import torch
from helpers import wavy_grid
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from torchfair import MeshFileError, ShapeError, Topology
from torchfair.io import PolygonMesh, load_mesh, save_mesh

SUFFIXES = (".obj", ".off", ".ply")
EXAMPLES = 80
suffixes = pytest.mark.parametrize("suffix", SUFFIXES)
fuzz = settings(max_examples=EXAMPLES, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def try_to_load(path: Path, data: bytes) -> PolygonMesh | None:
    """The mesh, or None after a proper error."""
    path.write_bytes(data)
    try:
        mesh = load_mesh(path)
    except MeshFileError as error:
        fault = error
    else:
        assert mesh.vertices.isfinite().all()
        assert mesh.topology.num_faces > 0
        return mesh
    assert fault.path == path
    assert fault.line is None or 1 <= fault.line <= len(data.splitlines()) + 1
    assert str(fault).startswith(str(path))
    assert str(fault).isprintable()
    return None


@pytest.fixture(scope="module")
def valid(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[str, bytes]]:
    """A triangle mesh and a mixed mesh in every format."""
    points, grid = wavy_grid(3, 3)
    mixed = Topology.from_faces([face[:3] if i == 1 else face for i, face in enumerate(grid.face_lists())], 9)
    folder = tmp_path_factory.mktemp("valid")
    files = []
    for topology in (wavy_grid(3, 3, triangles=True)[1], mixed):
        for suffix, binary in ((".obj", False), (".off", False), (".ply", False), (".ply", True)):
            save_mesh(folder / f"m{suffix}", points, topology, overwrite=True, binary=binary)
            files.append((suffix, (folder / f"m{suffix}").read_bytes()))
    return files


# ---- where the file lies -----------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", [*SUFFIXES, ".stl", ".glb"])
def test_missing_empty_and_folders(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"m{suffix}"
    with pytest.raises(MeshFileError, match="does not exist"):
        load_mesh(path)
    with pytest.raises(MeshFileError, match="does not exist"):
        load_mesh(str(tmp_path / "folder" / path.name))
    for nothing in (b"", b" \r\n\t\n"):
        path.write_bytes(nothing)
        with pytest.raises(MeshFileError, match="is empty") as caught:
            load_mesh(path)
        assert caught.value.line == 1
    path.unlink()
    path.mkdir()
    with pytest.raises(MeshFileError, match="is a folder"):
        load_mesh(path)


@pytest.mark.parametrize("name", ["mesh.txt", "mesh", "mesh.obj.gz", ".obj", "mesh.", "mesh.objx"])
def test_unknown_extensions(tmp_path: Path, name: str) -> None:
    (tmp_path / name).write_text("v 0 0 0")
    with pytest.raises(MeshFileError, match=r"no known mesh format. Known are \.obj, \.off, \.ply, \.stl"):
        load_mesh(tmp_path / name)


def test_files_that_may_not_be_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = tmp_path / "m.obj"
    path.write_text("v 0 0 0")

    def refuse(self: Path, *_how: object, **_named: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(MeshFileError, match=r"cannot be read \(Permission denied\)"):
        load_mesh(path)


def test_unusable_names(tmp_path: Path) -> None:
    with pytest.raises(MeshFileError):
        load_mesh(tmp_path / "a\0b.obj")
    with pytest.raises(MeshFileError):
        load_mesh(tmp_path / ("a" * 300 + ".obj"))


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="named pipes are a matter of POSIX systems")
def test_pipes_are_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "m.obj")
    with pytest.raises(MeshFileError, match="not a regular file"):
        load_mesh(tmp_path / "m.obj")


# ---- what is in it -----------------------------------------------------------------------------------------


@suffixes
def test_compressed_files(tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"m{suffix}"
    for compress, name in ((gzip.compress, "gzip"), (bz2.compress, "bzip2"), (lzma.compress, "xz")):
        path.write_bytes(compress(b"v 0 0 0\n" * 50))
        with pytest.raises(MeshFileError, match=f"compressed with {name}. Decompress it first"):
            load_mesh(path)
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("m.obj", "v 0 0 0")
    with pytest.raises(MeshFileError, match="compressed with zip"):
        load_mesh(path)


@suffixes
@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-32"])
def test_wide_characters(tmp_path: Path, valid: list[tuple[str, bytes]], suffix: str, encoding: str) -> None:
    text = dict(valid[:3])[suffix].decode()
    assert try_to_load(tmp_path / f"m{suffix}", text.encode()) is not None
    assert try_to_load(tmp_path / f"m{suffix}", text.encode(encoding)) is None


@suffixes
@fuzz
@given(data=st.binary(max_size=400))
def test_random_bytes(tmp_path: Path, suffix: str, data: bytes) -> None:
    assert try_to_load(tmp_path / f"m{suffix}", data) is None


STARTS = {
    ".obj": [b"v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", b""],
    ".off": [b"OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 0\n", b"OFF\n", b"COFF 1 "],
    ".ply": [
        b"ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n",
        b"ply\nformat binary_big_endian 1.0\nelement face 1\nproperty list uchar int vertex_index\nend_header\n",
        b"ply\nformat ",
    ],
}
NUMBERS = [b"1", b"2", b"3", b"-1", b"0", b"1/2", b"1e9", b"9" * 25, b"nan", b"1_0"]
WORDS = [b"v", b"f", b"property", b"list", b"uchar", b"int", b"double", b"element", b"face", b"vertex", b"end_header"]
PIECES = st.sampled_from([*NUMBERS, *WORDS, b"#", b"\\", b"x", b"\n", b"\0", b"\xff"])


@suffixes
@fuzz
@given(data=st.data())
def test_words_of_the_format_in_disorder(tmp_path: Path, suffix: str, data: st.DataObject) -> None:
    start = data.draw(st.sampled_from(STARTS[suffix]))
    pieces = data.draw(st.lists(PIECES, max_size=30))
    between = data.draw(st.sampled_from([b" ", b"\n", b" \r\n"]))
    try_to_load(tmp_path / f"m{suffix}", start + between.join(pieces))


@fuzz
@given(which=st.integers(0, 7), cut=st.floats(0, 1))
def test_truncated_files(tmp_path: Path, valid: list[tuple[str, bytes]], which: int, cut: float) -> None:
    suffix, data = valid[which]
    mesh = try_to_load(tmp_path / f"m{suffix}", data[: int(cut * len(data))])
    if cut < 0.9 and suffix != ".obj":  # an OBJ file does not say how much of it there is
        assert mesh is None


@fuzz
@given(which=st.integers(0, 7), flips=st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), min_size=1, max_size=4))
@example(which=3, flips=[(0.45, 255)])
def test_damaged_bytes(
    tmp_path: Path, valid: list[tuple[str, bytes]], which: int, flips: list[tuple[float, int]]
) -> None:
    suffix, data = valid[which]
    damaged = bytearray(data)
    for place, value in flips:
        damaged[int(place * (len(data) - 1))] = value
    try_to_load(tmp_path / f"m{suffix}", bytes(damaged))


@pytest.mark.parametrize("suffix", [".stl", ".glb", ".gltf", ".dae", ".3mf"])
@settings(max_examples=15, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(data=st.binary(min_size=1, max_size=200))
def test_random_bytes_for_trimesh(tmp_path: Path, suffix: str, data: bytes) -> None:
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    assert try_to_load(tmp_path / f"m{suffix}", data) is None


@suffixes
def test_nothing_is_allocated_by_what_a_header_claims(tmp_path: Path, suffix: str) -> None:
    headers = {
        ".obj": "v 0 0 0\nf 1 2 900000000000\n",
        ".off": "OFF\n2000000000 2000000000 0\n0 0 0\n",
        ".ply": "ply\nformat binary_little_endian 1.0\nelement vertex 2000000000\nproperty double x\n"
        "property double y\nproperty double z\nelement face 2000000000\n"
        "property list uint int vertex_indices\nend_header\n\xff\xff",
    }
    (tmp_path / f"m{suffix}").write_bytes(headers[suffix].encode("latin-1"))
    with pytest.raises(MeshFileError):
        load_mesh(tmp_path / f"m{suffix}")


def test_a_polygon_mesh_fits_together() -> None:
    with pytest.raises(ShapeError):
        PolygonMesh(torch.zeros(4, 3), Topology.from_faces([[0, 1, 2]]))
