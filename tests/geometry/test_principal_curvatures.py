from __future__ import annotations

import math

import pytest
import torch
from geometry_meshes import DEGENERATE, GENERIC, flat_squares, mixed_grid, with_isolated
from helpers import DOUBLE, random_rotation

from torchfair import Topology
from torchfair.geometry import (
    Patches,
    principal_directions,
    principal_values,
    star_normals,
    tangent_bases,
    tangential_shape_operators,
    vertex_areas,
)
from torchfair.shapes import (
    Catenoid,
    Cylinder,
    Enneper,
    Helicoid,
    Hyperboloid,
    Torus,
    icosphere,
    parameter_quads,
    principal_quads,
    rotated_lattice,
)

ESTIMATORS = {
    "sine": {"estimator": "normal_cycle", "sine": True},
    "angle": {"estimator": "normal_cycle", "sine": False},
    "corrected": {"estimator": "corrected"},
}
each_star_estimator = pytest.mark.parametrize("choice", ESTIMATORS.values(), ids=ESTIMATORS.keys())
ESTIMATORS = {"fitted": {"rings": 2}, **ESTIMATORS}
each_estimator = pytest.mark.parametrize("choice", ESTIMATORS.values(), ids=ESTIMATORS.keys())
SURFACES = {
    "torus": Torus(2.0, 0.8),
    "catenoid": Catenoid(),
    "hyperboloid": Hyperboloid(),
    "enneper": Enneper(),
    "helicoid": Helicoid(),
}


def inside(mesh, rings: int) -> torch.Tensor:
    """Vertices farther from the boundary than ``rings`` edges."""
    near = mesh.topology.is_boundary_vertex.clone()
    v, w = mesh.topology.edges.unbind(1)
    for _ in range(rings):
        near = near.index_put((torch.cat([v[near[w]], w[near[v]]]),), torch.tensor(True))
    return ~near


@each_estimator
@pytest.mark.parametrize("surface", SURFACES.values(), ids=SURFACES.keys())
def test_curvatures_and_directions_of_surfaces(surface, choice):
    """On a lattice askew to the principal directions, away from its boundary band, both come out."""
    mesh = rotated_lattice(surface, 24, 40, 0.3)
    far = inside(mesh, 3)
    areas = vertex_areas(mesh.vertices, mesh.topology)
    curvatures = principal_values(mesh.vertices, mesh.topology, **choice) / areas[:, None]
    exact = mesh.principal_curvatures
    size = exact.abs().max()
    assert (curvatures - exact)[far].abs().max() < 0.08 * size
    found = principal_directions(mesh.vertices, mesh.topology, **choice)
    cosines = (found * mesh.principal_directions).sum(-1).abs()[far]
    distinct = (exact[:, 0] - exact[:, 1])[far] > 0.3 * size
    assert distinct.sum() > 100
    assert cosines[distinct].min() > math.cos(math.radians(4))


@each_star_estimator
def test_a_tube_bends_round_its_axis(choice):
    mesh = principal_quads(Cylinder(0.5, 2.0), 8, 32)
    values = principal_values(mesh.vertices, mesh.topology, **choice)
    first, second = principal_directions(mesh.vertices, mesh.topology, **choice).unbind(1)
    far = inside(mesh, 1)
    assert (values[far, 0] > 0).all()
    assert values[far, 1].abs().max() < 1e-12
    torch.testing.assert_close(second[far, 2].abs(), torch.ones(int(far.sum()), dtype=DOUBLE))
    assert first[far, 2].abs().max() < 1e-9


@each_star_estimator
@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
def test_values_are_the_eigenvalues_and_directions_the_turned_eigenvectors(choice, mesh):
    vertices, topology = mesh()
    bases = tangent_bases(star_normals(vertices, topology))
    plane = tangential_shape_operators(vertices, topology, **choice)
    values = principal_values(vertices, topology, **choice)
    torch.testing.assert_close(values, torch.linalg.eigvalsh(plane).flip(-1))
    first, second = principal_directions(vertices, topology, **choice).unbind(-2)
    operators = bases.mT @ plane @ bases
    torch.testing.assert_close((operators @ second[..., None])[..., 0], values[..., :1] * second)
    torch.testing.assert_close((operators @ first[..., None])[..., 0], values[..., 1:] * first)


