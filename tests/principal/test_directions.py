"""The family that follows principal directions."""

from __future__ import annotations

import math
from collections.abc import Callable

import pytest
import torch
from helpers import random_rotation
from principal_lattices import LATTICES, cone, relabelled

from torchfair import MeshError, ShapeError, Topology, TorchfairError
from torchfair._graph import edge_numbers
from torchfair.geometry import principal_directions
from torchfair.principal import (
    PrincipalEdges,
    misalignment_of,
    principal_edges_from_directions,
    principal_edges_from_seed,
)
from torchfair.principal import directions as directions_module
from torchfair.shapes import (
    Catenoid,
    Cylinder,
    PrincipalHelicoid,
    Torus,
    icosphere,
    irregular_triangles,
    principal_triangles,
)
from torchfair.subdivision import loop

every_lattice = pytest.mark.parametrize("name", LATTICES)


def flat_cone(sectors: int, rings: int) -> tuple[torch.Tensor, Topology]:
    """:func:`cone` in the plane, at equal angles."""
    topology = cone(sectors, rings)
    points = [[0.0, 0.0, 0.0]]
    for ring in range(1, rings + 1):
        for i in range(sectors * ring):
            corner, place = divmod(i, ring)
            ends = [math.tau * (corner + step) / sectors for step in (0, 1)]
            weights = [ring - place, place]
            points.append(
                [sum(w * f(a) for w, a in zip(weights, ends, strict=True)) for f in (math.cos, math.sin)] + [0.0]
            )
    return torch.tensor(points, dtype=torch.float64), topology


@every_lattice
def test_lattices_are_found_from_directions_of_the_surface(name: str) -> None:
    mesh, along = LATTICES[name]
    found = principal_edges_from_directions(mesh.vertices, mesh.topology, mesh.principal_directions)
    assert torch.equal(found.edges.mask, mesh.edges_along(along))
    assert found.misalignment < 0.01


@every_lattice
def test_lattices_are_found_from_directions_of_the_mesh(name: str) -> None:
    mesh, along = LATTICES[name]
    moved = 7.0 * mesh.vertices @ random_rotation(3).T
    found = principal_edges_from_directions(moved, mesh.topology)
    assert torch.equal(found.edges.mask, mesh.edges_along(along))


def test_the_direction_that_was_followed_is_reported() -> None:
    for along, expected in (("u", 0), ("v", 1)):  # u runs round the tube, along which it bends more
        mesh = principal_triangles(Cylinder(), 6, 12, along=along)
        found = principal_edges_from_directions(mesh.vertices, mesh.topology)
        assert found.misalignment < 1e-6
        assert found.chosen.tolist() == [expected] * mesh.topology.num_faces


def test_misalignment_is_the_angle_to_the_direction() -> None:
    vertices, topology = flat_cone(6, 4)
    for degrees in (0, 7, 20, 29):
        angle = math.radians(60 + degrees)
        direction = torch.tensor([math.cos(angle), math.sin(angle), 0.0]).double().expand_as(vertices)
        found = principal_edges_from_directions(vertices, topology, -3 * direction)
        assert found.misalignment == pytest.approx(math.radians(degrees), abs=1e-7)
        along = (vertices[topology.edges[:, 1]] - vertices[topology.edges[:, 0]])[found.edges.mask]
        assert (torch.linalg.cross(along, along[:1].expand_as(along)).abs() < 1e-12).all()


@pytest.mark.parametrize("along", ["u", "v"])
def test_misalignment_of_principal_lattices_falls_with_order_two(along: str) -> None:
    values = []
    for n in (2, 4, 8):
        mesh = principal_triangles(PrincipalHelicoid(), 6 * n, 8 * n, along=along)
        exact, computed = mesh.principal_directions, None
        values.append(
            [principal_edges_from_directions(mesh.vertices, mesh.topology, d).misalignment for d in (exact, computed)]
        )
    errors = torch.tensor(values)
    assert (errors[0] < 0.01).all()
    assert (errors[0] > 3.5 * errors[1]).all()
    assert (errors[1] > 3.5 * errors[2]).all()


