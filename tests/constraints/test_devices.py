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
from term_cases import CASES
from torch import Tensor

from torchfair import constraints
from torchfair.projection import ElementTerm
from torchfair.projection.layout import State
from torchfair.projection.loss import apply_root

CPU = torch.device("cpu")


def makers_of_terms() -> Iterator[str]:
    """Public functions, and methods of public classes, that return terms, by what they are annotated with."""
    for module in pkgutil.iter_modules(constraints.__path__):
        members = vars(importlib.import_module(f"{constraints.__name__}.{module.name}"))
        for name, member in members.items():
            if name.startswith("_") or getattr(member, "__module__", None) != f"{constraints.__name__}.{module.name}":
                continue
            functions = {name: member} if inspect.isfunction(member) else {}
            if inspect.isclass(member):
                functions = {f"{name}.{key}": f for key, f in vars(member).items() if inspect.isfunction(f)}
            for title, function in functions.items():
                if not title.split(".")[-1].startswith("_") and "ElementTerm" in str(inspect.signature(function).return_annotation):
                    yield title


def test_there_is_a_problem_for_every_public_function_that_makes_terms() -> None:
    assert set(makers_of_terms()) == set(CASES)


def without_waiting(device: torch.device) -> AbstractContextManager[object]:
    return PretendedDevice(strict=True) if device == PRETENDED else nullcontext()


def evaluate(term: ElementTerm, state: State) -> dict[str, Tensor]:
    """What the solver evaluates of a term at every step."""
    arguments = term.arguments(state)
    values = term.values(arguments)
    root = term.roots(values)
    jacobians = term.jacobians(arguments)
    return {
        **{f"argument {number}": argument for number, argument in enumerate(arguments)},
        "values": values,
        "missed": term.missed(values),
        "contributions": term.contributions(arguments, values),
        "roots": root,
        "jacobians": jacobians,
        "scaled residuals": apply_root(root, values),
        "scaled jacobians": apply_root(root, jacobians),
    }


@pytest.mark.parametrize("name", CASES)
def test_terms_are_the_same_on_another_device(name: str, device: torch.device) -> None:
    for (state, terms), (state_there, terms_there) in zip(CASES[name](CPU), CASES[name](device), strict=True):
        assert len(terms) == len(terms_there) > 0
        for term, there in zip(terms, terms_there, strict=True):
            assert term.num_elements > 0
            assert all(index.device == device for _, index in there.stencil)
            with without_waiting(device):
                found = evaluate(there, state_there)
            for key, expected in evaluate(term, state).items():
                assert found[key].device == device, key
                torch.testing.assert_close(found[key].cpu(), expected, msg=lambda text, key=key: f"{key}: {text}")
