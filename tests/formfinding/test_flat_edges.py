"""Panels that arrive as coplanar triangles stay flat: which edges are their diagonals, and what becomes of them."""

from __future__ import annotations

import math

import pytest
import torch
from helpers import DOUBLE, cube, grid_faces, random_rotation, split_quads
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor

from torchfair import MeshError, Topology
from torchfair.constraints import lifted_flat_edge_terms, lifted_normal_variation_blocks
from torchfair.energies import normal_variation
from torchfair.errors import SettingsError
from torchfair.formfinding import FairSettings, minimise_normal_variation
from torchfair.formfinding.fair.flat_edges import edges_to_keep_flat
from torchfair.geometry import dihedral_angles
from torchfair.shapes import example_roof, hybrid_roof
from torchfair.subdivision import midpoint
from torchfair.triangulation import triangulate

KEEP = FairSettings()


def kept(vertices: Tensor, topology: Topology, settings: FairSettings = KEEP) -> set[tuple[int, int]]:
    """Ends of the edges that are kept flat."""
    ends = topology.interior_edges[edges_to_keep_flat(vertices, topology, settings)]
    return {(min(pair), max(pair)) for pair in ends.tolist()}


def in_triangles(vertices: Tensor, topology: Topology) -> Topology:
    return Topology.from_faces(triangulate(vertices, topology).triangles, topology.num_vertices)


def diagonals(quads: Topology, triangles: Topology) -> set[tuple[int, int]]:
    """Edges of the triangles that are none of the polygons."""
    both = [{(min(pair), max(pair)) for pair in mesh.edges.tolist()} for mesh in (triangles, quads)]
    return both[0] - both[1]


def vault(rows: int = 6, columns: int = 5, *, shear: float = 0.0) -> tuple[Tensor, Topology]:
    """A barrel vault of quads: those of a row along the axis lie in one plane."""
    u, angle = torch.meshgrid(
        torch.arange(rows, dtype=DOUBLE), 0.3 * torch.arange(columns, dtype=DOUBLE), indexing="ij"
    )
    vertices = torch.stack([u + shear * angle, 3.0 * angle.sin(), 3.0 * angle.cos()], dim=-1).reshape(-1, 3)
    return vertices, Topology.from_faces(grid_faces(rows, columns))


def small_roof() -> tuple[Tensor, Topology, Topology]:
    """A roof of triangles and planar quads, and the same cut into triangles."""
    vertices, topology = hybrid_roof(4, 9)
    return vertices, topology, in_triangles(vertices, topology)


def test_two_triangles_of_every_side_of_a_cube_are_a_panel() -> None:
    vertices, quads = cube()
    triangles = in_triangles(vertices, quads)
    assert kept(vertices, triangles) == diagonals(quads, triangles)
    assert len(diagonals(quads, triangles)) == 6
    assert kept(vertices, quads) == set()


def test_a_plane_with_vertices_in_it_is_no_panel() -> None:
    """As it comes from meshing of a flat region, which is to bend where it is pulled."""
    vertices, quads = cube()
    step = midpoint(in_triangles(vertices, quads))
    fine = step.apply(vertices)
    assert kept(fine, step.topology) == set()
    every = kept(fine, step.topology, FairSettings(flat="all"))
    assert len(every) == step.topology.num_edges - 2 * 12


def test_what_is_all_there_is_is_no_panel() -> None:
    square = torch.tensor([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], dtype=DOUBLE)
    pair = Topology.from_faces([[0, 1, 2], [0, 2, 3]])
    assert kept(square, pair) == set()
    assert kept(square, pair, FairSettings(flat="all")) == {(0, 2)}


@pytest.mark.parametrize("shear", [0.0, 0.4])
def test_of_a_barrel_vault_the_quads_are_kept_and_not_whole_rows(shear: float) -> None:
    """In a row of coplanar quads edges across it are flat, too; which triangles make quads angles say."""
    vertices, quads = vault(shear=shear)
    triangles = in_triangles(vertices, quads)
    assert kept(vertices, triangles) == diagonals(quads, triangles)
    assert len(kept(vertices, triangles, FairSettings(flat="all"))) == 5 * 4 + 4 * 4


def test_polygons_of_any_shape_are_panels_as_a_whole() -> None:
    """An L, whose sides meet at 90 and 270 degrees, with a skirt around it that is bent down."""
    shape = torch.tensor([[0.0, 0], [2, 0], [2, 1], [1, 1], [1, 2], [0, 2]], dtype=DOUBLE)
    rim = 2.0 * (shape - shape.mean(0)) + shape.mean(0)
    top, down = torch.zeros(6, 1, dtype=DOUBLE), torch.full((6, 1), -0.5, dtype=DOUBLE)
    vertices = torch.cat([torch.cat([shape, top], 1), torch.cat([rim, down], 1)])
    inner = [[3, 0, 1], [3, 1, 2], [3, 4, 0], [4, 5, 0]]
    skirt = [face for i in range(6) for face in ([i, i + 6, (i + 1) % 6 + 6], [i, (i + 1) % 6 + 6, (i + 1) % 6])]
    assert {(0, 3), (1, 3), (0, 4)} <= kept(vertices, Topology.from_faces(inner + skirt))