def test_edges_along_circles_of_latitude_are_aligned_by_symmetry() -> None:
    """They bend in the surface, so directions at their two ends lie on either side."""
    mesh = principal_triangles(Catenoid(), 6, 8, along="u")
    assert principal_edges_from_directions(mesh.vertices, mesh.topology).misalignment < 1e-9


def families(topology: Topology) -> list[PrincipalEdges]:
    """All three, from the sides of one inner face."""
    inside = ~topology.is_boundary_vertex[topology.triangles].any(1)
    face = int(inside.nonzero()[0])
    return [principal_edges_from_seed(topology, topology.corner_edges[3 * face + side]) for side in range(3)]


def mean_angle_to_the_cross(vertices: torch.Tensor, edges: PrincipalEdges) -> float:
    """Edge by edge, at inner vertices only: the angle to the nearer direction."""
    directions, angles = principal_directions(vertices, edges.topology), []
    for v, w in edges.topology.edges[edges.mask].tolist():
        for end in (v, w):
            if not edges.topology.is_boundary_vertex[end]:
                x, y = (directions[end] @ (vertices[w] - vertices[v])).abs().tolist()
                angles.append(min(math.atan2(y, x), math.atan2(x, y)))
    return sum(angles) / len(angles)


def lattice_over(height: Callable[..., torch.Tensor], degrees: float) -> tuple[torch.Tensor, Topology]:
    """A lattice of equilateral triangles, turned, over a hexagon of width 2."""
    vertices, topology = flat_cone(6, 10)
    turn, (x, y, _) = math.radians(degrees), vertices.T
    x, y = math.cos(turn) * x - math.sin(turn) * y, math.sin(turn) * x + math.cos(turn) * y
    x, y = x / 10, y / 10
    return torch.stack([x, y, height(x, y)], dim=1), topology


HEIGHTS = {
    "hills and valleys": lambda x, y: 0.25 * torch.sin(3 * x) * torch.cos(3 * y),
    "waves": lambda x, y: 0.2 * torch.sin(4 * x) + 0.12 * torch.sin(4 * y),
    "dome": lambda x, y: -0.3 * x * x - 0.1 * y * y,
    "saddle": lambda x, y: 0.3 * x * x - 0.3 * y * y,
}


@pytest.mark.parametrize("degrees", [10, 45, 70])
@pytest.mark.parametrize("shape", HEIGHTS)
def test_the_family_nearest_to_the_cross_is_taken(shape: str, degrees: float) -> None:
    """Between hills and valleys d1 and d2 change places: each alone is pi/4 off every family."""
    vertices, topology = lattice_over(HEIGHTS[shape], degrees)
    naive = [mean_angle_to_the_cross(vertices, family) for family in families(topology)]
    found = principal_edges_from_directions(vertices, topology)
    assert mean_angle_to_the_cross(vertices, found.edges) == pytest.approx(min(naive))
    assert found.misalignment == pytest.approx(misalignment_of(vertices, found.edges), abs=1e-12)
    for family, angle in zip(families(topology), naive, strict=True):  # the same but for confidence and averaging
        assert misalignment_of(vertices, family) == pytest.approx(angle, abs=0.15)


def test_the_other_families_of_principal_lattices_are_far_off() -> None:
    for name, (mesh, along) in LATTICES.items():
        values = sorted(misalignment_of(mesh.vertices, family) for family in families(mesh.topology))
        right = PrincipalEdges(mesh.topology, mesh.edges_along(along))
        assert values[0] == pytest.approx(misalignment_of(mesh.vertices, right), abs=1e-12), name
        assert values[0] < 0.02, name
        assert values[1] > 0.2, name


