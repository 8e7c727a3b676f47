"""Without handles a mesh becomes principal-symmetric in its shape, and it is said what has become of it."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
import torch
from helpers import DOUBLE
from torch import Tensor

from torchfair import Topology
from torchfair.formfinding import Session, SymmetricRecipe, SymmetricSettings, principal_symmetric
from torchfair.formfinding.symmetric.changes import Changes
from torchfair.geometry import ReferenceSurface, edge_lengths, face_areas
from torchfair.measuring import diagnose_mesh
from torchfair.principal import (
    PrincipalEdges,
    misalignment_of,
    principal_edges_from_directions,
    principal_edges_of_lattice,
)
from torchfair.shapes import Catenoid, Enneper, Hyperboloid, PrincipalParaboloid, Torus, principal_triangles

Start = tuple[Tensor, PrincipalEdges]


def lattice(surface: object, along: str, rows: int = 8, columns: int = 12) -> Start:
    mesh = principal_triangles(surface, rows, columns, along=along)  # type: ignore[arg-type]
    return mesh.vertices, principal_edges_of_lattice(mesh, along)  # type: ignore[arg-type]


def over_plane(height: Callable[[Tensor, Tensor], Tensor], degrees: float, rows: int = 12) -> Start:
    """A parallelogram of equilateral triangles, turned, lifted to a height field."""
    i, j = torch.meshgrid(torch.arange(rows + 1), torch.arange(rows + 1), indexing="ij")
    x, y = ((i + 0.5 * j - 0.75 * rows) / rows).flatten().double(), (0.75**0.5 * (j - 0.5 * rows) / rows).flatten()
    turn = math.radians(degrees)
    x, y = math.cos(turn) * x - math.sin(turn) * y, math.sin(turn) * x + math.cos(turn) * y
    number = torch.arange((rows + 1) ** 2).view(rows + 1, rows + 1)
    a, b, c, d = (part.flatten() for part in (number[:-1, :-1], number[1:, :-1], number[1:, 1:], number[:-1, 1:]))
    faces = torch.cat([torch.stack([a, b, d], dim=1), torch.stack([b, c, d], dim=1)])
    vertices = torch.stack([x, y, height(x, y)], dim=1)
    topology = Topology.from_faces(faces)
    return vertices, principal_edges_from_directions(vertices, topology).edges


STARTS: dict[str, Callable[[], Start]] = {
    "torus": lambda: lattice(Torus(2.0, 1.0), "v", 10, 14),
    "catenoid": lambda: lattice(Catenoid(), "u"),
    "hyperboloid": lambda: lattice(Hyperboloid(), "u"),
    "Enneper u": lambda: lattice(Enneper(), "u"),
    "Enneper v": lambda: lattice(Enneper(), "v"),
    "paraboloid": lambda: lattice(PrincipalParaboloid(0.5, -0.5), "v"),
    "saddle": lambda: over_plane(lambda x, y: 0.6 * x**2 - 0.6 * y**2, 0.0),
    "uneven saddle": lambda: over_plane(lambda x, y: 0.6 * x**2 - 0.4 * y**2 + 0.2 * x**3, 0.0),
}


def enneper(x: Tensor, y: Tensor) -> Tensor:
    return torch.stack([x - x**3 / 3 + x * y**2, y - y**3 / 3 + y * x**2, x**2 - y**2], dim=-1)


@pytest.mark.parametrize(
    ("surface", "degrees"), [("Enneper", 10.0), pytest.param("hill and valley", 0.0, marks=pytest.mark.slow)]
)
def test_a_lattice_turned_a_little_slides_into_the_directions(surface: str, degrees: float) -> None:
    """By 10 degrees, and by 13 in the mean where hills and valleys meet: E falls, or hardly rises."""
    if surface == "Enneper":
        flat, edges = over_plane(lambda x, y: x**2 - y**2, degrees, rows=10)
        vertices = enneper(flat[:, 0], flat[:, 1])
    else:
        vertices, edges = over_plane(lambda x, y: 0.25 * torch.sin(2.2 * x) * torch.cos(1.9 * y), degrees, rows=10)
    assert misalignment_of(vertices, edges) > 0.17
    result = principal_symmetric(vertices, edges)
    assert result.holds, result.notes
    assert result.after["largest_distance_from_start"] < 0.08


@pytest.mark.parametrize("name", STARTS)
def test_a_mesh_becomes_symmetric_in_its_shape(name: str) -> None:
    vertices, edges = STARTS[name]()
    result = principal_symmetric(vertices, edges)
    before, after = result.before, result.after
    assert max(after["largest_cospherical"], after["largest_coplanar"]) < 1e-8
    assert after["energy_over_curvature"] < 1.01 * before["energy_over_curvature"]
    unit = edge_lengths(vertices, edges.topology).mean()
    away = ReferenceSurface(vertices, edges.topology).closest(result.vertices).distances / unit
    assert float(away.max()) < 0.1
    assert float(away.max()) == pytest.approx(after["largest_distance_from_start"], rel=1e-9)
    assert float(after["largest_displacement"]) > 0.0
    assert result.holds


def test_the_boundary_glides_and_corners_stay() -> None:
    """The rims of a catenoid are circles; the four corners of a saddle are points."""
    vertices, edges = STARTS["catenoid"]()
    rim = edges.topology.is_boundary_vertex
    unit = edge_lengths(vertices, edges.topology).mean()
    moved = principal_symmetric(vertices, edges).vertices
    assert float((moved[rim, :2].norm(dim=1) - vertices[rim, :2].norm(dim=1)).abs().max() / unit) < 0.05
    vertices, edges = STARTS["saddle"]()
    corners = [0, 12, 156, 168]
    unit = edge_lengths(vertices, edges.topology).mean()
    kept, free = (
        (principal_symmetric(vertices, edges, settings=SymmetricSettings(free=free)).vertices - vertices) / unit
        for free in (False, True)
    )
    assert float(kept[corners].norm(dim=1).max()) < 0.05 < float(free[corners].norm(dim=1).max())
    assert float(kept.norm(dim=1).max()) > 0.05  # others slide


def test_free_shapes_go_farther_and_promise_less() -> None:
    vertices, edges = STARTS["hyperboloid"]()
    kept, free = (principal_symmetric(vertices, edges, settings=SymmetricSettings(free=free)) for free in (False, True))
    assert free.after["largest_distance_from_start"] > 2.0 * kept.after["largest_distance_from_start"]
    assert len(free.promises) == len(kept.promises) - 2


def test_a_mesh_that_collapses_says_so() -> None:
    """The paper's second differences shrink what nothing holds."""
    vertices, edges = STARTS["Enneper u"]()
    result = principal_symmetric(vertices, edges, settings=SymmetricSettings.paper())
    share = float(face_areas(result.vertices, result.topology).sum() / face_areas(vertices, edges.topology).sum())
    (promise,) = (promise for promise in result.promises if promise.name.startswith("area"))
    assert promise.reached == pytest.approx(share)
    assert share < 0.5
    assert not promise.holds
    assert "fix vertices" in str(promise)


