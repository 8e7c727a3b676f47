"""Losses on another device: they move there, and neither they nor their gradients wait for it."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext

import pytest
import torch
from geometry_meshes import mixed_grid
from helpers import wavy_grid
from pretended_device import PRETENDED, PretendedDevice
from torch import Tensor

from torchfair import Topology, energies, reflection, stars
from torchfair.energies import MeshModule
from torchfair.energies._normal_variation_blocks import tables_of

Make = Callable[[Topology], MeshModule]


def weights(topology: Topology) -> Tensor:
    return torch.linspace(0.5, 2.0, topology.num_interior_edges, dtype=torch.float64)


def reflection_loss(topology: Topology) -> MeshModule:
    vertices, _ = wavy_grid(5, 5, triangles=True, seed=1)
    return reflection.ReflectionLoss(topology, (vertices, topology), variation_weight=0.1, size=16)


LOSSES: dict[str, list[Make]] = {
    "AngleVariation": [energies.AngleVariation, lambda t: energies.AngleVariation(t, weights(t))],
    "NormalVariation": [energies.NormalVariation, lambda t: energies.NormalVariation(t, weights(t))],
    "PolylineFairness": [energies.PolylineFairness],
    "PyramidPenalty": [stars.PyramidPenalty],
    "ReflectionLoss": [reflection_loss],
    "ReflectionVariation": [
        reflection.ReflectionVariation,
        lambda t: reflection.ReflectionVariation(
            t, reflection.ring_directions(torch.tensor([0.0, 0, 1]), 30.0, 5), form="dual"
        ),
    ],
    "SaddlePenalty": [stars.SaddlePenalty],
    "TotalAbsoluteCurvature": [
        energies.TotalAbsoluteCurvature,
        lambda t: energies.TotalAbsoluteCurvature(t, sine=False, boundary="extrapolated"),
    ],
    "TotalFrobeniusCurvature": [
        lambda t: energies.TotalFrobeniusCurvature(t, estimator="corrected", boundary="extrapolated")
    ],
    "TotalMeanCurvature": [energies.TotalMeanCurvature],
    "UmbrellaFairness": [energies.UmbrellaFairness],
    "WillmoreEnergy": [
        energies.WillmoreEnergy,
        lambda t: energies.WillmoreEnergy(t, density="difference", boundary="extrapolated"),
    ],
}
FUNCTIONS: dict[str, Callable[[Tensor, Topology], Tensor]] = {
    "angle_variation": energies.angle_variation,
    "normal_variation": energies.normal_variation,
    "normal_variation_derivative": lambda v, t: energies.normal_variation_derivative(v, v.roll(1, -1), t),
    "pyramid_penalty": stars.pyramid_penalty,
    "reflection_variation": reflection.reflection_variation,
    "reflection_variation, dual": lambda v, t: reflection.reflection_variation(v, t, form="dual"),
    "total_mean_curvature": energies.total_mean_curvature,
    "umbrella_fairness": energies.umbrella_fairness,
}
"""Those that make no tables of their own at every call; the topology may keep some after the first."""

TRIANGLES_ONLY = {"TotalAbsoluteCurvature", "TotalFrobeniusCurvature", "WillmoreEnergy", "ReflectionLoss"}
WAITING = {"ReflectionLoss"}
"""What is seen decides about sizes."""


def kinds(parent: type) -> Iterator[str]:
    for kind in parent.__subclasses__():
        yield from kinds(kind)
        if kind.__module__.startswith("torchfair.") and not inspect.isabstract(kind):
            yield kind.__name__


def test_every_loss_is_tried() -> None:
    assert set(kinds(MeshModule)) == set(LOSSES)


def value_and_gradient(function: Callable[[Tensor], Tensor], vertices: Tensor) -> tuple[Tensor, Tensor]:
    variable = vertices.clone().requires_grad_()
    value = function(variable).sum()
    value.backward()
    assert variable.grad is not None
    return value.detach(), variable.grad


def check_same(found: tuple[Tensor, Tensor], expected: tuple[Tensor, Tensor], device: torch.device) -> None:
    for mine, other in zip(expected, found, strict=True):
        assert other.device == device
        torch.testing.assert_close(other.cpu(), mine)


def _strictly(device: torch.device, chosen: bool) -> AbstractContextManager[object]:
    return PretendedDevice(strict=True) if chosen and device == PRETENDED else nullcontext()


@pytest.mark.parametrize("name", LOSSES)
def test_losses_are_the_same_on_another_device_and_do_not_wait_for_it(
    name: str, device: torch.device, monkeypatch: pytest.MonkeyPatch
) -> None:
    if device == PRETENDED:  # kornia switches off lower precision, which this device does not have
        monkeypatch.setattr(torch, "autocast", lambda **settings: nullcontext())
    meshes = [wavy_grid(5, 5, triangles=True)] + ([] if name in TRIANGLES_ONLY else [mixed_grid()])
    for make in LOSSES[name]:
        for vertices, topology in meshes:
            for batch in (vertices, torch.stack([vertices, vertices.roll(1, 1) + 1.0])):
                expected = value_and_gradient(make(topology), batch)
                moved = make(topology).to(device)
                if name == "NormalVariation":
                    tables_of(moved.topology)  # otherwise made by the first call, and kept
                assert moved.topology.device == device
                there = batch.to(device)
                with _strictly(device, name not in WAITING):
                    found = value_and_gradient(moved, there)
                check_same(found, expected, device)


@pytest.mark.parametrize("name", FUNCTIONS)
def test_functions_are_the_same_on_another_device_and_do_not_wait_for_it(name: str, device: torch.device) -> None:
    vertices, topology = mixed_grid()
    there, moved = vertices.to(device), topology.to(device)
    FUNCTIONS[name](there, moved)  # makes tables that the topology keeps
    expected = value_and_gradient(lambda v: FUNCTIONS[name](v, topology), vertices)
    with _strictly(device, True):
        found = value_and_gradient(lambda v: FUNCTIONS[name](v, moved), there)
    check_same(found, expected, device)
