"""Joined topologies: every energy, penalty and score is that of the meshes alone."""

from __future__ import annotations

import pickle
from collections.abc import Callable

import loss_cases
import numpy as np
import pytest
import torch
from helpers import DOUBLE, wavy_grid
from mesh_shelf import SHELF, same
from torch import Tensor

from torchfair import MeshError, Topology, constraints, energies, reflection, stars
from torchfair.shapes import icosphere

Mesh = tuple[Tensor, Topology]


def sphere() -> Mesh:
    mesh = icosphere(1)
    noise = torch.linspace(-1, 1, mesh.vertices.numel(), dtype=DOUBLE).mul(7).sin().view_as(mesh.vertices)
    return mesh.vertices + 0.05 * noise, mesh.topology


def with_isolated_vertices() -> Mesh:
    """Quads and triangles, and vertices without faces in front, between and behind."""
    vertices, topology = wavy_grid(3, 4)
    faces = [[v + 1 + (v > 5) for v in face] for face in topology.face_lists()]
    faces[0:1] = [[faces[0][0], faces[0][1], faces[0][2]], [faces[0][0], faces[0][2], faces[0][3]]]
    count = vertices.shape[0]
    places = torch.tensor([v + 1 + (v > 5) for v in range(count)])
    padded = torch.full((count + 4, 3), 0.3, dtype=DOUBLE)
    padded[places] = vertices
    return padded, Topology.from_faces(faces, count + 4)


MESHES: list[Mesh] = [sphere(), wavy_grid(5, 4, triangles=True), with_isolated_vertices(), wavy_grid(4, 6)]
JOINED = Topology.join(topology for _, topology in MESHES)
VERTICES = torch.cat([vertices for vertices, _ in MESHES])
SIZES = [vertices.shape[0] for vertices, _ in MESHES]

Loss = Callable[[Tensor], Tensor]


def weighted(topology: Topology) -> Tensor:
    """Weights of edges that say which edge they are of, in whatever mesh: by the numbers of their ends."""
    firsts = torch.zeros(1, dtype=torch.int64) if topology.mesh_offsets is None else topology.mesh_offsets
    edges = topology.interior_edges - firsts[topology.edge_meshes[: topology.num_interior_edges]][:, None]
    return (edges * torch.tensor([1.0, 2.0], dtype=DOUBLE)).sum(1).sin().square()


def of_constraint(make: Callable[[Topology], constraints.Constraint]) -> Callable[[Topology], Loss]:
    def loss(topology: Topology) -> Loss:
        constraint = make(topology)
        return lambda vertices: constraint.per_mesh(vertices, topology)

    return loss


def of_function(function: Callable[..., Tensor]) -> Callable[[Topology], Loss]:
    return lambda topology: lambda vertices: function(vertices, topology)


def one_view(values: Tensor, topology: Topology) -> Tensor:
    """(*batch, views, n) or (*batch, views) of the second view."""
    return values.select(-2 if topology.is_joined else -1, 1)


