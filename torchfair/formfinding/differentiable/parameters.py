"""What a finished mesh may be differentiated by, in the user's units."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import torch
from torch import Tensor

from ...errors import SettingsError, ShapeError
from ...projection import ElementTerm
from ..job import Recipe, Stage

TARGETS, VERTICES, REFERENCE = "targets", "vertices", "reference"
SEEN_FROM = "seen from"  # the finished mesh itself, normalised, where terms depend on it
_WEIGHT = "_weight"
_APART = 1e-3  # relative: weights on both sides of a given one; the merit is affine in it


class JobParameters:
    """Parameters of a job by name, and the job with other values of them.

    ``targets`` (h, 3) of the handles in the order of their vertex numbers, ``vertices`` (V, 3) of the start, of which
    those count that stay, ``reference`` (R, 3) vertices of the reference mesh, and weights of the settings by their
    names, ``fairness_weight`` (), above 0.

    Args:
        recipe: The job; it is changed.
        values: By name, in the unit of the input.

    Raises:
        SettingsError: there is no such parameter.
        ShapeError: a parameter has another shape than what it stands for.
    """

    def __init__(self, recipe: Recipe[Any], values: Mapping[str, Tensor]) -> None:
        self.recipe = recipe
        self._reference = _reference(recipe)
        expected = self._shapes()
        for name, value in values.items():
            if name not in expected:
                raise SettingsError(f"parameters of this job are {', '.join(sorted(expected))}, got {name!r}")
            if tuple(value.shape) != expected[name] or not value.is_floating_point():
                raise ShapeError(f"parameter {name!r}", f"a floating tensor {expected[name]}", tuple(value.shape))
            if not bool(torch.isfinite(value).all()):
                raise ShapeError(f"parameter {name!r}", "finite numbers", "others")
        self._values = {name: value.detach().to("cpu", torch.float64) for name, value in values.items()}
        self._take()

    @property
    def start(self) -> Tensor:
        """(V, 3) in the unit of the input."""
        return self._values.get(VERTICES, self.recipe.given)

    def terms(self, stage: Stage, given: Mapping[str, Tensor]) -> Sequence[ElementTerm]:
        """Terms of a stage of the job as differentiable functions of its parameters, by name."""
        recipe, traced = self.recipe, {name: value.to("cpu", torch.float64) for name, value in given.items()}
        if TARGETS in traced:
            recipe.pulls.trace(recipe.unit.apply(traced[TARGETS]))
        if REFERENCE in traced:
            recipe.trace_reference(traced[REFERENCE])
        terms = list(stage.terms() if SEEN_FROM not in traced else recipe.terms_seen_from(stage, traced[SEEN_FROM]))
        for name, weight in traced.items():
            if name.endswith(_WEIGHT):
                terms = self._weighed(stage, terms, name, weight)
        return terms

    def _take(self) -> None:
        """Gives the job its values."""
        recipe, values = self.recipe, self._values
        weights = {name: float(value) for name, value in values.items() if name.endswith(_WEIGHT)}
        low = [name for name, weight in weights.items() if not weight > 0.0]
        if low:
            raise SettingsError(f"weights that are parameters must be above 0, got {low[0]} = {weights[low[0]]:g}")
        if weights:
            recipe.take_settings(replace(recipe.settings, **weights))
        if VERTICES in values and recipe.glides:
            raise SettingsError(
                "the boundary glides on curves that are given: its points are parameters where it is fixed"
            )
        if REFERENCE in values:
            recipe.take_reference((values[REFERENCE], self._reference))
        if TARGETS in values:
            recipe.pull(dict(zip(recipe.handles, values[TARGETS].tolist(), strict=True)))

    def _shapes(self) -> dict[str, tuple[int, ...]]:
        recipe = self.recipe
        shapes: dict[str, tuple[int, ...]] = {name: () for name in vars(recipe.settings) if name.endswith(_WEIGHT)}
        shapes[VERTICES] = tuple(recipe.given.shape)
        if recipe.handles:
            shapes[TARGETS] = (len(recipe.handles), 3)
        if self._reference is not None:
            shapes[REFERENCE] = (self._reference.num_vertices, 3)
        return shapes

    def _weighed(self, stage: Stage, terms: list[ElementTerm], name: str, weight: Tensor) -> list[ElementTerm]:
        """The terms with their weights as functions of one weight of the settings, on which nothing else depends."""
        recipe, value = self.recipe, float(weight.detach())
        settings, sides = recipe.settings, []
        for sign in (1.0, -1.0):
            recipe.take_settings(replace(settings, **{name: value * (1.0 + sign * _APART)}))
            sides.append([term.weight for term in stage.terms()])
        recipe.take_settings(settings)
        change = weight - weight.detach()
        slopes = [(more - less) / (2.0 * _APART * value) for more, less in zip(*sides, strict=True)]
        return [
            replace(term, weight=term.weight + slope * change) if slope else term
            for term, slope in zip(terms, slopes, strict=True)
        ]


def _reference(recipe: Recipe[Any]) -> Any:
    """Topology of the mesh that a job stays close to; None where it is none."""
    given = getattr(recipe, "reference", None)
    return given[1].to("cpu") if isinstance(given, tuple) else None
