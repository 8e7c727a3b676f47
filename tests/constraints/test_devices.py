"""Ready-made terms on another device: set up there, evaluated there without a look at the CPU, the same as on it."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Iterator
from contextlib import AbstractContextManager, nullcontext

import pytest
import torch
from pretended_device import PRETENDED, PretendedDevice
from term_cases import CASES, lattice, triangles
from torch import Tensor

from torchfair import constraints
from torchfair.constraints.closeness import TangentPlanes
from torchfair.constraints.lifted_absolute_curvature import lifted_absolute_curvature_blocks
from torchfair.geometry import ReferenceSurface
from torchfair.projection import ElementTerm
from torchfair.projection.layout import State
from torchfair.projection.loss import apply_root

CPU = torch.device("cpu")


def makers_of_terms() -> Iterator[str]:
    """Public functions, and methods of public classes, that return terms, by what they are annotated with."""
    for module in pkgutil.iter_modules(constraints.__path__):
        if module.name.startswith("_"):
            continue
        name = f"{constraints.__name__}.{module.name}"
        own = {k: v for k, v in vars(importlib.import_module(name)).items() if getattr(v, "__module__", None) == name}
        classes = {k: v for k, v in own.items() if inspect.isclass(v)}
        methods = {f"{k}.{title}": method for k, v in classes.items() for title, method in vars(v).items()}
        for title, function in (own | methods).items():
            public = not any(part.startswith("_") for part in title.split("."))
            if public and inspect.isfunction(function) and "ElementTerm" in str(function.__annotations__.get("return")):
                yield title


def test_there_is_a_problem_for_every_public_function_that_makes_terms() -> None:
    assert set(makers_of_terms()) == set(CASES)


@pytest.mark.parametrize("name", CASES)
def test_terms_are_the_same_on_another_device_and_do_not_wait_for_it(name: str, device: torch.device) -> None:
    for (state, terms), (state_there, terms_there) in zip(CASES[name](CPU), CASES[name](device), strict=True):
        assert len(terms) == len(terms_there) > 0
        for term, there in zip(terms, terms_there, strict=True):
            assert term.num_elements > 0
            assert all(index.device == device for _, index in there.stencil)
            for one, at in ((term, state), (there, state_there)):  # some remember the state before
                one.arguments({key: 0.99 * block for key, block in at.items()})
            with _strictly(device):
                found = _linearised(there, state_there)
                found |= _weighed(there, found)
            expected = _linearised(term, state)
            for key, value in (expected | _weighed(term, expected)).items():
                assert found[key].device == device, key
                torch.testing.assert_close(found[key].cpu(), value, msg=lambda text, key=key: f"{key}: {text}")


def test_closeness_waits_for_closest_points_once_for_each_state(device: torch.device) -> None:
    if device != PRETENDED:
        pytest.skip("real devices do not tell")
    vertices, topology = triangles(device)
    planes = TangentPlanes(ReferenceSurface(vertices, topology))
    terms = constraints.closeness_terms(planes, torch.arange(topology.num_vertices, device=device), weight=1.0)
    terms += constraints.distance_limit_terms(planes, torch.ones_like(vertices[:, 0]), weight=1.0)
    for state in ({"vertices": vertices + shift} for shift in (0.1, 0.2)):
        with PretendedDevice() as there:
            for term in terms:
                _weighed(term, _linearised(term, state))
        assert there.waits == ["torchfair.closest.default"]


def _strictly(device: torch.device) -> AbstractContextManager[object]:
    return PretendedDevice(strict=True) if device == PRETENDED else nullcontext()


def _linearised(term: ElementTerm, state: State) -> dict[str, Tensor]:
    """What the solver asks of a term at every step."""
    arguments = term.arguments(state)
    named = {str(number): argument for number, argument in enumerate(arguments)}
    return {**named, "values": term.values(arguments), "jacobians": term.jacobians(arguments)}


def _weighed(term: ElementTerm, found: dict[str, Tensor]) -> dict[str, Tensor]:
    """What the solver makes of that."""
    values, arguments = found["values"], tuple(value for key, value in found.items() if key.isdigit())
    root = term.roots(values)
    return {
        "missed": term.missed(values),
        "contributions": term.contributions(arguments, values),
        "weights": root if root.ndim == 1 else root.mT @ root,  # the signs of eigenvectors are open
        "gradients": (apply_root(root, values)[..., None] * apply_root(root, found["jacobians"])).sum(1),
    }


def test_what_stars_are_to_be_is_kept_on_their_device(device: torch.device) -> None:
    vertices, *_, stars = lattice(device)
    sides = constraints.SaddleSides(stars)
    assert sides.is_saddle.device == device
    sides.decide(vertices)
    assert sides.is_saddle.device == device


def test_unknowns_beside_the_vertices_are_on_their_device(device: torch.device) -> None:
    vertices, topology = triangles(CPU)
    expected = lifted_absolute_curvature_blocks(vertices, topology)
    found = lifted_absolute_curvature_blocks(vertices.to(device), topology.to(device))
    for name, block in expected.items():
        assert found[name].device == device
        same = found[name].cpu()
        if name == "directions":
            same = same * (same * block).sum(1, keepdim=True).sign()
        torch.testing.assert_close(same, block)
