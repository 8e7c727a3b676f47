"""Quantities of meshes of any size that the dtype can hold."""

from __future__ import annotations

import functools
from collections.abc import Callable
from typing import Any, TypeVar, cast

from torch import Tensor

from .._precision import in_single_at_least
from ..topology import Topology
from ._unit import in_its_unit

Quantity = TypeVar("Quantity", bound=Callable[..., Tensor])  # as it is, so that arguments have their names


def of_any_size(power: int) -> Callable[[Quantity], Quantity]:
    """Decorator of quantities of ``(vertices, topology)`` that are a length to some ``power``: of meshes of any size.

    Squares and products of lengths inside would overflow or vanish, and pass for faces without area: zero, where the
    quantity is large. In single precision at least. A result beyond the range of the dtype is infinite, or zero.
    """

    def decorated(function: Quantity) -> Quantity:
        @functools.wraps(function)
        def scaled(vertices: Tensor, topology: Topology, *args: Any, **kwargs: Any) -> Tensor:
            topology.check_vertices(vertices)
            vertices, unit = in_its_unit(vertices)
            value = function(vertices, topology, *args, **kwargs)
            factor = unit.reshape(unit.shape[:-1] + (1,) * (value.dim() - unit.dim() + 1))
            for _ in range(power):  # one by one: zero times an infinite power would be no number
                value = value * factor
            return value

        return cast(Quantity, in_single_at_least(scaled))

    return decorated
