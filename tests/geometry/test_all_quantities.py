"""What holds for every geometric quantity: batches, derivatives, invariances, degenerate input, compilation."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass

import hypothesis.strategies as st
import pytest
import torch
from geometry_meshes import DEGENERATE, GENERIC, mixed_grid, with_isolated
from helpers import random_rotation
from hypothesis import given, settings
from pretended_device import PRETENDED, PretendedDevice
from torch import Tensor

import torchfair.geometry as geometry
from torchfair import ShapeError, Topology


@dataclass(frozen=True)
class Quantity:
    """A quantity with its laws: ``per`` element, ``power`` of the scale, rank as a tensor in space."""

    function: Callable[[Tensor, Topology], Tensor]
    per: str
    power: int
    rank: int = 0
    odd: bool = False  # changes sign when all faces are turned round
    directed: bool = False  # changes sign when an edge runs the other way

    def __call__(self, vertices: Tensor, topology: Topology) -> Tensor:
        return self.function(vertices, topology)


QUANTITIES = {
    "edge_vectors": Quantity(geometry.edge_vectors, "edge", 1, rank=1, directed=True),
    "edge_lengths": Quantity(geometry.edge_lengths, "edge", 1),
    "face_area_vectors": Quantity(geometry.face_area_vectors, "face", 2, rank=1, odd=True),
    "face_areas": Quantity(geometry.face_areas, "face", 2),
    "face_normals": Quantity(geometry.face_normals, "face", 0, rank=1, odd=True),
    "vertex_normals": Quantity(geometry.vertex_normals, "vertex", 0, rank=1, odd=True),
    "dihedral_angles": Quantity(geometry.dihedral_angles, "edge", 0, odd=True),
    "dual_edge_lengths": Quantity(geometry.dual_edge_lengths, "edge", 0),
    "corner_angles": Quantity(geometry.corner_angles, "corner", 0),
    "angle_defects": Quantity(geometry.angle_defects, "vertex", 0),
    "mean_curvature_vectors": Quantity(geometry.mean_curvature_vectors, "vertex", 1, rank=1),
    "shape_operators": Quantity(geometry.shape_operators, "vertex", 1, rank=2, odd=True),
    "shape_operators_angle": Quantity(
        lambda vertices, topology: geometry.shape_operators(vertices, topology, sine=False), "vertex", 1, 2, odd=True
    ),
    "corrected_shape_operators": Quantity(geometry.corrected_shape_operators, "vertex", 1, rank=2, odd=True),
    "nuclear_norms": Quantity(
        lambda vertices, t: geometry.nuclear_norms(geometry.tangential_shape_operators(vertices, t)), "vertex", 1
    ),
    "frobenius_norms": Quantity(
        lambda vertices, t: geometry.frobenius_norms(geometry.tangential_shape_operators(vertices, t)), "vertex", 1
    ),
    "star_normals": Quantity(geometry.star_normals, "vertex", 0, rank=1, odd=True),
    "balanced_normals": Quantity(geometry.balanced_normals, "vertex", 0, rank=1, odd=True),
    "offset_directions": Quantity(geometry.offset_directions, "vertex", 0, rank=1, odd=True),
    "conical_deviations": Quantity(geometry.conical_deviations, "vertex", 0),
    "vertex_areas": Quantity(geometry.vertex_areas, "vertex", 2),
    "gauss_image": Quantity(lambda vertices, t: geometry.gauss_image(vertices, t).points, "face", 0, rank=1, odd=True),
    "umbrella_vectors": Quantity(geometry.umbrella_vectors, "vertex", 1, rank=1),
}
COUNTS = {
    "edge": lambda t: t.num_edges,
    "face": lambda t: t.num_faces,
    "vertex": lambda t: t.num_vertices,
    "corner": lambda t: t.corners.shape[0],
}

every_quantity = pytest.mark.parametrize("quantity", QUANTITIES.values(), ids=QUANTITIES.keys())
every_mesh = pytest.mark.parametrize("mesh", GENERIC.values(), ids=GENERIC.keys())
every_degenerate_mesh = pytest.mark.parametrize("mesh", DEGENERATE.values(), ids=DEGENERATE.keys())


@every_quantity
@every_mesh
def test_batches_equal_loops_and_vmap_in_both_dtypes(quantity, mesh):
    vertices, topology = mesh()
    batch = torch.stack([vertices * s + 0.1 * s**2 * vertices.roll(1, 0) for s in range(1, 7)]).unflatten(0, (2, 3))
    for dtype in (torch.float32, torch.float64):
        some = batch.to(dtype)
        together = quantity(some, topology)
        assert together.dtype == dtype
        per = COUNTS[quantity.per](topology)
        expected = topology.num_interior_edges if together.shape[2] != per and quantity.per == "edge" else per
        assert together.shape == (2, 3, expected) + (3,) * quantity.rank
        alone = torch.stack([torch.stack([quantity(v, topology) for v in row]) for row in some])
        mapped = torch.func.vmap(lambda v: quantity(v, topology))(some.flatten(0, 1)).unflatten(0, (2, 3))
        torch.testing.assert_close(together, alone)
        torch.testing.assert_close(together, mapped)


@every_quantity
@every_mesh
def test_is_the_same_on_another_device_and_does_not_wait_for_it(quantity, mesh, device):
    vertices, topology = mesh()

    def gradient(points: Tensor, connectivity: Topology) -> tuple[Tensor, Tensor]:
        variable = points.clone().requires_grad_()
        value = quantity(variable, connectivity)
        value.square().sum().backward()
        return value.detach(), variable.grad

    there, moved = vertices.to(device), topology.to(device)
    with PretendedDevice(strict=True) if device == PRETENDED else nullcontext():
        found = gradient(there, moved)
    for mine, other in zip(gradient(vertices, topology), found, strict=True):
        assert other.device == device
        torch.testing.assert_close(other.cpu(), mine)


@every_quantity
@every_mesh
def test_gradcheck(quantity, mesh):
    vertices, topology = mesh()
    if topology.num_vertices > 20:  # the mixed mesh: the part around its hexagon is enough
        moved = torch.zeros(topology.num_vertices, dtype=torch.bool)
        moved[[6, 7, 12, 13]] = True
        vertices = vertices.clone()

        def function(part: Tensor) -> Tensor:
            return quantity(vertices.index_put((moved,), part), topology)

        start = vertices[moved].clone().requires_grad_()
    else:
        start = vertices.clone().requires_grad_()

        def function(part: Tensor) -> Tensor:
            return quantity(part, topology)

    assert torch.autograd.gradcheck(function, start, fast_mode=True, check_forward_ad=True)
    assert torch.autograd.gradgradcheck(function, start, fast_mode=True)


@every_quantity
def test_forward_and_reverse_mode_agree(quantity):
    vertices, topology = GENERIC["quads"]()
    reverse = torch.func.jacrev(quantity)(vertices, topology)
    forward = torch.func.jacfwd(quantity)(vertices, topology)
    torch.testing.assert_close(reverse, forward)


@every_quantity
@every_mesh
def test_moves_with_the_mesh(quantity, mesh):
    vertices, topology = mesh()
    rotation = random_rotation(3)
    moved = 2.5 * vertices @ rotation.T + torch.tensor([1.0, -2, 3], dtype=vertices.dtype)
    expected = quantity(vertices, topology) * 2.5**quantity.power
    if quantity.rank:
        expected = expected @ rotation.T
    if quantity.rank == 2:
        expected = rotation @ expected
    torch.testing.assert_close(quantity(moved, topology), expected)


def by_name(
    quantity: Quantity, mesh: tuple[Tensor, Topology], vertex_names: list[int], face_names: list[int]
) -> Tensor:
    """Values sorted by the names of their elements; edges and corners are named by their vertices and face."""
    topology = mesh[1]
    values = quantity(*mesh)
    ends = [(vertex_names[v], vertex_names[w]) for v, w in topology.edges.tolist()]
    corners = zip(topology.corner_faces.tolist(), topology.corners.tolist(), strict=True)
    names: dict[str, list] = {
        "vertex": vertex_names,
        "face": face_names,
        "corner": [(face_names[f], vertex_names[v]) for f, v in corners],
        "edge": [sorted(pair) for pair in ends],
    }
    if quantity.directed:
        values = values * torch.tensor([1.0 if v < w else -1.0 for v, w in ends], dtype=values.dtype)[:, None]
    return values[sorted(range(len(values)), key=names[quantity.per].__getitem__)]


@every_quantity
@every_mesh
def test_does_not_depend_on_numbering(quantity, mesh):
    vertices, topology = mesh()
    random = torch.Generator().manual_seed(5)
    old_vertex = torch.randperm(topology.num_vertices, generator=random)
    old_face = torch.randperm(topology.num_faces, generator=random).tolist()
    new_vertex = old_vertex.argsort().tolist()
    lists = topology.face_lists()
    faces = [[new_vertex[v] for v in lists[f][1:] + lists[f][:1]] for f in old_face]
    relabelled = vertices[old_vertex], Topology.from_faces(faces, topology.num_vertices)
    old = by_name(quantity, (vertices, topology), list(range(topology.num_vertices)), list(range(topology.num_faces)))
    torch.testing.assert_close(by_name(quantity, relabelled, old_vertex.tolist(), old_face), old)


@every_quantity
@every_mesh
def test_turning_all_faces_round(quantity, mesh):
    vertices, topology = mesh()
    turned = Topology.from_faces([face[::-1] for face in topology.face_lists()], topology.num_vertices)
    names = list(range(topology.num_vertices)), list(range(topology.num_faces))
    old, new = (by_name(quantity, (vertices, each), *names) for each in (topology, turned))
    torch.testing.assert_close(new, -old if quantity.odd else old)


@every_quantity
@every_degenerate_mesh
def test_finite_with_all_derivatives_on_degenerate_meshes(quantity, mesh):
    vertices, topology = mesh()
    check_finite(quantity, vertices, topology)
    for scale in (1e-200, 1e20):
        check_finite(quantity, vertices * scale, topology)


@settings(max_examples=10, deadline=None)
@given(coordinates=st.lists(st.integers(-1, 1), min_size=48, max_size=48), quads=st.booleans())
def test_finite_on_lattice_points(coordinates, quads):
    """Few places for many vertices: coincident and collinear corners, flat and folded edges abound."""
    _, topology = GENERIC["quads"]() if quads else GENERIC["triangles"]()
    vertices = torch.tensor(coordinates, dtype=torch.float64).view(-1, 3)[: topology.num_vertices]
    for quantity in QUANTITIES.values():
        check_finite(quantity, vertices, topology)


@every_quantity
@pytest.mark.parametrize("scale", [1e-10, 1e-15, 1e-19, 1e-20, 1e-22, 1e-30])
def test_gradients_stay_finite_where_squares_underflow_in_single_precision(quantity, scale):
    vertices, topology = mixed_grid()
    variable = (vertices * scale).float().requires_grad_()
    value = quantity(variable, topology)
    (gradient,) = torch.autograd.grad(value.sum(), variable)
    assert value.isfinite().all()
    assert gradient.isfinite().all()


@every_quantity
def test_second_derivatives_of_small_meshes_in_single_precision(quantity):
    vertices, topology = mixed_grid()
    scale = 1e-8 if quantity.function in (geometry.face_normals, geometry.dual_edge_lengths) else 1e-6
    direction = torch.linspace(-1, 1, vertices.numel(), dtype=vertices.dtype).view_as(vertices).sin()

    value = quantity(vertices, topology)  # fills the tables of the topology, outside of the transforms
    weights = torch.linspace(1, 2, value.numel(), dtype=vertices.dtype).view_as(value)

    def bend(points: Tensor, along: Tensor) -> Tensor:
        slope = torch.func.grad(lambda p: (quantity(p, topology) * weights.to(p.dtype)).sum())
        return torch.func.vjp(slope, points)[1](along)[0]

    small = bend((vertices * scale).float(), (direction * scale).float()).double()
    expected = bend(vertices, direction) * scale ** (quantity.power - 1)
    unit = expected.abs().max().clamp(min=1e-30)  # zero for quantities linear in the vertices
    torch.testing.assert_close(small / unit, expected / unit, rtol=0, atol=1e-3)


def check_finite(quantity: Callable[[Tensor, Topology], Tensor], vertices: Tensor, topology: Topology) -> None:
    """Value, reverse, forward and second derivatives along one direction are finite."""
    direction = torch.linspace(-1, 1, vertices.numel(), dtype=vertices.dtype).view_as(vertices).sin()
    value, along = torch.func.jvp(lambda v: quantity(v, topology), (vertices,), (direction,))
    assert value.isfinite().all()
    assert along.isfinite().all()
    variable = vertices.clone().requires_grad_()
    weights = torch.linspace(1, 2, value.numel(), dtype=vertices.dtype).view_as(value)
    (gradient,) = torch.autograd.grad((quantity(variable, topology) * weights).sum(), variable, create_graph=True)
    assert gradient.isfinite().all()
    if gradient.requires_grad and vertices.abs().max() > 1e-3:  # second derivatives overflow on tiny meshes
        (second,) = torch.autograd.grad((gradient * direction).sum(), variable, allow_unused=True)
        assert second is None or second.isfinite().all()


@every_quantity
def test_isolated_vertices_change_nothing(quantity):
    vertices, topology = mixed_grid()
    value = quantity(vertices, topology)
    more = quantity(*with_isolated((vertices, topology)))
    torch.testing.assert_close(more[: value.shape[0]], value)
    assert not more[value.shape[0] :].any()


@pytest.mark.parametrize(
    ("mesh", "names"), [("triangles", QUANTITIES.keys()), ("mixed", ["dihedral_angles", "angle_defects"])]
)
def test_compile_to_one_graph(mesh, names):
    torch._dynamo.reset()
    vertices, topology = GENERIC[mesh]()

    def everything(vertices: Tensor) -> list[Tensor]:
        return [QUANTITIES[name].function(vertices, topology) for name in names]

    expected = everything(vertices)  # also fills the tables of the topology
    compiled = torch.compile(everything, fullgraph=True, backend="eager")
    torch.testing.assert_close(compiled(vertices), expected)


@every_quantity
def test_refuses_wrong_shapes(quantity):
    vertices, topology = mixed_grid()
    with pytest.raises(ShapeError, match=r"expected a floating tensor \(\*batch, 25, 3\), got \(24, 3\)"):
        quantity(vertices[1:], topology)
    with pytest.raises(ShapeError, match=r"got \(25, 3\) torch.int64"):
        quantity(vertices.long(), topology)


@every_quantity
@pytest.mark.parametrize("size", [2.0**-44, 2.0**44])
def test_holds_for_any_size_in_single_precision(quantity, size):
    """Squares of areas are beyond the range of float32: faces passed for degenerate, with no normals."""
    vertices, topology = GENERIC["triangles"]()
    single = vertices.float()
    expected = quantity(single, topology).double() * size**quantity.power
    found = quantity(size * single, topology).double()
    torch.testing.assert_close(found, expected, rtol=1e-3, atol=1e-4 * float(expected.abs().max()))


@every_quantity
@pytest.mark.filterwarnings("ignore:geometry in torch:UserWarning")
def test_leaves_half_precision_at_once(quantity):
    vertices, topology = GENERIC["quads"]()
    coarse = vertices.bfloat16()
    with torch.autocast("cpu", torch.bfloat16):
        found = quantity(coarse, topology)
    assert found.dtype == torch.float32
    assert torch.equal(found, quantity(coarse.float(), topology))


def test_half_precision_is_warned_of():
    vertices, topology = GENERIC["quads"]()
    with pytest.warns(UserWarning, match=r"geometry in torch.float16: .*Keep vertices in float32"):
        geometry.face_normals(vertices=vertices.half(), topology=topology)
