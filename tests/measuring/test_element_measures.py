from __future__ import annotations

import math

import pytest
import torch
from helpers import cube, wavy_grid

from torchfair import ShapeError, Topology
from torchfair.geometry import dihedral_angles, face_areas, planarity
from torchfair.measuring import (
    count_meetings,
    edge_measures,
    element_measures,
    panel_measures,
    verdict,
    worst_edges,
    worst_panels,
)
from torchfair.measuring.measurements import measure_mesh


def test_panels_against_a_loop() -> None:
    vertices, topology = wavy_grid(5, 6)
    angles = dihedral_angles(vertices, topology).abs().tolist()
    for row in panel_measures(vertices, topology):
        ring = topology.face_lists()[row.face]
        assert list(row.vertices) == ring
        sides = [float((vertices[a] - vertices[b]).norm()) for a, b in zip(ring, [*ring[1:], ring[0]], strict=True)]
        assert row.longest_edge == pytest.approx(max(sides))
        assert row.position == pytest.approx(vertices[ring].mean(0).tolist())
        near = [a for a, pair in zip(angles, topology.interior_edge_faces.tolist(), strict=True) if row.face in pair]
        assert row.largest_kink_degrees == pytest.approx(math.degrees(max(near)))
        assert row.area == pytest.approx(float(face_areas(vertices, topology)[row.face]))


def test_classes_of_panels() -> None:
    """A quad lifted at one corner, more and more."""
    for height, kind in ((0.0, "planar"), (0.004, "nearly planar"), (0.1, "warped")):
        corners = torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 1, height], [0, 1, 0]], dtype=torch.float64)
        topology = Topology.from_faces([[0, 1, 2, 3]])
        row = panel_measures(corners, topology)[0]
        assert row.kind == kind
        assert row.largest_kink_degrees is None
        assert row.planarity == pytest.approx(float(planarity(corners, topology)[0]))
        assert len(worst_panels(corners, topology, 5)) == (height > 0)
    line = torch.tensor([[0.0, 0, 0], [1, 0, 0], [2, 0, 0]], dtype=torch.float64)
    assert panel_measures(line, Topology.from_faces([[0, 1, 2]]))[0].kind == "no area"


def test_boundary_edges_have_no_angle_and_energies_are_sums_of_rows() -> None:
    vertices, topology = wavy_grid(5, 5)
    rows = edge_measures(vertices, topology)
    assert [row.kind == "boundary" for row in rows] == [row.dihedral_angle_degrees is None for row in rows]
    numbers = {quantity.key: quantity.value for quantity in measure_mesh(vertices, topology)}
    assert sum(row.angle_variation or 0.0 for row in rows) == pytest.approx(numbers["angle_variation"])
    assert {row.kind for row in edge_measures(*cube())} == {"crease"}


def test_worst_panels_are_the_least_planar_ones() -> None:
    vertices, topology = wavy_grid(6, 6)
    rows = worst_panels(vertices, topology, 4)
    values = [row.planarity for row in rows]
    assert values == sorted(planarity(vertices, topology).tolist(), reverse=True)[:4]
    with pytest.raises(ShapeError, match="count"):
        worst_panels(vertices, topology, -1)


def said_of(vertices: torch.Tensor, topology: Topology) -> str:
    measures = {quantity.key: quantity.value for quantity in measure_mesh(vertices, topology)}
    return verdict(measures, worst_edges(vertices, topology, 1), worst_panels(vertices, topology, 1))


def test_the_verdict_is_one_sentence_that_fits() -> None:
    flat, topology = wavy_grid(5, 5)
    flat[:, 2] = 0.0
    assert said_of(flat, topology).startswith("the mesh is flat: E is 0, and so is C; all panels are planar")
    soup = Topology.from_faces([[0, 1, 2], [3, 4, 5]])
    assert "no two faces share an edge" in said_of(torch.rand(6, 3, dtype=torch.float64), soup)
    words = said_of(*cube())
    assert words.startswith("E/C is ")
    assert "by 90 degrees (8% of E')" in words
    assert "\n" not in words
    assert "planar, most of all panel" in said_of(*wavy_grid(5, 5))


def test_faces_side_by_side_do_not_run_through_each_other() -> None:
    soup = torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 1, 0.2], [0, 0, 0], [1, 1, 0.2], [0, 1, 0]], dtype=torch.float64)
    topology = Topology.from_faces([[0, 1, 2], [3, 4, 5]])
    assert count_meetings(soup, topology) == 0
    assert count_meetings(torch.cat([soup[:3], soup[:3]]), topology) == 1  # one face twice
    crossed = torch.cat([soup[:3], soup[:3] @ torch.tensor([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]], dtype=torch.float64)])
    crossed[3:] += torch.tensor([0.3, 0.2, -0.3], dtype=torch.float64)
    assert count_meetings(crossed, topology) == 1


def test_the_largest_of_many_are_those_of_a_stable_sort() -> None:
    torch.manual_seed(0)
    for values in (
        torch.randint(0, 4, (50,)).double(),
        torch.rand(50, dtype=torch.float64),
        torch.zeros(50),
        torch.where(torch.rand(50) < 0.1, math.nan, torch.randint(0, 4, (50,)).double()),
        torch.full((50,), math.nan),
        torch.zeros(0),
    ):
        for count in (0, 1, 3, 49, 50, 70):
            expected = values.argsort(descending=True, stable=True)[:count]
            assert torch.equal(element_measures._largest(values, count), expected)


def test_panels_that_are_chosen_are_those_of_the_list_of_all() -> None:
    vertices, topology = wavy_grid(5, 6)
    every = panel_measures(vertices, topology)
    chosen = [7, 2, 2, len(every) - 1]
    assert panel_measures(vertices, topology, torch.tensor(chosen)) == [every[face] for face in chosen]
    assert panel_measures(vertices, topology, torch.zeros(0, dtype=torch.int64)) == []
