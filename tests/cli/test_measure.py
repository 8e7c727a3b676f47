from __future__ import annotations

import json
import math
from pathlib import Path

import pytest
import torch
from helpers import DOUBLE, cube, tetrahedron, wavy_grid

from torchfair import Topology
from torchfair.cli import main
from torchfair.cli.measurements import count_components, measure_mesh, worst_edges
from torchfair.io import save_mesh

CUBE_OBJ = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 1) for z in (0, 1))


def values(vertices: torch.Tensor, topology: Topology) -> dict[str, float | int | None]:
    return {quantity.key: quantity.value for quantity in measure_mesh(vertices, topology)}


def file_of(mesh: tuple[torch.Tensor, Topology], path: Path) -> str:
    save_mesh(path, *mesh)
    return str(path)


def strict_json(text: str) -> dict[str, object]:
    def refuse(token: str) -> float:
        raise AssertionError(f"{token} is no JSON")

    return json.loads(text, parse_constant=refuse)


def test_unit_cube_in_closed_form() -> None:
    expected = {
        "vertices": 8,
        "isolated_vertices": 0,
        "edges": 12,
        "boundary_edges": 0,
        "faces": 6,
        "triangles": 0,
        "quads": 6,
        "degenerate_faces": 0,
        "boundary_loops": 0,
        "components": 1,
        "euler_characteristic": 2,
        "normal_variation": 12 * math.sqrt(2),
        "angle_variation": 6 * math.pi,
        "total_mean_curvature": 3 * math.pi,
        "total_absolute_curvature": 8,  # eight corners with two eigenvalues 1/2 each in their planes
        "total_absolute_curvature_corrected": 8 * 2 / 3,  # 1/3 is the squared cosine between vertex and face normals
        "total_frobenius_curvature": 4 * math.sqrt(2),
        "normal_variation_per_area": 2 * math.sqrt(2),
        "angle_variation_per_area": math.pi,
        "total_mean_curvature_per_area": math.pi / 2,
        "total_absolute_curvature_per_area": 8 / 6,
        "total_absolute_curvature_corrected_per_area": 16 / 18,
        "total_frobenius_curvature_per_area": 4 * math.sqrt(2) / 6,
        "area": 6,
        "mean_edge_length": 1,
        "shortest_edge_length": 1,
        "longest_edge_length": 1,
        "largest_dihedral_angle_degrees": 90,
        "smallest_corner_angle_degrees": 90,
        "largest_planarity": 0,
        "angle_defect_sum_degrees": 720,
    }
    measured = values(*cube())
    assert {key: measured[key] for key in expected} == pytest.approx(expected, abs=1e-12)


def test_scaling_follows_the_units() -> None:
    """Twice the size: lengths double, areas quadruple, pure numbers and degrees stay."""
    vertices, topology = wavy_grid()
    powers = {"length units of the file": 1, "square length units of the file": 2, "1 / length unit of the file": -1}
    small = measure_mesh(vertices, topology)
    large = values(2 * vertices, topology)
    assert {quantity.unit for quantity in small} == {*powers, "degrees", "dimensionless"}
    for quantity in small:
        assert large[quantity.key] == pytest.approx(quantity.value * 2.0 ** powers.get(quantity.unit, 0), rel=1e-10)


def test_boundary_components_and_isolated_vertices_are_counted() -> None:
    vertices, topology = wavy_grid(3, 3)
    faces = topology.face_lists()
    twice = Topology.from_faces([*faces, *[[v + 9 for v in face] for face in faces]], 20)
    measured = values(torch.cat([vertices, vertices + 5, torch.zeros(2, 3, dtype=DOUBLE)]), twice)
    assert measured["isolated_vertices"] == 2
    assert measured["components"] == 2
    assert measured["boundary_loops"] == 2
    assert measured["boundary_edges"] == 16
    assert measured["euler_characteristic"] == 2
    assert count_components(Topology.from_faces([], 4)) == 0