@each_star_estimator
@pytest.mark.parametrize("mesh", [*GENERIC.values(), *DEGENERATE.values()], ids=[*GENERIC, *DEGENERATE])
def test_right_handed_frames_or_zero_and_finite_derivatives(choice, mesh):
    vertices, topology = mesh()
    normals = star_normals(vertices, topology)
    directions = principal_directions(vertices, topology, **choice)
    first, second = directions.unbind(-2)
    torch.testing.assert_close(torch.linalg.cross(first, second), normals)
    lengths = torch.linalg.vector_norm(normals, dim=-1, keepdim=True).expand(*normals.shape[:-1], 2)
    torch.testing.assert_close(torch.linalg.vector_norm(directions, dim=-1), lengths)
    for function in (principal_values, principal_directions):
        variable = vertices.clone().requires_grad_()
        weights = torch.linspace(1, 2, function(vertices, topology, **choice).numel(), dtype=DOUBLE)
        value = (function(variable, topology, **choice).flatten() * weights).sum()
        (gradient,) = torch.autograd.grad(value, variable)
        assert gradient.isfinite().all()


@each_star_estimator
@pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
def test_gradcheck(choice, mesh):
    vertices, topology = mesh()

    def lines(points: torch.Tensor) -> torch.Tensor:
        """Values and the projections onto directions, in which the sign has dropped out."""
        directions = principal_directions(points, topology, **choice)[4:9]
        values = principal_values(points, topology, **choice)
        return torch.cat([(directions[..., None] * directions[..., None, :]).flatten(), values.flatten()])

    if topology.num_vertices < 5:  # the regular tetrahedron: umbilics, where directions jump

        def lines(points: torch.Tensor) -> torch.Tensor:
            return principal_values(points, topology, **choice).sum(-1)

    assert torch.autograd.gradcheck(lines, vertices.clone().requires_grad_(), fast_mode=True, check_forward_ad=True)


def test_umbilics_and_flat_stars_have_the_tangent_basis():
    for mesh in (flat_squares(), (icosphere(0).vertices, icosphere(0).topology)):
        bases = tangent_bases(star_normals(*mesh))
        torch.testing.assert_close(principal_directions(*mesh), bases)


def test_isolated_vertices_have_nothing():
    vertices, topology = with_isolated(mixed_grid())
    assert not principal_values(vertices, topology)[-1].any()
    assert not principal_directions(vertices, topology)[-1].any()


@each_estimator
def test_move_with_the_mesh_and_turn_with_its_faces(choice):
    mesh = rotated_lattice(Enneper(), 10, 12, 0.4)
    vertices, topology = mesh.vertices, mesh.topology
    rotation = random_rotation(2)
    moved = 2.5 * vertices @ rotation.T + 3
    values, directions = (f(vertices, topology, **choice) for f in (principal_values, principal_directions))
    clear = values[:, 0] - values[:, 1] > 1e-9  # but for corners, which no interior edge meets
    one = torch.ones_like(values[clear])
    torch.testing.assert_close(principal_values(moved, topology, **choice), 2.5 * values)
    turned = principal_directions(moved, topology, **choice)
    torch.testing.assert_close((turned * (directions @ rotation.T)).sum(-1).abs()[clear], one)
    reverse = Topology.from_faces([face[::-1] for face in topology.face_lists()], topology.num_vertices)
    torch.testing.assert_close(principal_values(vertices, reverse, **choice), -values.flip(-1))
    other = principal_directions(vertices, reverse, **choice).flip(-2)
    torch.testing.assert_close((other * directions).sum(-1).abs()[clear], one)


@each_estimator
def test_batches_vmap_and_single_precision(choice):
    mesh = parameter_quads(Torus(2.0, 0.8), 8, 12)
    batch = torch.stack([mesh.vertices, mesh.vertices * torch.tensor([1.0, 1.2, 0.9], dtype=DOUBLE)])
    for function in (principal_values, principal_directions):
        together = function(batch, mesh.topology, **choice)
        torch.testing.assert_close(together[1], function(batch[1], mesh.topology, **choice))
        mapped = torch.func.vmap(lambda v, f=function: f(v, mesh.topology, **choice))(batch)
        torch.testing.assert_close(mapped, together)
        assert function(batch.float(), mesh.topology, **choice).dtype == torch.float32


@pytest.mark.slow
@each_estimator
def test_compile_to_one_graph(choice):
    torch._dynamo.reset()
    mesh = parameter_quads(Torus(2.0, 0.8), 8, 12)
    compiled = torch.compile(principal_directions, fullgraph=True, backend="eager")
    if "rings" in choice:
        choice = {"rings": Patches(mesh.topology, 2)}
    expected = principal_directions(mesh.vertices, mesh.topology, **choice)
    torch.testing.assert_close(compiled(mesh.vertices, mesh.topology, **choice), expected)
