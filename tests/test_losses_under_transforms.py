"""Every energy, penalty and score under every transform, tracer and mode that training loops use."""

from __future__ import annotations

import shutil
from collections.abc import Callable

import loss_cases
import pytest
import torch
from helpers import DOUBLE, wavy_grid
from torch import Tensor
from torch.fx.experimental.proxy_tensor import make_fx
from torch.utils.checkpoint import checkpoint

from torchfair import Topology, TorchfairError, energies, reflection

VERTICES, TOPOLOGY = wavy_grid(4, 4, triangles=True)
DIRECTION = torch.linspace(-1, 1, VERTICES.numel(), dtype=DOUBLE).view_as(VERTICES).sin()
OTHER = VERTICES + 1e-3 * DIRECTION
BATCH = torch.stack([VERTICES, OTHER])

Loss = Callable[[Tensor], Tensor]
LOSSES: dict[str, Callable[[Topology], energies.MeshModule]] = {
    **loss_cases.LOSSES,
    "E, weighted": lambda t: energies.NormalVariation(t, torch.linspace(0, 1, t.num_interior_edges, dtype=DOUBLE)),
}


def fresh(make: Callable[[Topology], energies.MeshModule]) -> energies.MeshModule:
    """On a topology that nothing has been evaluated on."""
    return make(Topology.from_faces(TOPOLOGY.face_lists(), TOPOLOGY.num_vertices))


def picture_loss(topology: Topology) -> energies.MeshModule:
    return reflection.ReflectionLoss(topology, wavy_grid(5, 5), size=24)


def gradient(loss: Loss, at: Tensor) -> Tensor:
    variable = at.clone().requires_grad_()
    (slope,) = torch.autograd.grad(loss(variable), variable)
    return slope


def second(loss: Loss, at: Tensor) -> Tensor:
    """The second derivative along the direction, by backward twice."""
    variable = at.clone().requires_grad_()
    (slope,) = torch.autograd.grad(loss(variable), variable, create_graph=True)
    (bent,) = torch.autograd.grad((slope * DIRECTION).sum(), variable, materialize_grads=True)
    return bent


def by_jvp(loss: Loss) -> None:
    value, rate = torch.func.jvp(loss, (VERTICES,), (DIRECTION,))
    torch.testing.assert_close(value, loss(VERTICES))
    torch.testing.assert_close(rate, (gradient(loss, VERTICES) * DIRECTION).sum())


def by_linearize(loss: Loss) -> None:
    value, rate = torch.func.linearize(loss, VERTICES)
    torch.testing.assert_close(value, loss(VERTICES))
    torch.testing.assert_close(rate(DIRECTION), (gradient(loss, VERTICES) * DIRECTION).sum())


def by_vjp(loss: Loss) -> None:
    value, pull = torch.func.vjp(loss, VERTICES)
    torch.testing.assert_close(pull(2 * torch.ones_like(value))[0], 2 * gradient(loss, VERTICES))


def by_vmap(loss: Loss) -> None:
    torch.testing.assert_close(torch.func.vmap(loss)(BATCH), loss(BATCH))
    slopes = torch.stack([gradient(loss, vertices) for vertices in BATCH])
    torch.testing.assert_close(torch.func.vmap(torch.func.grad(loss))(BATCH), slopes)


def by_grad(loss: Loss) -> None:
    torch.testing.assert_close(torch.func.grad(loss)(VERTICES), gradient(loss, VERTICES))
    twice = torch.func.grad(lambda v: (torch.func.grad(loss)(v) * DIRECTION).sum())
    torch.testing.assert_close(twice(VERTICES), second(loss, VERTICES))


def by_jacrev(loss: Loss) -> None:
    torch.testing.assert_close(torch.func.jacrev(loss)(VERTICES), gradient(loss, VERTICES))


def by_jacfwd(loss: Loss) -> None:
    torch.testing.assert_close(torch.func.jacfwd(loss)(VERTICES), gradient(loss, VERTICES))