def test_tolerance_is_a_share_of_the_mean_angle() -> None:
    vertices, topology, triangles = small_roof()
    wanted = diagonals(topology, triangles)
    assert kept(vertices, triangles, FairSettings(flat_tolerance=0.0)) == wanted
    angles = dihedral_angles(vertices, triangles).abs()
    beyond = FairSettings(flat_tolerance=0.05)
    found = edges_to_keep_flat(vertices, triangles, beyond)
    assert len(found) > len(wanted)
    assert float(angles[found].max()) <= 0.05 * float(angles.mean())


def test_what_is_flat_by_chance_is_no_panel() -> None:
    """Six in a thousand edges of a smooth roof have angles below a hundredth of the mean."""
    vertices, topology = example_roof()
    for tolerance in (1e-3, 1e-2, 3e-2):
        every = len(kept(vertices, topology, FairSettings(flat="all", flat_tolerance=tolerance)))
        assert every < tolerance * topology.num_interior_edges
        assert kept(vertices, topology, FairSettings(flat_tolerance=tolerance)) == set()
    assert every > 20


@given(seed=st.integers(0, 1000), scale=st.sampled_from([1e-3, 1.0, 1e4]))
@settings(deadline=None, max_examples=20)
def test_panels_do_not_depend_on_unit_and_place(seed: int, scale: float) -> None:
    vertices, quads = vault(shear=0.2)
    triangles = in_triangles(vertices, quads)
    moved = scale * vertices @ random_rotation(seed).T + scale
    assert kept(moved, triangles) == kept(vertices, triangles)


def test_numbers_of_edges_may_be_given() -> None:
    vertices, _, triangles = small_roof()
    assert edges_to_keep_flat(vertices, triangles, FairSettings(flat=(3, 1))).tolist() == [3, 1]
    with pytest.raises(MeshError, match=r"flat: interior edges are numbered 0 to \d+, got \[-1\]"):
        edges_to_keep_flat(vertices, triangles, FairSettings(flat=(-1,)))
    with pytest.raises(MeshError, match="flat: interior edges"):
        edges_to_keep_flat(vertices, triangles, FairSettings(flat=(triangles.num_interior_edges,)))
    with pytest.raises(SettingsError, match="flat must be one of keep, all, none or edge numbers"):
        FairSettings(flat="panels")  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("formulation", "boundary"),
    [("reduced", "glide"), pytest.param("lifted", "glide", marks=pytest.mark.slow), ("reduced", "fixed")],
)
def test_panels_stay_flat_where_they_would_fold(formulation: str, boundary: str) -> None:
    """Measured from outside."""
    vertices, _, triangles = small_roof()
    edges = edges_to_keep_flat(vertices, triangles, KEEP)
    for flat in ("keep", "none"):
        asked = FairSettings(flat=flat, formulation=formulation, boundary=boundary, crease_angle=0.0)  # type: ignore[arg-type]
        result = minimise_normal_variation(vertices, triangles, settings=asked)
        folds = torch.rad2deg(dihedral_angles(result.vertices, triangles)[edges].abs())
        if flat == "keep":
            assert float(folds.max()) < 0.02
            assert result.after["largest_fold_degrees"] == pytest.approx(float(folds.max()), abs=1e-9)
            (promise,) = (promise for promise in result.promises if "folds" in promise.name)
            assert promise.holds
            assert any("edges between coplanar triangles are kept flat" in note for note in result.notes)
        else:
            assert float(folds.max()) > 0.3
            assert not any("folds" in promise.name for promise in result.promises)
        assert float(normal_variation(result.vertices, triangles)) < 0.7 * float(normal_variation(vertices, triangles))


def test_chosen_edges_become_flat() -> None:
    """In stages, where they arrive folded."""
    vertices, quads = vault()
    triangles = in_triangles(vertices, quads)
    bent = vertices.clone()
    bent[:, 2] += 0.05 * vertices[:, 0] ** 2 * vertices[:, 1]
    chosen = torch.nonzero(dihedral_angles(vertices, triangles).abs() < 1e-9).squeeze(1)[:3]
    assert float(dihedral_angles(bent, triangles)[chosen].abs().max()) > math.radians(2.0)
    asked = FairSettings(flat=tuple(chosen.tolist()), distance_limit=None, boundary="free")
    result = minimise_normal_variation(bent, triangles, settings=asked)
    assert result.preparation
    assert float(dihedral_angles(result.vertices, triangles)[chosen].abs().max()) < math.radians(0.02)


def test_a_flat_lattice_bends_to_its_handle() -> None:
    x, y = torch.meshgrid(*(torch.arange(7, dtype=DOUBLE),) * 2, indexing="ij")
    vertices = torch.stack([x, y, torch.zeros_like(x)], dim=-1).reshape(-1, 3)
    topology = Topology.from_faces(split_quads(grid_faces(7, 7)))
    target = (3.0, 3.0, 1.0)
    result = minimise_normal_variation(vertices, topology, handles={24: target})
    assert result.holds
    assert float((result.vertices[24] - torch.tensor(target, dtype=DOUBLE)).norm()) < 0.05


def test_dual_lengths_are_zero_exactly_where_edges_are_flat() -> None:
    vertices, _, triangles = small_roof()
    everything = torch.arange(triangles.num_interior_edges)
    (term,) = lifted_flat_edge_terms(triangles, everything, weight=1.0)
    values = term.values(term.arguments({"vertices": vertices, **lifted_normal_variation_blocks(vertices, triangles)}))
    folds = dihedral_angles(vertices, triangles).abs()
    torch.testing.assert_close(values[:, 0], 2.0 * (0.5 * folds).sin())
    torch.testing.assert_close(values[:, 1:].norm(dim=1), values[:, 0])
