"""What a refinement holds: a linear map in any dtype and batch, composition, and where everything stems from."""

from __future__ import annotations

import pytest
import torch
from geometry_meshes import mixed_grid, with_isolated
from helpers import DOUBLE, cube, tetrahedron, wavy_grid
from mesh_shelf import same
from torch import Tensor

from torchfair import MeshError, ShapeError
from torchfair.geometry import face_areas
from torchfair.subdivision import Origin, Refinement, catmull_clark, hybrid, loop, midpoint, refine

SCHEMES = ["loop", "catmull_clark", "hybrid", "midpoint"]
STEPS = {"loop": loop, "catmull_clark": catmull_clark, "hybrid": hybrid, "midpoint": midpoint}


@pytest.fixture
def step() -> Refinement:
    return hybrid(with_isolated(mixed_grid())[1])


@pytest.fixture
def vertices() -> Tensor:
    return with_isolated(mixed_grid())[0]


# ---- the map ---------------------------------------------------------------------------------------------


def test_apply_is_the_matrix(step: Refinement, vertices: Tensor) -> None:
    torch.testing.assert_close(step.apply(vertices), torch.from_numpy(step.matrix @ vertices.numpy()))


def test_batches_and_other_values_than_positions(step: Refinement, vertices: Tensor) -> None:
    scales = torch.linspace(0.5, 2, 6, dtype=DOUBLE).view(2, 3, 1, 1)
    torch.testing.assert_close(step.apply(scales * vertices), scales * step.apply(vertices))
    assert step.apply(vertices.expand(0, *vertices.shape)).shape == (0, step.topology.num_vertices, 3)
    torch.testing.assert_close(step.apply(vertices[:, :1]), step.apply(vertices)[:, :1])


@pytest.mark.parametrize("dtype", [torch.float16, torch.float32, torch.float64])
def test_dtype_is_kept(step: Refinement, vertices: Tensor, dtype: torch.dtype) -> None:
    fine = step.apply(vertices.to(dtype))
    assert fine.dtype == dtype
    tolerance = 8 * torch.finfo(dtype).eps * float(vertices.abs().max())
    torch.testing.assert_close(fine.double(), step.apply(vertices), atol=tolerance, rtol=0)


def test_derivatives_of_any_order(step: Refinement, vertices: Tensor) -> None:
    x = vertices.requires_grad_()
    assert torch.autograd.gradcheck(step.apply, x)
    assert torch.autograd.gradgradcheck(step.apply, x)


def test_function_transforms_and_compilation(step: Refinement, vertices: Tensor) -> None:
    batch = torch.stack([vertices, vertices.sin(), -vertices])
    torch.testing.assert_close(torch.func.vmap(step.apply)(batch), step.apply(batch))
    _, moved = torch.func.jvp(step.apply, (vertices,), (vertices.cos(),))
    torch.testing.assert_close(moved, step.apply(vertices.cos()))
    compiled = torch.compile(lambda x: step.apply(x).square().sum(), backend="eager", fullgraph=True)
    torch.testing.assert_close(compiled(vertices), step.apply(vertices).square().sum())


def test_nan_spreads_to_what_is_computed_from_it(step: Refinement, vertices: Tensor) -> None:
    vertices[7] = torch.nan
    touched = torch.from_numpy(step.matrix[:, [7]].toarray()[:, 0] != 0)
    assert torch.equal(step.apply(vertices).isnan().all(1), touched)


def test_wrong_shapes(step: Refinement, vertices: Tensor) -> None:
    for bad in (vertices[1:], vertices[0], vertices.long(), vertices.tolist()):
        with pytest.raises(ShapeError, match=r"vertices: expected a floating tensor \(\*batch, 26, d\)"):
            step.apply(bad)


def test_moving_keeps_everything(step: Refinement, vertices: Tensor) -> None:
    moved = step.to("cpu")
    assert torch.equal(moved.apply(vertices), step.apply(vertices))
    assert same(moved.topology, step.topology)
    assert "26 vertices" in repr(moved)


# ---- numbering and origins -------------------------------------------------------------------------------


def test_vertices_are_numbered_by_old_vertices_edges_and_faces() -> None:
    _, topology = mixed_grid()
    V, E = topology.num_vertices, topology.num_edges
    centred = {"loop": [], "catmull_clark": range(topology.num_faces)}
    large = torch.nonzero(topology.face_sizes > 3).squeeze(1).tolist()
    for name in SCHEMES[1:]:
        expected = [(Origin.VERTEX, v) for v in range(V)] + [(Origin.EDGE, e) for e in range(E)]
        expected += [(Origin.FACE, f) for f in centred.get(name, large)]
        assert [tuple(row) for row in STEPS[name](topology).vertex_origins.tolist()] == expected