def test_the_order_of_both_directions_does_not_matter_at_any_vertex() -> None:
    mesh, _ = LATTICES["Catenoid u zigzag"]
    directions = torch.as_tensor(mesh.principal_directions)
    swapped = torch.where((torch.arange(len(directions)) % 3 == 0)[:, None, None], directions.flip(1), directions)
    signs = 1.0 - 2.0 * (torch.arange(2 * len(directions)).reshape(-1, 2, 1) % 5 == 0)
    first, second = (
        principal_edges_from_directions(mesh.vertices, mesh.topology, d) for d in (directions, signs * swapped)
    )
    assert torch.equal(first.edges.mask, second.edges.mask)
    assert first.misalignment == pytest.approx(second.misalignment, abs=1e-12)


def test_directions_count_by_their_confidence() -> None:
    """Half of the directions are wrong by 60 degrees: with them alone another family follows them."""
    vertices, topology = flat_cone(6, 4)
    one = torch.tensor([1.0, 0.0, 0.0]).double().expand_as(vertices)
    other = torch.tensor([0.5, 0.75**0.5, 0.0]).double().expand_as(vertices)
    left = vertices[:, 0] < 0.0
    directions = torch.where(left[:, None], one, other)
    for trusted, along in ((left, one), (~left, other)):
        found = principal_edges_from_directions(vertices, topology, directions, confidence=trusted.double())
        edges = (vertices[topology.edges[:, 1]] - vertices[topology.edges[:, 0]])[found.edges.mask]
        assert torch.linalg.cross(edges, along[: len(edges)].expand_as(edges)).abs().max() < 1e-7
        assert found.misalignment < 1e-7
        scaled = principal_edges_from_directions(vertices, topology, directions, confidence=7.0 * trusted.double())
        assert scaled.misalignment == pytest.approx(found.misalignment, abs=1e-9)
    none = misalignment_of(vertices, found.edges, directions, confidence=torch.zeros(len(vertices)))
    assert none == 0.0


def test_spheres_and_flat_stars_do_not_count() -> None:
    vertices, topology = flat_cone(6, 6)
    assert principal_edges_from_directions(vertices, topology).misalignment == 0.0
    x = vertices[:, 0]
    bent = torch.stack([x, vertices[:, 1], 0.1 * x.clamp_min(0.0) ** 3], dim=1)
    assert principal_edges_from_directions(bent, topology).misalignment < 0.05
    mesh = icosphere(2)
    assert principal_edges_from_directions(mesh.vertices, mesh.topology, allow_exceptions=True).misalignment == 0.0


def test_each_component_chooses_for_itself() -> None:
    meshes = [principal_triangles(Catenoid(), 6, 10, along=along) for along in ("u", "v")]
    offset = meshes[0].topology.num_vertices
    topology = Topology.from_faces(torch.cat([meshes[0].topology.triangles, meshes[1].topology.triangles + offset]))
    found = principal_edges_from_directions(torch.cat([mesh.vertices for mesh in meshes]), topology)
    for mesh, along, shift in zip(meshes, ("u", "v"), (0, offset), strict=True):
        assert torch.equal(
            found.edges.mask[edge_numbers(topology, mesh.topology.edges + shift)], mesh.edges_along(along)
        )
    assert found.chosen[0] != found.chosen[-1]


def test_numbers_of_vertices_and_faces_do_not_matter() -> None:
    mesh = principal_triangles(Torus(), 6, 8)
    topology, new = relabelled(mesh.topology, 1)
    vertices = torch.empty_like(mesh.vertices)
    vertices[new] = mesh.vertices
    found = principal_edges_from_directions(vertices, topology)
    assert torch.equal(found.edges.mask[edge_numbers(topology, new[mesh.topology.edges])], mesh.edges_along("u"))