def test_a_start_that_is_right_stays() -> None:
    vertices, edges = lattice(Torus(2.0, 1.0), "u", 10, 14)
    result = principal_symmetric(vertices, edges)
    assert result.after["largest_displacement"] < 1e-9
    assert result.after["changed_stars"] == 0


def test_a_lattice_across_the_directions_says_what_it_could_not_keep() -> None:
    """A symmetric lattice of equilateral triangles has E/C 4/3 where the saddle is even; turned by 45 degrees 1.15."""
    vertices, edges = over_plane(lambda x, y: 0.6 * x**2 - 0.6 * y**2, 45.0, rows=8)
    result = principal_symmetric(vertices, edges, settings=SymmetricSettings(most_steps=20))
    assert not result.holds
    assert any("E/C" in note and "NOT REACHED" in note for note in result.notes)


@pytest.mark.parametrize("name", ["coarse torus", pytest.param("uneven saddle", marks=pytest.mark.slow)])
def test_finer_levels_keep_the_shape_of_their_start(name: str) -> None:
    """Loop subdivision alone would shrink the tube of the torus at every level."""
    vertices, edges = lattice(Torus(2.0, 1.0), "v", 8, 10) if name == "coarse torus" else STARTS[name]()
    result = principal_symmetric(vertices, edges, levels=1)
    assert len(result.levels) == 2
    areas = [float(face_areas(mesh.vertices, mesh.topology).sum()) for mesh in result.levels]
    assert areas[1] > 0.99 * areas[0] > 0.85 * result.before["area"]
    assert result.after["area"] == pytest.approx(areas[1])
    assert result.holds
    for level in result.levels:
        assert level.after["largest_distance_from_start"] < 0.1
        assert max(level.after["largest_cospherical"], level.after["largest_coplanar"]) < 1e-8


def test_handles_references_and_live_sessions_do_not_keep_the_shape() -> None:
    vertices, edges = STARTS["saddle"]()
    middle = {84: (vertices[84] + torch.tensor([0.0, 0.0, 0.02], dtype=DOUBLE)).tolist()}
    surface = (vertices, edges.topology)
    assert SymmetricRecipe(vertices, edges).problem.keeps_shape
    assert not SymmetricRecipe(vertices, edges, handles=middle).problem.keeps_shape
    assert not SymmetricRecipe(vertices, edges, reference=surface).problem.keeps_shape
    assert not Session(SymmetricRecipe(vertices, edges)).recipe.problem.keeps_shape
    once = Session(SymmetricRecipe(vertices, edges), live=False)
    assert once.recipe.problem.keeps_shape
    before = once.snapshot()
    once.move(middle)
    once.free([84])
    assert not once.recipe.problem.keeps_shape  # it would snap back
    assert not once.refined().recipe.problem.keeps_shape
    once.restore(before)
    assert once.recipe.problem.keeps_shape


def test_changes_are_those_that_were_made() -> None:
    vertices, edges = STARTS["saddle"]()
    changes, unit = Changes(vertices, edges.topology), edge_lengths(vertices, edges.topology).mean()
    same = changes.measures(vertices)
    assert same["largest_displacement"] == same["mean_displacement"] == same["changed_stars"] == 0.0
    assert same["largest_distance_from_start"] < 1e-12
    moved = vertices.clone()
    moved[84, 2] += 0.3 * unit
    found = changes.measures(moved)
    assert found["largest_displacement"] == pytest.approx(0.3 * float(unit))
    assert found["mean_displacement"] == pytest.approx(0.3 * float(unit) / len(vertices))
    assert 0.2 < found["largest_distance_from_start"] < 0.3 + 1e-9  # the surface is steep there, or flat
    first, second = diagnose_mesh(vertices, edges.topology), diagnose_mesh(moved, edges.topology)
    names = [
        [f"{name} {good}" for name, good in zip(d.class_names(), d.classes.good.tolist(), strict=True)]
        for d in (first, second)
    ]
    assert found["changed_stars"] == sum(a != b for a, b in zip(*names, strict=True)) > 0
    for name, key in (
        ("convex_stars", "convex"),
        ("good_saddles", "good_saddle"),
        ("bad_saddles", "bad_saddle"),
        ("neither_stars", "neither"),
    ):
        assert found[name] == second.counts()[key]