EYES = torch.tensor([[0.0, 0, 5], [3, 1, 4]], dtype=DOUBLE)
CAMERA_OF = reflection.ReflectionSetup.for_reference(wavy_grid(5, 5), size=16, supersampling=1)
LOSSES: dict[str, Callable[[Topology], Loss]] = {
    **loss_cases.LOSSES,
    "E, weighted": lambda t: energies.NormalVariation(t, weighted(t)),
    "mean curvature, weighted": lambda t: energies.TotalMeanCurvature(t, weighted(t)),
    "pictures": lambda t: reflection.ReflectionLoss(t, CAMERA_OF, size=16, variation_weight=0.5),
    "pictures, no reference": lambda t: reflection.ReflectionLoss(
        t, CAMERA_OF.without_reference(), size=16, variation_weight=0.5
    ),
    "planarity": of_constraint(constraints.Planarity),
    "smooth E": of_constraint(lambda t: constraints.SmoothNormalVariation(t, smoothing=0.1)),
    "interior fairness": of_constraint(constraints.InteriorFairness),
    "straight fairness": of_constraint(constraints.StraightFairness),
    "tangential fairness": of_constraint(constraints.TangentialFairness),
    "flat edges": of_constraint(lambda t: constraints.FlatEdges(t, torch.arange(t.num_interior_edges))),
    "normal pyramids": of_constraint(constraints.NormalPyramids),
    "corner angles": of_constraint(
        lambda t: constraints.CornerAngles(t, 0.01, torch.full(t.corners.shape, 2.0, dtype=DOUBLE))
    ),
    "E, function": of_function(energies.normal_variation),
    "E', function": of_function(energies.angle_variation),
    "mean curvature, function": of_function(energies.total_mean_curvature),
    "C, function": of_function(energies.total_absolute_curvature),
    "C2, function": of_function(energies.total_frobenius_curvature),
    "Willmore, function": of_function(energies.willmore_energy),
    "umbrella, function": of_function(energies.umbrella_fairness),
    "polylines, function": of_function(energies.polyline_fairness),
    "pyramids, function": of_function(stars.pyramid_penalty),
    "saddles, function": of_function(stars.saddle_penalty),
    "views, function": of_function(lambda v, t: one_view(reflection.reflection_variation(v, t), t)),
    "eyes, function": of_function(lambda v, t: one_view(reflection.reflection_variation_from_eyes(v, t, EYES), t)),
}
PICTURES = ("pictures", "pictures, no reference")
every_loss = pytest.mark.parametrize("name", LOSSES)
each_differentiable = pytest.mark.parametrize("name", [name for name in LOSSES if name not in PICTURES])


def alone(name: str, vertices: Tensor) -> Tensor:
    """The values of the meshes one by one, (..., n)."""
    parts = torch.split(vertices, SIZES, -2)
    return torch.stack([LOSSES[name](t)(part) for (_, t), part in zip(MESHES, parts, strict=True)], -1)


def gradient(loss: Loss, at: Tensor) -> Tensor:
    variable = at.clone().requires_grad_()
    value = loss(variable)
    factors = torch.linspace(1, 2, value.numel(), dtype=value.dtype).view(value.shape)
    (slope,) = torch.autograd.grad((value * factors).sum(), variable)
    return slope


@every_loss
def test_values_are_those_of_the_meshes_alone(name: str) -> None:
    value = LOSSES[name](JOINED)(VERTICES)
    assert value.shape[-1] == len(MESHES)
    torch.testing.assert_close(value, alone(name, VERTICES), rtol=1e-12, atol=1e-14)


@every_loss
def test_gradients_are_those_of_the_meshes_alone(name: str) -> None:
    """With another factor for each mesh, which an exchange of meshes would not survive."""
    together = gradient(LOSSES[name](JOINED), VERTICES)
    torch.testing.assert_close(together, gradient(lambda v: alone(name, v), VERTICES), rtol=1e-9, atol=1e-11)
    assert together.abs().sum() > 0


@every_loss
@pytest.mark.parametrize("batch", [(2,), (0,), (1, 3)])
def test_batches_lead(name: str, batch: tuple[int, ...]) -> None:
    vertices = VERTICES.expand(*batch, -1, -1)
    value = LOSSES[name](JOINED)(vertices)
    torch.testing.assert_close(value, alone(name, vertices), rtol=1e-12, atol=1e-14)


@each_differentiable
def test_under_transforms(name: str) -> None:
    """Those that a training loop nests: ``vmap``, ``grad`` twice, forward mode."""
    loss, expected = LOSSES[name](JOINED), LOSSES[name](JOINED)(VERTICES)
    direction = VERTICES.mul(3).sin()
    batch = torch.stack([VERTICES, VERTICES + 1e-3 * direction])
    torch.testing.assert_close(torch.func.vmap(loss)(batch), torch.stack([loss(v) for v in batch]))
    value, rate = torch.func.jvp(loss, (VERTICES,), (direction,))
    torch.testing.assert_close(value, expected)
    torch.testing.assert_close(rate.sum(), (direction * torch.func.grad(lambda v: loss(v).sum())(VERTICES)).sum())

    def slope(v: Tensor) -> Tensor:
        return (torch.func.grad(lambda w: loss(w).sum())(v) * direction).sum()

    variable = VERTICES.clone().requires_grad_()
    (first,) = torch.autograd.grad(loss(variable).sum(), variable, create_graph=True)
    (second,) = torch.autograd.grad((first * direction).sum(), variable, materialize_grads=True)
    torch.testing.assert_close(torch.func.grad(slope)(VERTICES), second, rtol=1e-6, atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["E", "E, weighted", "C", "umbrella", "polylines", "pyramids", "reflection variation"])
