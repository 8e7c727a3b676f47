"""Public docstrings: the shapes of all tensors that go in, and an example where somebody starts to use a thing."""

from __future__ import annotations

import importlib
import inspect
import re
from collections.abc import Callable, Iterator
from typing import Any

import torchfair

FIRST = r"\*batch|\.\.\.|\d*[A-Z]\w*'?(?: ?[+*-] ?\w+)?(?: of the file)?|[a-z]|\d+|channels|size|height|views|blocks"
SHAPE = re.compile(rf"\((?:\.\.\.|(?:{FIRST}) ?,[^()]*)\)|any shape|one number")
TENSOR = re.compile(r"(?:torch\.)?Tensor(?: \| None)?")
TEMPLATES = {"like"}  # tensors of which only dtype and device count


def public(kinds: Callable[[Any], bool]) -> Iterator[tuple[str, Any]]:
    """Public names and values of all parts, each value once."""
    seen = set()
    for part in torchfair._PARTS:
        module = importlib.import_module(f"torchfair.{part}")
        for name, value in vars(module).items():
            home = getattr(value, "__module__", None) or ""
            inside = home.startswith("torchfair.") if hasattr(module, "__path__") else home == module.__name__
            if inside and not name.startswith("_") and kinds(value) and id(value) not in seen:
                seen.add(id(value))
                yield f"{part}.{name}", value


def callables() -> Iterator[tuple[str, Any, str]]:
    """What can be called, with all that is written about it: of methods in their base classes, too."""
    for name, value in public(lambda value: inspect.isfunction(value) or inspect.isclass(value)):
        if inspect.isfunction(value):
            yield name, value, value.__doc__ or ""
            continue
        if "__init__" in vars(value):
            yield name, value.__init__, value.__doc__ or ""
        for key, method in vars(value).items():
            if not key.startswith("_") and inspect.isfunction(method):
                written = [vars(base)[key].__doc__ or "" for base in value.__mro__ if key in vars(base)]
                yield f"{name}.{key}", method, "\n".join(written)


def without_shape(function: Any, written: str) -> list[str]:
    """Tensor arguments of which the docstring gives no shape, after their name or, of a single one, anywhere.

    Another docstring may be named instead: that one is looked at for itself.
    """
    if re.search(r"[Aa]rguments.{0,40}?(?:as (?:for|of|in)|those) |\b[Ss]ee (?::\w+:`|the protocol)", written, re.S):
        return []
    parameters = inspect.signature(function).parameters
    tensors = [name for name, told in parameters.items() if TENSOR.fullmatch(str(told.annotation).strip("'"))]
    tensors = [name for name in tensors if name not in TEMPLATES]
    if len(tensors) == 1 and SHAPE.search(written):
        return []
    near = r"\b{}\b(?:[^\n]|\n(?!\s*\w+: )){{0,160}}?(?:{})"
    return [name for name in tensors if not re.search(near.format(re.escape(name), SHAPE.pattern), written)]


def test_shapes_of_all_tensors_are_told() -> None:
    found = list(callables())
    assert len(found) > 700
    lacking = {name: missing for name, function, written in found if (missing := without_shape(function, written))}
    assert lacking == {}


def test_the_check_of_shapes_sees_what_is_missing() -> None:
    def area(vertices: torchfair.Topology, weights: Tensor) -> Tensor:  # type: ignore[name-defined]  # noqa: F821
        pass

    assert without_shape(area, "Areas of the faces, all of them (as told).") == ["weights"]
    assert without_shape(area, "Areas (F,) of the faces.") == []
