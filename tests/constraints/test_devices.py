"""Ready-made terms on another device: set up there, evaluated there without a look at the CPU, the same as on it."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterator
from contextlib import nullcontext

import pytest
import torch
from pretended_device import PRETENDED, PretendedDevice
from term_cases import CASES
from torch import Tensor

from torchfair import constraints
from torchfair.projection import ElementTerm
from torchfair.projection.layout import State
from torchfair.projection.loss import apply_root

CPU = torch.device("cpu")

UPLOADING = {"lifted_absolute_curvature_terms": ("evaluate", "weigh"), "absolute_curvature_terms": ("weigh",),
             "along_directions": ("weigh",)}  # fmt: skip
"""Where the six components of symmetric matrices are made: constants that are copied from the CPU at every call."""


def makers_of_terms() -> Iterator[str]:
    """Public functions, and methods of public classes, that return terms, by what they are annotated with."""
    for module in pkgutil.iter_modules(constraints.__path__):
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


def evaluate(term: ElementTerm, state: State) -> dict[str, Tensor]:
    """What the solver asks of a term at every step."""
    arguments = term.arguments(state)
    named = {f"argument {number}": argument for number, argument in enumerate(arguments)}
    return {**named, "values": term.values(arguments), "jacobians": term.jacobians(arguments)}


def weigh(term: ElementTerm, state: State) -> dict[str, Tensor]:
    """What the solver makes of that."""
    arguments = term.arguments(state)
    values, jacobians = term.derivatives(arguments)
    root = term.roots(values)
    return {
        "missed": term.missed(values),
        "contributions": term.contributions(arguments, values),
        "roots": root,
        "scaled residuals": apply_root(root, values),
        "scaled jacobians": apply_root(root, jacobians),
    }


@pytest.mark.parametrize("step", [evaluate, weigh])
@pytest.mark.parametrize("name", CASES)
def test_terms_are_the_same_on_another_device_and_do_not_wait_for_it(
    name: str, step: Callable[[ElementTerm, State], dict[str, Tensor]], device: torch.device
) -> None:
    strictly = device == PRETENDED and step.__name__ not in UPLOADING.get(name, ())
    for (state, terms), (state_there, terms_there) in zip(CASES[name](CPU), CASES[name](device), strict=True):
        assert len(terms) == len(terms_there) > 0
        for term, there in zip(terms, terms_there, strict=True):
            assert term.num_elements > 0
            tables = [index for _, index in there.stencil] + [x for x in (there.element_weights,) if x is not None]
            assert all(table.device == device for table in tables)
            with PretendedDevice(strict=True) if strictly else nullcontext():
                found = step(there, state_there)
            for key, expected in step(term, state).items():
                assert found[key].device == device, key
                torch.testing.assert_close(found[key].cpu(), expected, msg=lambda text, key=key: f"{key}: {text}")