def by_hessian(loss: Loss) -> None:
    matrix = torch.func.hessian(loss)(VERTICES)
    torch.testing.assert_close(torch.tensordot(matrix, DIRECTION, 2), second(loss, VERTICES))


def by_make_fx(loss: Loss) -> None:
    torch.testing.assert_close(make_fx(loss)(VERTICES)(OTHER), loss(OTHER))
    torch.testing.assert_close(make_fx(torch.func.grad(loss))(VERTICES)(OTHER), gradient(loss, OTHER))


@pytest.mark.filterwarnings("ignore")
def by_tracing(loss: Loss) -> None:
    traced = torch.jit.trace(loss, VERTICES)
    torch.testing.assert_close(traced(OTHER), loss(OTHER))


def by_export(loss: Loss) -> None:
    assert isinstance(loss, torch.nn.Module)
    program = torch.export.export(loss, (VERTICES,))
    torch.testing.assert_close(program.module()(OTHER), loss(OTHER))


def by_functional_call(loss: Loss) -> None:
    assert isinstance(loss, torch.nn.Module)
    state = {name: 2 * value for name, value in loss.state_dict().items()}
    value = torch.func.functional_call(loss, state, (VERTICES,))
    torch.testing.assert_close(value, loss(VERTICES) * (2 if "edge_weights" in state else 1))


def by_checkpoint(loss: Loss) -> None:
    again = gradient(lambda v: checkpoint(loss, v, use_reentrant=False), VERTICES)
    torch.testing.assert_close(again, gradient(loss, VERTICES))


def by_autocast(loss: Loss) -> None:
    single = VERTICES.float()
    with torch.autocast("cpu", torch.bfloat16):
        value = loss(single)
        variable = single.clone().requires_grad_()
        inside = loss(variable)
    assert value.dtype == torch.float32
    assert value == loss(single)
    (slope,) = torch.autograd.grad(inside, variable)
    torch.testing.assert_close(slope, gradient(loss, single))


def by_anomaly_mode(loss: Loss) -> None:
    with pytest.warns(UserWarning, match="Anomaly Detection"), torch.autograd.detect_anomaly():
        slope = gradient(loss, VERTICES)
    torch.testing.assert_close(slope, gradient(loss, VERTICES))


def by_deterministic_mode(loss: Loss) -> None:
    before = gradient(loss, VERTICES)
    torch.use_deterministic_algorithms(True)
    try:
        torch.testing.assert_close(gradient(loss, VERTICES), before)
    finally:
        torch.use_deterministic_algorithms(False)


WAYS = [by_grad, by_vmap, by_jvp, by_linearize, by_vjp, by_jacrev, by_jacfwd, by_hessian, by_make_fx, by_tracing]
WAYS += [by_functional_call, by_checkpoint, by_autocast, by_anomaly_mode, by_deterministic_mode]
RECORDERS = (by_linearize, by_vmap, by_jacfwd, by_hessian, by_make_fx, by_tracing, by_export)
QUICK = ("E", "E, weighted", "umbrella", "polylines")  # of the others some hundred operations would be recorded
LONG = {(name, way) for name in LOSSES for way in (by_make_fx, by_linearize) if name not in QUICK}
LONG |= {("saddles", by_hessian), ("saddles", by_tracing), ("saddles", by_grad)}
every_loss = pytest.mark.parametrize("name", LOSSES)
quiet = pytest.mark.filterwarnings("ignore:Attempted to insert a get_attr:UserWarning")


def pairs() -> list[object]:
    """Losses and ways; those that record thousands of operations are slow."""
    return [
        pytest.param(name, way, id=f"{name}-{way.__name__}", marks=[pytest.mark.slow] if (name, way) in LONG else [])
        for name in LOSSES
        for way in WAYS
    ]


@quiet
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::torch.jit.TracerWarning")
@pytest.mark.parametrize(("name", "way"), pairs())
def test_is_the_same(name: str, way: Callable[[Loss], None]) -> None:
    way(fresh(LOSSES[name]))


