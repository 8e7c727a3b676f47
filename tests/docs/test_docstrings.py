"""Public docstrings: the shapes of all tensors that go in, and an example where somebody starts to use a thing."""

from __future__ import annotations

import doctest
import importlib
import inspect
import re
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import torchfair
from torchfair.constraints import Constraint
from torchfair.energies import MeshModule

FIRST = (
    r"\*batch|\.\.\.|\d*[A-Z]\w*'?(?: ?[+*-] ?\w+)?(?: of the file)?|n\+1|[a-z]|\d+|channels|size|height|views|blocks"
)
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
    """Tensor arguments of which the docstring gives no shape, after their name or, of a single one, at all.

    Another docstring may be named instead: that one is looked at for itself.
    """
    if re.search(r"[Aa]rguments.{0,40}?(?:as (?:for|of|in)|those) |\b[Ss]ee (?::\w+:`|the protocol)", written, re.S):
        return []
    parameters = inspect.signature(function).parameters
    tensors = [name for name, told in parameters.items() if TENSOR.fullmatch(str(told.annotation).strip("'"))]
    tensors = [name for name in tensors if name not in TEMPLATES]
    begin = re.split(r"\n\s*(?:Returns|Raises|Attributes):", written)[0]
    if len(tensors) == 1 and f"{tensors[0]}:" not in begin and SHAPE.search(begin):
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


# ---- examples -------------------------------------------------------------------------------------------

FLAGS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
FINDER = doctest.DocTestFinder(recurse=False)
BASES = {"EdgeEnergy", "MeshModule", "StarEnergy"}
DOCUMENTED = {id(value): (name, value) for name, value in public(lambda value: bool(getattr(value, "__doc__", "")))}


def methods(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """A public thing, and what it has."""
    yield name, value
    if inspect.isclass(value):
        for key, method in vars(value).items():
            if not key.startswith("_"):
                yield f"{name}.{key}", method


EXAMPLES = [
    pytest.param(test, id=name)
    for told in DOCUMENTED.values()
    if inspect.isfunction(told[1]) or inspect.isclass(told[1])
    for name, value in methods(*told)
    for test in FINDER.find(value, name, module=False, globs={})
    if test.examples
]


def needs_example(name: str, value: Any) -> bool:
    """Whether something is an energy, a quantity, a constraint or a job."""
    part, _, own = name.partition(".")
    if inspect.isclass(value):
        return issubclass(value, MeshModule | Constraint) and own not in BASES and part != "reflection"
    return (
        inspect.isfunction(value) and part in ("energies", "geometry", "formfinding", "meshing") and own not in INSIDE
    )


INSIDE = {
    *("boundary_extrapolation", "closest_on", "job_report", "measure_mesh_on", "solved", "symmetric_measures"),
}
"""Functions that serve those who write jobs or energies, and have words for it on their pages."""


@pytest.mark.parametrize("test", EXAMPLES)
def test_examples_of_docstrings_give_what_they_say(test: doctest.DocTest) -> None:
    said: list[str] = []
    failed = doctest.DocTestRunner(optionflags=FLAGS).run(test, out=said.append).failed
    assert not failed, "".join(said)


def test_everything_that_somebody_starts_from_has_an_example() -> None:
    asked = {name: value for name, value in DOCUMENTED.values() if needs_example(name, value)}
    assert len(asked) > 90
    assert sorted(name for name, value in asked.items() if ">>>" not in value.__doc__) == []