def test_compiles_to_one_graph(name: str) -> None:
    torch._dynamo.reset()
    loss = LOSSES[name](JOINED)
    compiled = torch.compile(loss, backend="aot_eager", fullgraph=True)
    torch.testing.assert_close(compiled(VERTICES), loss(VERTICES))
    torch.testing.assert_close(gradient(compiled, VERTICES), gradient(loss, VERTICES))


@pytest.mark.parametrize("name", ["E", "E'", "C", "C2, corrected", "umbrella", "reflection variation", "saddles"])
@pytest.mark.parametrize("scale", [1e-8, 1e8])
def test_meshes_of_very_different_sizes_keep_theirs(name: str, scale: float) -> None:
    """In single precision, where squares of small ones vanish beside large ones: each has its own unit of length."""
    scales = torch.tensor([scale, 1.0, 1 / scale, 3.0]).repeat_interleave(torch.tensor(SIZES))
    vertices = VERTICES.float() * scales[:, None]
    torch.testing.assert_close(LOSSES[name](JOINED)(vertices), alone(name, vertices), rtol=1e-4, atol=0.0)
    assert (alone(name, vertices)[[0, 2]] > 0).all()


def test_one_broken_mesh_does_not_spoil_the_others() -> None:
    vertices = VERTICES.clone()
    vertices[0] = torch.nan
    value = energies.NormalVariation(JOINED)(vertices)
    assert value[0].isnan()
    torch.testing.assert_close(value[1:], energies.NormalVariation(JOINED)(VERTICES)[1:])


def test_sums_of_many_terms_are_exact_to_rounding() -> None:
    """One after another, a hundred thousand terms would lose two digits more."""
    topology = Topology.from_faces(np.zeros((0, 3), int), 100_000)
    terms = torch.linspace(0, 1, 200_000).sin().add(0.1).float()
    total = Topology.join([topology, topology]).sum_per_mesh(terms, "vertices")
    torch.testing.assert_close(total.double(), terms.double().view(2, -1).sum(1), rtol=1e-6, atol=0.0)


# ---- the topology itself ---------------------------------------------------------------------------------


def side_by_side(parts: list[Topology]) -> Topology:
    """Built from all faces, with the numbers of vertices shifted."""
    faces: list[list[int]] = []
    count = 0
    for part in parts:
        faces += [[v + count for v in face] for face in part.face_lists()]
        count += part.num_vertices
    return Topology.from_faces(faces, count)


TABLES = ("corners", "face_offsets", "corner_faces", "corner_edges", "edges", "interior_edge_faces", "ring_vertices")
TABLES += ("ring_offsets", "loop_vertices", "loop_offsets", "twins", "valences", "is_boundary_vertex", "next_corners")


def test_joining_is_building_from_all_faces() -> None:
    parts = [Topology.from_faces(faces) for faces in SHELF.values()]
    joined, built = Topology.join(parts), side_by_side(parts)
    for name in TABLES:
        assert torch.equal(getattr(joined, name), getattr(built, name)), name
    assert joined != built  # one has a value for each mesh, the other one value


def test_meshes_are_what_was_joined() -> None:
    parts = [Topology.from_faces(faces, 12) for faces in SHELF.values() if max(map(max, faces)) < 12]
    parts.insert(2, Topology.from_faces([], 3))
    meshes = Topology.join(parts).meshes
    assert list(meshes) == parts
    assert all(same(mesh, part) for mesh, part in zip(meshes, parts, strict=True))
    assert parts[0].meshes == (parts[0],)