@pytest.mark.parametrize(
    ("vertices", "faces"),
    [
        (torch.zeros(0, 3), []),
        (torch.zeros(3, 3), []),
        (torch.zeros(3, 3), [[0, 1, 2]]),
        (torch.tensor([[0.0, 0, 0], [1, 0, 0], [2, 0, 0], [0, 1, 0]]), [[0, 1, 2], [0, 2, 3]]),
    ],
)
def test_degenerate_meshes_have_finite_or_missing_numbers(vertices: torch.Tensor, faces: list[list[int]]) -> None:
    topology = Topology.from_faces(faces, len(vertices))
    for value in values(vertices.to(DOUBLE), topology).values():
        assert value is None or math.isfinite(value)


def test_worst_edges_are_sorted_and_complete() -> None:
    vertices, topology = wavy_grid()
    count = topology.num_interior_edges
    worst = worst_edges(vertices, topology, count + 5)
    assert len(worst) == count
    assert sorted(edge.edge for edge in worst) == list(range(count))
    terms = [edge.angle_variation for edge in worst]
    assert terms == sorted(terms, reverse=True)
    assert sum(terms) == pytest.approx(values(vertices, topology)["angle_variation"])
    for edge in worst:
        start, stop = vertices[list(edge.vertices)]
        assert edge.length == pytest.approx(float(torch.linalg.vector_norm(stop - start)))
        assert edge.angle_variation == pytest.approx(edge.length * abs(math.radians(edge.dihedral_angle_degrees)))
    assert worst_edges(vertices, topology, 3) == worst[:3]
    assert worst_edges(vertices, topology, 0) == []


def test_convex_edges_have_positive_angles() -> None:
    assert all(edge.dihedral_angle_degrees == pytest.approx(109.4712) for edge in worst_edges(*tetrahedron(), 6))


def test_json_is_one_strict_object(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = file_of(cube(), tmp_path / "cube.obj")
    assert main(["measure", path, "--json", "--worst", "2"]) == 0
    captured = capsys.readouterr()
    measured = strict_json(captured.out)
    assert captured.err == ""
    assert measured["normal_variation"] == pytest.approx(12 * math.sqrt(2))
    assert measured["file"] == path
    assert measured["repairs"] == []
    assert len(measured["worst_edges"]) == 2
    assert set(measured["worst_edges"][0]) == {
        "edge",
        "vertices",
        "length",
        "dihedral_angle_degrees",
        "angle_variation",
    }
    assert set(measured["units"]) == set(measured) - {"file", "repairs", "worst_edges", "units"}


def test_json_of_a_degenerate_mesh_has_nulls_for_what_is_undefined(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "line.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n")
    assert main(["measure", str(path), "--json"]) == 0
    measured = strict_json(capsys.readouterr().out)
    assert measured["normal_variation_per_area"] is None
    assert measured["degenerate_faces"] == 1
    assert measured["worst_edges"] == []


def test_table_has_values_units_and_worst_edges(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = file_of(cube(), tmp_path / "cube.off")
    assert main(["measure", path, "--worst", "3"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == path
    energy = next(line for line in lines if "normal variation" in line)
    assert energy.split()[-6:] == ["16.9706", "length", "units", "of", "the", "file"]
    heading = next(number for number, line in enumerate(lines) if line.startswith("worst edges"))
    rows = lines[heading + 2 :]
    assert len(rows) == 3
    assert rows[0].split()[-3:] == ["1", "90", "1.5708"]


def test_repair_is_said_and_done(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "turned.obj"
    path.write_text("v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 9 9 9\nf 1 2 3\nf 1 4 3\n")
    assert main(["measure", str(path)]) == 2
    assert "--repair" in capsys.readouterr().err
    assert main(["measure", str(path), "--repair", "--json"]) == 0
    measured = strict_json(capsys.readouterr().out)
    assert measured["vertices"] == 4
    assert len(measured["repairs"]) >= 1
    assert main(["measure", str(path), "--repair"]) == 0
    assert capsys.readouterr().out.startswith("repaired: ")
