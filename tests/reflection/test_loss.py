"""The reflection loss: its value is the score, its gradient the slope of a finely sampled score."""

from __future__ import annotations

import pytest
import torch
from helpers import DOUBLE, cube, wavy_grid

from torchfair import TorchfairError
from torchfair.energies import normal_variation
from torchfair.geometry import face_areas
from torchfair.reflection import OrthographicCamera, ReflectionLoss, ReflectionSetup, reflection_score
from torchfair.shapes import PrincipalParaboloid, irregular_triangles, principal_quads

SADDLE = PrincipalParaboloid(1.0, -0.5, (0.8, 0.8))
VIEWS = torch.tensor([[0.1, 0.2, -1.0], [-0.3, 0.1, -1]], dtype=DOUBLE)


@pytest.fixture(scope="module")
def setup() -> ReflectionSetup:
    camera = OrthographicCamera(VIEWS, half_widths=1.1)
    return ReflectionSetup.for_reference(SADDLE, camera=camera, frequency=1.5, size=64, supersampling=2)


@pytest.fixture(scope="module")
def mesh():
    return irregular_triangles(SADDLE, 40)


@pytest.mark.parametrize("own", [False, True])
def test_value_is_the_score_at_the_same_size(setup, mesh, own):
    chosen = setup.without_reference() if own else setup
    loss = ReflectionLoss(mesh.topology, chosen, size=128)
    score = reflection_score(mesh.vertices, mesh.topology, ReflectionSetup(setup.camera, setup.stripes,
                             chosen.reference, 128, 4)).score  # fmt: skip
    torch.testing.assert_close(loss(mesh.vertices), score, rtol=0.05, atol=0)


def test_gradient_is_the_slope_of_the_score_of_finely_sampled_pictures(setup, mesh):
    """Along random motions, tangential ones among them, against difference quotients."""
    size, step = 96, 2e-3
    loss = ReflectionLoss(mesh.topology, setup, size=size)
    vertices = mesh.vertices.clone().requires_grad_()
    (gradient,) = torch.autograd.grad(loss(vertices), vertices)
    fine = ReflectionSetup(setup.camera, setup.stripes, setup.reference, size, 8)
    generator = torch.Generator().manual_seed(0)
    inner = ~mesh.topology.is_boundary_vertex[:, None]
    slopes, quotients = [], []
    for _ in range(6):
        along = torch.randn(2, len(mesh.vertices), 1, generator=generator, dtype=DOUBLE)
        tangents = mesh.surface.frame(*mesh.parameters.unbind(1))
        motion = inner * (along[0] * tangents[:, 0] + along[1] * tangents[:, 1])
        ends = [reflection_score(mesh.vertices + s * motion, mesh.topology, fine).score for s in (-step, step)]
        slopes.append((gradient * motion).sum())
        quotients.append((ends[1] - ends[0]) / (2 * step))
    found, expected = torch.stack(slopes), torch.stack(quotients)
    assert (found - expected).norm() < 0.25 * expected.norm()
    assert torch.corrcoef(torch.stack([found, expected]))[0, 1] > 0.95


def test_a_few_steps_of_descent_lower_the_score(setup, mesh):
    loss = ReflectionLoss(mesh.topology, setup, variation_weight=0.1, size=64)
    inner = (~mesh.topology.is_boundary_vertex[:, None]).to(DOUBLE)
    shift = torch.zeros_like(mesh.vertices, requires_grad=True)
    optimiser = torch.optim.Adam([shift], lr=4e-3)
    first = reflection_score(mesh.vertices, mesh.topology, setup).score
    for _ in range(15):
        optimiser.zero_grad()
        loss(mesh.vertices + inner * shift).backward()
        optimiser.step()
    last = reflection_score(mesh.vertices + inner * shift.detach(), mesh.topology, setup).score
    assert last < 0.95 * first


def test_batches_are_meshes_one_by_one(setup, mesh):
    noise = torch.randn(2, 2, *mesh.vertices.shape, generator=torch.Generator().manual_seed(1), dtype=DOUBLE)
    batch = (mesh.vertices + 0.01 * noise).requires_grad_()
    loss = ReflectionLoss(mesh.topology, setup, variation_weight=0.3, size=48)
    together = loss(batch)
    assert together.shape == (2, 2)
    (gradients,) = torch.autograd.grad(together.sum(), batch)
    one = batch.detach()[1, 0].requires_grad_()
    alone = loss(one)
    torch.testing.assert_close(together[1, 0], alone)
    torch.testing.assert_close(gradients[1, 0], torch.autograd.grad(alone, one)[0])


def test_variation_part_is_four_thirds_of_the_energy_over_the_root_of_the_area(setup, mesh):
    weight, parts = 0.7, []
    for chosen in (setup, setup.without_reference()):
        loss = ReflectionLoss(mesh.topology, chosen, variation_weight=weight, size=48)
        parts.append(loss.variation(mesh.vertices))
        torch.testing.assert_close(
            loss(mesh.vertices), loss.dissimilarity(mesh.vertices) + weight * loss.variation(mesh.vertices)
        )
    energy = 4 / 3 * normal_variation(mesh.vertices, mesh.topology)
    areas = SADDLE.area(), float(face_areas(mesh.vertices, mesh.topology).sum())
    for part, area in zip(parts, areas, strict=True):
        torch.testing.assert_close(part, energy / area**0.5, rtol=1e-3, atol=0)


def test_flat_and_hidden_meshes_have_value_and_gradient_zero(setup):
    vertices, topology = wavy_grid(triangles=True)
    flat = (vertices * torch.tensor([1.0, 1, 0], dtype=DOUBLE)).requires_grad_()
    own = ReflectionSetup.for_reference((flat, topology), size=48).without_reference()
    away = OrthographicCamera(VIEWS, targets=torch.tensor([90.0, 0, 0]))
    nothing = ReflectionSetup(away, setup.stripes, None)
    for chosen in (own, nothing):
        loss = ReflectionLoss(topology, chosen, variation_weight=0.1, size=48)
        value = loss(flat)
        assert value.abs() < 1e-12
        (gradient,) = torch.autograd.grad(value, flat)
        assert torch.isfinite(gradient).all()


def test_in_single_precision_and_in_words(setup, mesh):
    loss = ReflectionLoss(mesh.topology, setup, variation_weight=0.2, size=48)
    vertices = mesh.vertices.float().requires_grad_()
    value = loss(vertices)
    assert value.dtype == torch.float32
    torch.testing.assert_close(value.double(), loss(mesh.vertices), rtol=2e-3, atol=0)
    value.backward()
    assert torch.isfinite(vertices.grad).all()
    assert "2 views, size=48, variation_weight=0.2" in repr(loss)
    assert not [key for key in loss.state_dict() if key.startswith("reference")]


def test_wrong_arguments_are_named():
    quads = principal_quads(SADDLE, 4, 4)
    with pytest.raises(TorchfairError, match="variation_weight"):
        ReflectionLoss(quads.topology, SADDLE, variation_weight=-1.0)
    with pytest.raises(TorchfairError, match="reference must be"):
        ReflectionLoss(cube()[1], None)