def test_edges_are_looked_at_in_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    mesh = irregular_triangles(Torus(), 300)
    whole = principal_edges_from_directions(mesh.vertices, mesh.topology, allow_exceptions=True)
    monkeypatch.setattr(directions_module, "_EDGES", 7)
    pieces = principal_edges_from_directions(mesh.vertices, mesh.topology, allow_exceptions=True)
    assert torch.equal(whole.edges.mask, pieces.edges.mask)
    assert torch.equal(whole.chosen, pieces.chosen)
    assert whole.misalignment == pytest.approx(pieces.misalignment, rel=1e-12)


def test_directions_are_only_needed_somewhere() -> None:
    vertices, topology = flat_cone(6, 3)
    direction = torch.zeros_like(vertices)
    direction[4, 0] = 1.0
    found = principal_edges_from_directions(vertices, topology, direction)
    assert found.edges.mask.sum() == topology.num_faces / 2 + 3  # three boundary edges are in one triangle only
    with pytest.raises(TorchfairError, match=r"directions: none in the component of face 0 \(vertex 0\)"):
        principal_edges_from_directions(vertices, topology, 0 * direction)


@pytest.mark.parametrize("cut", range(5))
def test_seams_run_where_directions_jump(cut: int) -> None:
    """A family carried round the apex of a cone of five sectors comes back as another one, at the ray of the cut."""
    rings = 6
    vertices, topology = flat_cone(5, rings)
    with pytest.raises(MeshError, match=r"vertices 0 \(valence 5\)"):
        principal_edges_from_directions(vertices, topology)
    sectors = torch.atan2(vertices[:, 1], vertices[:, 0]) / (math.tau / 5) - cut
    angle = math.radians(72 * cut) + math.radians(72 - 60) * (sectors % 5)
    direction = torch.stack([angle.cos(), angle.sin(), 0 * angle], dim=1)
    found = principal_edges_from_directions(vertices, topology, direction, allow_exceptions=True)
    ring = torch.arange(1, rings + 1).repeat_interleave(5 * torch.arange(1, rings + 1))
    places = ((sectors[1:] + 2.5) % 5 - 2.5) * ring  # from the ray of the cut, in edges
    at_exceptions = places[found.edges.exceptions - 1]
    assert at_exceptions.numel() >= rings - 1
    assert at_exceptions.abs().max() < 1.4
    assert found.misalignment < 0.13


def test_spheres_have_no_directions_and_still_a_choice() -> None:
    mesh = icosphere(2)
    vertices, topology = mesh.vertices, mesh.topology
    with pytest.raises(MeshError, match="around 12 singular"):
        principal_edges_from_directions(vertices, topology)
    found = principal_edges_from_directions(vertices, topology, allow_exceptions=True)
    assert found.edges.exceptions.numel() < topology.num_vertices
    finer = found.edges.refine(loop(topology))
    assert finer.exceptions.numel() < 4 * found.edges.exceptions.numel()


def test_bad_input() -> None:
    vertices, topology = flat_cone(6, 2)
    with pytest.raises(ShapeError, match="directions: expected"):
        principal_edges_from_directions(vertices, topology, vertices[:4])
    with pytest.raises(ShapeError, match="vertices: expected one mesh"):
        principal_edges_from_directions(vertices[None], topology)
    bad = vertices.clone()
    bad[3, 1] = math.nan
    with pytest.raises(TorchfairError, match="directions: some are not finite"):
        principal_edges_from_directions(vertices, topology, bad)
    with pytest.raises(TorchfairError, match="vertices: some are not finite"):
        principal_edges_from_directions(bad, topology)
    with pytest.raises(ShapeError, match="confidence: expected"):
        principal_edges_from_directions(vertices, topology, confidence=torch.ones(3))
    with pytest.raises(TorchfairError, match="confidence: some are negative"):
        principal_edges_from_directions(vertices, topology, confidence=-torch.ones(len(vertices)))
    nothing = Topology.from_faces([], num_vertices=2)
    found = principal_edges_from_directions(torch.zeros(2, 3), nothing)
    assert found.misalignment == 0
    assert found.edges.mask.shape == found.chosen.shape == (0,)
