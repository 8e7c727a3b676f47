"""Quantities of meshes of any size that the dtype can hold."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Concatenate, ParamSpec

from torch import Tensor

from .._precision import in_single_at_least
from ..topology import Topology
from ._unit import in_its_unit

Arguments = ParamSpec("Arguments")
Quantity = Callable[Concatenate[Tensor, Topology, Arguments], Tensor]


def of_any_size(power: int) -> Callable[[Quantity[Arguments]], Quantity[Arguments]]:
    """Decorator of quantities of ``(vertices, topology)`` that are a length to some ``power``: of meshes of any size.

    Squares and products of lengths inside would overflow or vanish, and pass for faces without area: zero, where the
    quantity is large. In single precision at least. A result beyond the range of the dtype is infinite, or zero.
    """

    def decorated(function: Quantity[Arguments]) -> Quantity[Arguments]:
        @functools.wraps(function)
        def scaled(vertices: Tensor, topology: Topology, *args: Arguments.args, **kwargs: Arguments.kwargs) -> Tensor:
            topology.check_vertices(vertices)
            vertices, unit = in_its_unit(vertices)
            value = function(vertices, topology, *args, **kwargs)
            factor = unit.reshape(unit.shape[:-1] + (1,) * (value.dim() - unit.dim() + 1))
            for _ in range(power):  # one by one: zero times an infinite power would be no number
                value = value * factor
            return value

        quantity: Quantity[Arguments] = in_single_at_least(scaled)  # type: ignore[arg-type]  # arguments by name, too
        return quantity

    return decorated