def test_children_follow_the_order_of_their_parents() -> None:
    for step in (hybrid(mixed_grid()[1]), catmull_clark(mixed_grid()[1]), refine(mixed_grid()[1], "midpoint", 2)):
        assert (step.face_parents.diff() >= 0).all()
        assert torch.equal(step.face_parents.unique(), torch.arange(step.coarse.num_faces))


@pytest.mark.parametrize("levels", [1, 2, 3])
@pytest.mark.parametrize("triangles", [True, False])
def test_everything_lies_in_what_it_stems_from(triangles: bool, levels: int) -> None:
    """Midpoints leave the surface as it is, so origins and parents can be seen."""
    vertices, topology = wavy_grid(4, 4, triangles=triangles)
    vertices[:, 2] = 0
    step = refine(topology, "midpoint", levels)
    fine = step.apply(vertices)
    kinds, numbers = step.vertex_origins.unbind(1)
    torch.testing.assert_close(fine[kinds == Origin.VERTEX], vertices[numbers[kinds == Origin.VERTEX]])
    assert (kinds == Origin.EDGE).sum() == topology.num_edges * (2**levels - 1)
    on_edge = fine[kinds == Origin.EDGE]
    ends = vertices[topology.edges[numbers[kinds == Origin.EDGE]]]
    detour = (on_edge[:, None] - ends).norm(dim=-1).sum(1) - (ends[:, 0] - ends[:, 1]).norm(dim=-1)
    assert detour.abs().max() < 1e-12
    areas = torch.zeros(topology.num_faces, dtype=DOUBLE)
    areas.index_add_(0, step.face_parents, face_areas(fine, step.topology))
    torch.testing.assert_close(areas, face_areas(vertices, topology))
    for face, parent in zip(step.topology.face_lists(), step.face_parents.tolist(), strict=True):
        inside = [int(n) for v in face for k, n in [step.vertex_origins[v]] if k == Origin.FACE]
        assert set(inside) <= {parent}
    child = step.edge_parents >= 0
    parents = topology.edges[step.edge_parents[child]]
    split = fine[step.topology.edges[child]]
    along = torch.linalg.cross(split[:, 1] - split[:, 0], vertices[parents[:, 1]] - vertices[parents[:, 0]])
    assert along.abs().max() < 1e-12
    assert child.sum() == topology.num_edges * 2**levels


# ---- composition -----------------------------------------------------------------------------------------


@pytest.mark.parametrize("scheme", SCHEMES)
def test_refine_is_one_step_after_the_other(scheme: str) -> None:
    vertices, topology = wavy_grid(4, 3, triangles=True)
    first = STEPS[scheme](topology)
    second = STEPS[scheme](first.topology)
    third = STEPS[scheme](second.topology)
    whole = refine(topology, scheme, 3)
    assert same(whole.topology, third.topology)
    assert same(whole.coarse, topology)
    torch.testing.assert_close(whole.apply(vertices), third.apply(second.apply(first.apply(vertices))))
    assert torch.equal(whole.face_parents, first.face_parents[second.face_parents[third.face_parents]])
    # Composition is associative.
    for one, other in [(first.then(second).then(third), first.then(second.then(third)))]:
        for name in ("face_parents", "vertex_origins", "edge_parents", "edge_parallels"):
            assert torch.equal(getattr(one, name), getattr(other, name))
            assert torch.equal(getattr(one, name), getattr(whole, name))


def test_no_level_changes_nothing() -> None:
    vertices, topology = cube()
    step = refine(topology, levels=0)
    assert torch.equal(step.apply(vertices), vertices)
    assert step.topology is topology
    labels = torch.arange(12)
    assert torch.equal(step.carry_edge_labels(labels), labels)
    assert torch.equal(step.carry_vertex_labels(labels[:8]), labels[:8])
    assert torch.equal(step.carry_face_labels(labels[:6]), labels[:6])


def test_steps_that_do_not_fit_are_refused() -> None:
    first = loop(tetrahedron()[1])
    with pytest.raises(MeshError, match=r"does not start where .* ends. Refine the attribute topology"):
        first.then(first)
