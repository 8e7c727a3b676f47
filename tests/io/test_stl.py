"""What an STL file may say, and what it may not."""

from __future__ import annotations

import logging
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from helpers import cube, wavy_grid
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st

from torchfair import MeshFileError
from torchfair.geometry import face_area_vectors
from torchfair.io import PolygonMesh, load_mesh, save_mesh
from torchfair.triangulation import triangulate

MOSTLY_BOUNDARY = (
    "most edges (4 of 5) are boundary, and those carry no E. If its faces are meant to touch, they are farther apart "
    "than is welded by default."
)
SQUARE = [((0, 0, 0), (1, 0, 0), (1, 1, 0.5)), ((0, 0, 0), (1, 1, 0.5), (0, 1, 0))]


def text_of(triangles: list[tuple[tuple[float, ...], ...]] = SQUARE) -> str:
    lines = ["solid a name with vertex in it"]
    for corners in triangles:
        lines += ["facet normal 0 0 0", " outer loop", *(f"  vertex {x} {y} {z}" for x, y, z in corners)]
        lines += [" endloop", "endfacet"]
    return "\n".join([*lines, "endsolid"]) + "\n"


def binary_of(triangles: np.ndarray) -> bytes:  # type: ignore[type-arg]
    rows = b"".join(struct.pack("<12fH", 0, 0, 0, *corners.ravel(), 0) for corners in triangles.astype(np.float32))
    return b"solid but binary".ljust(80, b"\0") + struct.pack("<I", len(triangles)) + rows


def load(tmp_path: Path, data: bytes | str) -> PolygonMesh:
    path = tmp_path / "m.stl"
    path.write_bytes(data if isinstance(data, bytes) else data.encode())
    return load_mesh(path)


def test_text_and_binary(tmp_path: Path) -> None:
    for data in (text_of(), text_of().upper(), text_of().replace("\n", "\r\n"), binary_of(np.array(SQUARE))):
        mesh = load(tmp_path, data)
        assert mesh.topology.face_lists() == [[0, 1, 2], [0, 2, 3]]
        assert mesh.vertices.tolist() == [[0, 0, 0], [1, 0, 0], [1, 1, 0.5], [0, 1, 0]]
        assert mesh.notes == (MOSTLY_BOUNDARY,)


FAULTS = [
    (text_of().replace("vertex 1 0 0", "vertex 1 q 0", 1), 5, "expected a number, got 'q'"),
    (text_of().replace("vertex 1 0 0", "vertex 1 0", 1), 5, "three coordinates, got 2"),
    (text_of().replace("vertex 1 0 0", "vertx 1 0 0", 1), 5, "'vertx' does not start a line"),
    (text_of().replace("  vertex 1 0 0\n", "", 1), 2, "a facet needs three vertices, got 2"),
    (text_of().replace("vertex 1 0 0", "vertex 1 nan 0", 1), None, "vertex 1 .* not finite"),
    (text_of()[:-10], 15, "ends without 'endsolid'; it is truncated"),
    (text_of()[:200], 13, "ends without 'endsolid'; it is truncated"),
    ("solid x\nendsolid\n", None, "no vertices"),
    (binary_of(np.array(SQUARE))[:-1], None, "promises 2 triangles, but the file ends after 1; it is truncated"),
    (binary_of(np.array(SQUARE))[:90], None, "promises 2 triangles, but the file ends after 0"),
    (binary_of(np.array(SQUARE))[:50], None, "is no STL file: 50 bytes are too few"),
    (b"\x01" * 200, None, "promises 16843009 triangles"),
]


@pytest.mark.parametrize(("data", "line", "message"), FAULTS, ids=range(len(FAULTS)))
def test_faults_are_one_line_of_ours(tmp_path: Path, data: bytes | str, line: int | None, message: str) -> None:
    with pytest.raises(MeshFileError, match=message) as caught:
        load(tmp_path, data)
    assert caught.value.line == line
    assert "\n" not in str(caught.value)


def test_bytes_behind_the_last_triangle_are_told(tmp_path: Path) -> None:
    mesh = load(tmp_path, binary_of(np.array(SQUARE)) + b"made by a program")
    assert mesh.topology.num_faces == 2
    assert mesh.notes == ("17 byte(s) behind the last triangle that the header promises are not read", MOSTLY_BOUNDARY)


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(seed=st.integers(0, 2**32 - 1), far=st.sampled_from([0.0, 1000.0]))
@example(seed=30000000, far=0.0)  # two units apart in every direction
def test_rounding_of_corners_opens_no_seam(tmp_path: Path, seed: int, far: float) -> None:
    """Every coordinate of every corner one unit in the last place up, down, or as it is."""
    vertices, topology = wavy_grid(4, 5, triangles=True)
    triangles = (vertices[topology.triangles] + far).numpy().astype(np.float32)
    steps = np.random.default_rng(seed).integers(-1, 2, triangles.shape)
    moved = np.where(steps > 0, np.nextafter(triangles, np.float32(np.inf)), triangles)
    moved = np.where(steps < 0, np.nextafter(triangles, np.float32(-np.inf)), moved)
    exact, mesh = load(tmp_path, binary_of(triangles)), load(tmp_path, binary_of(moved))
    assert exact.topology.num_interior_edges == mesh.topology.num_interior_edges == topology.num_interior_edges
    assert exact.notes == ()
    assert len(mesh.notes) == 1
    assert "but for rounding, and were welded" in mesh.notes[0]


def test_solids_that_touch_come_apart_where_asked(tmp_path: Path) -> None:
    vertices, topology = cube()
    side = float(vertices.amax() - vertices.amin())
    triangles = triangulate(vertices, topology).triangles
    at_a_point = torch.cat([vertices[triangles], vertices[triangles] + side]).numpy()
    assert load(tmp_path, binary_of(at_a_point)).topology.num_vertices == 16
    along_an_edge = torch.cat([vertices[triangles], vertices[triangles] + side * torch.tensor([1.0, 1, 0])]).numpy()
    with pytest.raises(MeshFileError, match=r"more than two faces.*\(--split-edges on the command line\) mends this"):
        load(tmp_path, binary_of(along_an_edge))
    mesh = load_mesh(tmp_path / "m.stl", split_edges=True)
    assert mesh.topology.num_vertices == 16
    assert not mesh.topology.boundary_loops()


def test_triangles_without_extent_are_left_out(tmp_path: Path) -> None:
    mesh = load(tmp_path, text_of([*SQUARE, ((0, 0, 0), (0, 0, 0), (1, 1, 0.5))]))
    assert mesh.topology.num_faces == 2
    assert mesh.notes == ("1 triangle(s) with two corners at one place are left out", MOSTLY_BOUNDARY)


def test_what_trimesh_reads(tmp_path: Path) -> None:
    import trimesh

    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    vertices, topology = wavy_grid(triangles=True)
    save_mesh(tmp_path / "m.stl", vertices, topology)
    mesh: Any = trimesh.load(tmp_path / "m.stl", process=False)
    assert np.allclose(np.asarray(mesh.triangles), vertices[topology.triangles].numpy(), atol=1e-6)
    stored = np.frombuffer((tmp_path / "m.stl").read_bytes(), np.dtype("<f4, <f4, <f4, V38"), offset=84)
    normals = torch.nn.functional.normalize(face_area_vectors(vertices, topology), dim=1)
    assert np.allclose(np.stack([stored[f"f{i}"] for i in range(3)], 1), normals.numpy(), atol=1e-6)
