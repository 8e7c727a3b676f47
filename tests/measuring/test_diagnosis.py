"""What is wrong with the stars of a mesh: counts agree with the quantities they count, the worst come first."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE, wavy_grid

from torchfair import ShapeError, Topology, TorchfairError
from torchfair.measuring import diagnose_mesh
from torchfair.stars import StarKind, classify_stars, gauss_overlaps, pyramid_self_intersections


def test_numbers_are_those_of_the_library() -> None:
    vertices, topology = wavy_grid(9, 9, triangles=True)
    diagnosis = diagnose_mesh(vertices, topology)
    numbers = diagnosis.counts()
    classes = classify_stars(vertices, topology)
    for kind in (StarKind.CONVEX, StarKind.SADDLE, StarKind.NEITHER):
        assert numbers[kind.name.lower()] == int(classes.is_kind(kind).sum())
    assert numbers["convex"] + numbers["saddle"] + numbers["neither"] == numbers["inner_vertices"] == 49
    assert numbers["good_saddle"] + numbers["bad_saddle"] == numbers["saddle"]
    folded = pyramid_self_intersections(vertices, topology)
    assert numbers["self_intersecting_pyramids"] == int((folded > 0).sum())
    assert numbers["pyramid_self_intersections"] == int(folded.sum())
    assert sum(numbers["self_intersecting_pyramids_by_class"].values()) == numbers["self_intersecting_pyramids"]
    assert numbers["gauss_image_crossings"] == gauss_overlaps(vertices, topology).crossings
    assert sum(numbers["ordinary_patterns"].values()) == numbers["inner_vertices"]
    assert sum(numbers["pyramid_windings"].values()) == numbers["inner_vertices"]
    lists = diagnosis.per_vertex()
    assert {len(entries) for entries in lists.values()} == {81}
    for name in ("convex", "saddle", "neither"):
        assert lists["class"].count(name) == numbers[name]
    assert lists["class"].count("boundary") == numbers["boundary_vertices"]


def test_worst_vertices_come_first_and_good_ones_never() -> None:
    diagnosis = diagnose_mesh(*wavy_grid(9, 9, triangles=True))
    rows = diagnosis.worst_vertices(1000)
    crossings = [row["self_intersections"] for row in rows]
    assert crossings == sorted(crossings, reverse=True)
    assert {row["class"] for row in rows if not row["self_intersections"]} <= {"bad saddle", "neither"}
    assert diagnosis.worst_vertices(3) == rows[:3]
    assert rows[0] == diagnosis.describe_vertex(rows[0]["vertex"])


def test_mesh_without_inner_vertices_and_isolated_ones() -> None:
    vertices = torch.tensor([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [5, 5, 5]], dtype=DOUBLE)
    numbers = diagnose_mesh(vertices, Topology.from_faces([[0, 1, 2]], num_vertices=4)).counts()
    assert (numbers["inner_vertices"], numbers["boundary_vertices"], numbers["isolated_vertices"]) == (0, 3, 1)
    assert numbers["mean_pyramid_perimeter_degrees"] is None


def test_wrong_arguments_are_named() -> None:
    vertices, topology = wavy_grid(4, 4, triangles=True)
    with pytest.raises(ShapeError, match="not a batch"):
        diagnose_mesh(vertices[None], topology)
    diagnosis = diagnose_mesh(vertices.requires_grad_(), topology)
    with pytest.raises(ShapeError, match="count"):
        diagnosis.worst_vertices(-1)
    for vertex in (0, -1, 16):  # on the boundary, and none
        with pytest.raises(TorchfairError, match=f"vertex {vertex} is not inside"):
            diagnosis.describe_vertex(vertex)