def test_joined_ones_are_joined_again() -> None:
    first, second, third = (Topology.from_faces(faces) for faces in (SHELF["cube"], SHELF["fan"], SHELF["hybrid"]))
    flat = Topology.join([first, second, third])
    assert Topology.join([Topology.join([first, second]), third]) == flat
    assert Topology.join([flat]) == flat
    assert flat.vertex_meshes.tolist() == [0] * 8 + [1] * 9 + [2] * 8
    assert flat.face_meshes.bincount().tolist() == [6, 7, 4]
    assert flat.edge_meshes.bincount().tolist() == [12, 15, 11]
    assert "3 polygon meshes" in repr(flat)


def test_no_meshes_have_no_values() -> None:
    nothing = Topology.join([])
    assert (nothing.num_meshes, nothing.num_vertices, nothing.meshes) == (0, 0, ())
    for name, loss in LOSSES.items():
        value = loss(nothing)(torch.zeros(0, 3, dtype=DOUBLE, requires_grad=True))
        assert value.shape[-1] == 0, name
        value.sum().backward()


def test_one_joined_mesh_has_a_list_of_values() -> None:
    vertices, topology = MESHES[0]
    alone, joined = (energies.NormalVariation(t)(vertices) for t in (topology, Topology.join([topology])))
    assert (alone.shape, joined.shape) == ((), (1,))
    torch.testing.assert_close(joined[0], alone)


def test_what_cannot_be_joined_is_named() -> None:
    good = MESHES[0][1]
    with pytest.raises(MeshError, match="number 1 is no Topology but list"):
        Topology.join([good, [[0, 1, 2]]])  # type: ignore[list-item]
    with pytest.raises(MeshError, match=r"number 0 on cpu, number 1 on meta\. Move them"):
        Topology.join([good, good.to("meta")])
    with pytest.raises(MeshError, match="reflection_score takes one mesh, but 4 are joined"):
        reflection.reflection_score(VERTICES, JOINED)


def test_reductions_are_over_all_meshes() -> None:
    values = energies.NormalVariation(JOINED)(VERTICES)
    torch.testing.assert_close(energies.NormalVariation(JOINED, reduction="sum")(VERTICES), values.sum())
    torch.testing.assert_close(energies.NormalVariation(JOINED, reduction="mean")(VERTICES), values.mean())


# ---- equality and packing --------------------------------------------------------------------------------


def test_equality_is_that_of_faces_in_order() -> None:
    faces = [[0, 1, 2], [2, 1, 3]]
    first = Topology.from_faces(faces)
    assert first == Topology.from_faces(faces) == first.to("cpu")
    assert hash(first) == hash(Topology.from_faces(faces))
    others = [Topology.from_faces(f, n) for f, n in ((faces[::-1], 4), (faces, 5), ([[1, 2, 0], [2, 1, 3]], 4))]
    assert all(other != first for other in others)
    assert first != faces
    joined, apart = Topology.join([first, first]), Topology.join([Topology.join([first]), first])
    assert joined == apart
    split_otherwise = Topology.join([Topology.from_faces([], 0), side_by_side([first, first])])
    assert joined != split_otherwise
    assert joined.fingerprint != split_otherwise.fingerprint


def test_pickles_hold_one_packed_tensor() -> None:
    for topology in (JOINED, MESHES[0][1]):
        topology.ring_vertices  # noqa: B018
        state = topology.__getstate__()
        tensors = [value for value in state.values() if isinstance(value, torch.Tensor)]
        assert len(tensors) == 1
        assert tensors[0].dtype == torch.int32
        again = pickle.loads(pickle.dumps(topology))
        assert again == topology
        assert all(torch.equal(getattr(again, name), getattr(topology, name)) for name in TABLES)
        assert again.edges.untyped_storage().data_ptr() != again.corners.untyped_storage().data_ptr()


def test_numbers_too_large_for_32_bits_stay() -> None:
    from torchfair._packed_tensors import pack, unpack

    tensors = {"a": torch.tensor([[2**40, 3]]), "b": torch.zeros(0, dtype=torch.int64)}
    again = unpack(pack(tensors))
    assert all(torch.equal(tensors[name], again[name]) and again[name].dtype == torch.int64 for name in tensors)