@every_loss
def test_the_gradient_is_that_of_the_values(name: str) -> None:
    loss, step = fresh(LOSSES[name]), 1e-6
    rate = (loss(VERTICES + step * DIRECTION) - loss(VERTICES - step * DIRECTION)) / (2 * step)
    torch.testing.assert_close((gradient(loss, VERTICES) * DIRECTION).sum(), rate, rtol=1e-6, atol=1e-7)


@pytest.mark.slow
@every_loss
def test_exports(name: str) -> None:
    by_export(fresh(LOSSES[name]))


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("g++") is None, reason="no compiler")
@pytest.mark.filterwarnings("ignore::DeprecationWarning")
@pytest.mark.parametrize("name", ["E", "E, weighted", "E'", "umbrella", "C"])  # others take it minutes each
def test_compiles_by_inductor(name: str) -> None:
    torch._dynamo.reset()
    loss = fresh(LOSSES[name])
    compiled = torch.compile(loss, fullgraph=True)
    torch.testing.assert_close(compiled(VERTICES), loss(VERTICES))
    torch.testing.assert_close(gradient(compiled, VERTICES), gradient(loss, VERTICES))


@quiet
@pytest.mark.parametrize("way", [way for way in WAYS if way not in RECORDERS and way is not by_grad])
def test_pictures_are_the_same(way: Callable[[Loss], None]) -> None:
    way(fresh(picture_loss))


@quiet
@pytest.mark.filterwarnings("ignore::DeprecationWarning", "ignore::torch.jit.TracerWarning")
@pytest.mark.parametrize("way", RECORDERS)
def test_pictures_refuse_to_be_recorded(way: Callable[[Loss], None]) -> None:
    with pytest.raises(TorchfairError, match=r"cannot be recorded|does not work under vmap.*leading dimensions"):
        way(fresh(picture_loss))


@pytest.mark.parametrize("name", [*LOSSES, "pictures"])
@pytest.mark.parametrize("made_inside", [False, True])
def test_inference_mode_does_not_poison_training(name: str, made_inside: bool) -> None:
    make = {**LOSSES, "pictures": picture_loss}[name]
    with torch.inference_mode():
        if made_inside:
            loss = fresh(make)
    if not made_inside:
        loss = fresh(make)
    with torch.inference_mode():
        loss(VERTICES)
    torch.testing.assert_close(gradient(loss, VERTICES), gradient(fresh(make), VERTICES))
    if name != "pictures":
        torch.testing.assert_close(second(loss, VERTICES), second(fresh(make), VERTICES))


@every_loss
@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16])
@pytest.mark.filterwarnings("ignore:geometry in torch:UserWarning")
def test_half_precision_is_left_at_once(name: str, dtype: torch.dtype) -> None:
    """Also where autocast would compute in it; the value is not rounded to it either."""
    loss, coarse = fresh(LOSSES[name]), VERTICES.to(dtype)
    expected = loss(coarse.float())
    with torch.autocast("cpu", torch.bfloat16):
        inside = loss(coarse)
    for value in (loss(coarse), inside):
        assert value.dtype == torch.float32
        assert value == expected
    assert gradient(loss, coarse).dtype == dtype


@every_loss
@pytest.mark.parametrize("size", [2.0**-44, 2.0**44])
def test_size_is_scaled_away_in_single_precision(name: str, size: float) -> None:
    """Squares of squares of edges are beyond the range of float32: they passed for faces without area."""
    loss, single = fresh(LOSSES[name]), VERTICES.float()
    power = {"umbrella": 2, "polylines": 2, "Willmore": 0, "pyramids": 0, "saddles": 0}.get(name, 1)
    torch.testing.assert_close(loss(size * single).double(), loss(single).double() * size**power, rtol=1e-3, atol=0.0)
    scaled = gradient(loss, size * single).double() / size ** (power - 1)
    torch.testing.assert_close(scaled, gradient(loss, single).double(), rtol=1e-3, atol=1e-3)
