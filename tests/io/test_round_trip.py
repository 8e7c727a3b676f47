"""What is written is read back: bit by bit, corner by corner, in every format."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from helpers import cube, wavy_grid
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from torchfair import MeshError, MeshFileError, ShapeError, Topology
from torchfair.io import PolygonMesh, load_mesh, save_mesh

EXACT = [("m.obj", False), ("m.off", False), ("m.ply", False), ("m.ply", True), ("M.OBJ", False), ("m.Ply", True)]
exact = pytest.mark.parametrize(("name", "binary"), EXACT)
HYBRID = [[2, 0, 1], [0, 2, 3], [2, 1, 4, 5], [3, 2, 5, 6, 7]]
shared_folder = settings(max_examples=30, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def hybrid() -> tuple[torch.Tensor, Topology]:
    vertices = torch.from_numpy(np.random.default_rng(1).normal(size=(10, 3)))
    return vertices, Topology.from_faces(HYBRID, num_vertices=10)  # the last two are isolated


def assert_same(mesh: PolygonMesh, vertices: torch.Tensor, topology: Topology) -> None:
    assert mesh.vertices.dtype == torch.float64
    assert mesh.vertices.numpy().tobytes() == vertices.detach().double().numpy().tobytes()
    assert mesh.topology.num_vertices == topology.num_vertices
    assert mesh.topology.face_lists() == topology.face_lists()
    assert mesh.repairs == ()


@exact
def test_polygons_order_and_isolated_vertices(tmp_path: Path, name: str, binary: bool) -> None:
    for shape in (hybrid, cube, wavy_grid, lambda: wavy_grid(triangles=True)):
        vertices, topology = shape()
        save_mesh(tmp_path / name, vertices, topology, binary=binary, overwrite=True)
        assert_same(load_mesh(tmp_path / name), vertices, topology)


@exact
@shared_folder
@given(numbers=st.lists(st.floats(allow_nan=False, allow_infinity=False), min_size=9, max_size=9))
def test_every_float_is_bit_exact(tmp_path: Path, name: str, binary: bool, numbers: list[float]) -> None:
    vertices = torch.tensor(numbers, dtype=torch.float64).reshape(3, 3)
    topology = Topology.from_faces([[1, 2, 0]])
    save_mesh(tmp_path / name, vertices, topology, binary=binary, overwrite=True)
    assert_same(load_mesh(tmp_path / name), vertices, topology)


@exact
@pytest.mark.parametrize("size", [255, 256, 1000])
def test_large_polygons(tmp_path: Path, name: str, binary: bool, size: int) -> None:
    """From 256 corners on, a PLY file needs a wider count."""
    rim = np.random.default_rng(0).permutation(size)
    topology = Topology.from_faces([rim.tolist(), [int(rim[1]), int(rim[0]), size]])
    vertices = torch.rand(size + 1, 3, dtype=torch.float64)
    save_mesh(tmp_path / name, vertices, topology, binary=binary)
    assert_same(load_mesh(tmp_path / name), vertices, topology)


@exact
def test_single_precision_and_gradients(tmp_path: Path, name: str, binary: bool) -> None:
    vertices, topology = hybrid()
    single = vertices.float().requires_grad_()
    save_mesh(tmp_path / name, single, topology, binary=binary)
    assert_same(load_mesh(tmp_path / name), single, topology)


def test_text_is_as_short_as_it_can_be(tmp_path: Path) -> None:
    vertices = torch.tensor([[0.1, 2.0, -0.0], [1e-300, 1 / 3, 0], [0, 1, 0]], dtype=torch.float64)
    save_mesh(tmp_path / "m.obj", vertices, Topology.from_faces([[0, 1, 2]]))
    assert (tmp_path / "m.obj").read_text() == (
        "v 0.1 2.0 -0.0\nv 1e-300 0.3333333333333333 0.0\nv 0.0 1.0 0.0\nf 1 2 3\n"
    )


@pytest.mark.parametrize("suffix", [".stl", ".glb"])
def test_other_formats_keep_the_shape(tmp_path: Path, suffix: str) -> None:
    vertices, topology = wavy_grid(triangles=True)
    path = tmp_path / f"m{suffix}"
    save_mesh(path, vertices, topology)
    mesh = load_mesh(path)
    read = mesh.vertices[mesh.topology.triangles]
    assert torch.allclose(read, vertices[topology.triangles], atol=1e-6)
    assert mesh.topology.num_edges == topology.num_edges  # corners of an STL file are joined again


def test_corners_of_an_stl_file_are_numbered_by_first_use(tmp_path: Path) -> None:
    vertices, topology = wavy_grid(triangles=True)
    save_mesh(tmp_path / "m.stl", vertices, topology)
    corners = load_mesh(tmp_path / "m.stl").topology.corners
    new = torch.cat([corners[:1] == 0, corners[1:] > corners.cummax(0).values[:-1]])
    assert corners[new].tolist() == list(range(topology.num_vertices))


# ---- refusals --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -float("inf")])
def test_what_is_not_finite_is_not_written(tmp_path: Path, value: float) -> None:
    vertices, topology = hybrid()
    vertices[3, 1] = value
    with pytest.raises(MeshError, match="not finite: vertices 3"):
        save_mesh(tmp_path / "m.obj", vertices, topology)
    assert list(tmp_path.iterdir()) == []


def test_batches_have_to_be_written_one_by_one(tmp_path: Path) -> None:
    vertices, topology = hybrid()
    with pytest.raises(ShapeError, match=r"one mesh \(10, 3\)"):
        save_mesh(tmp_path / "m.obj", vertices[None], topology)
    with pytest.raises(ShapeError):
        save_mesh(tmp_path / "m.obj", vertices[1:], topology)
    assert list(tmp_path.iterdir()) == []


def test_other_refusals(tmp_path: Path) -> None:
    vertices, topology = hybrid()
    with pytest.raises(MeshError, match="triangles only, but 2 face"):
        save_mesh(tmp_path / "m.stl", vertices, topology)
    with pytest.raises(MeshError, match="no faces"):
        save_mesh(tmp_path / "m.obj", vertices, Topology.from_faces([], 10))
    for name in ("m.xyz", "m", "m.gltf"):
        with pytest.raises(MeshFileError, match="cannot write the format"):
            save_mesh(tmp_path / name, vertices, topology)
    with pytest.raises(MeshFileError, match="only PLY"):
        save_mesh(tmp_path / "m.obj", vertices, topology, binary=True)
    assert list(tmp_path.iterdir()) == []


def test_an_existing_file_is_replaced_only_on_request(tmp_path: Path) -> None:
    vertices, topology = hybrid()
    path = tmp_path / "m.obj"
    path.write_text("mine")
    with pytest.raises(MeshFileError, match="exists already"):
        save_mesh(path, vertices, topology)
    assert path.read_text() == "mine"
    save_mesh(path, vertices, topology, overwrite=True)
    assert_same(load_mesh(path), vertices, topology)


# ---- repair ----------------------------------------------------------------------------------------------


def test_repair_on_reading(tmp_path: Path) -> None:
    path = tmp_path / "m.obj"
    path.write_text("v 9 9 9\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 2 3 4\nf 3 4 5\n")
    with pytest.raises(
        MeshFileError, match=r"line 6: inconsistent.* faces 1 \(line 6\) and .*\(--repair on the command"
    ):
        load_mesh(path)
    mesh = load_mesh(path, repair=True)
    assert mesh.topology.face_lists() == [[0, 1, 2], [1, 3, 2]]
    assert mesh.vertices[:, 0].tolist() == [0, 1, 0, 1]
    assert len(mesh.repairs) == 2


def test_what_repair_cannot_mend(tmp_path: Path) -> None:
    path = tmp_path / "m.off"
    path.write_text("OFF\n5 3 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 1 1\n3 0 1 2\n3 0 1 3\n3 1 0 4\n")
    for repair in (False, True):
        with pytest.raises(MeshFileError, match="non-manifold") as caught:
            load_mesh(path, repair=repair)
        assert "repair=True" not in str(caught.value)
        assert "split_edges=True (--split-edges on the command line) mends this: split 2 vertex" in str(caught.value)
    moebius = "".join(f"3 {i} {(i + 1) % 5} {(i + 2) % 5}\n" for i in range(5))
    path.write_text(f"OFF\n5 5 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n1 1 1\n{moebius}")
    with pytest.raises(MeshFileError, match="inconsistent orientation") as caught:
        load_mesh(path)
    assert "mends" not in str(caught.value)
