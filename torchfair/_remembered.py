"""Quantities of one mesh that several others are made of, worked out once while many are measured together."""

from __future__ import annotations

import functools
from collections.abc import Callable, Hashable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from typing import Any, TypeVar, cast

import torch
from torch import Tensor

Function = TypeVar("Function", bound=Callable[..., Any])  # as it is, so that arguments have their names
_VALUES: ContextVar[dict[Hashable, tuple[Any, ...]] | None] = ContextVar("remembered", default=None)


@contextmanager
def remembering() -> Iterator[None]:
    """While it lasts, :func:`remembered` functions give the same tensors again for the same arguments.

    For measuring only: neither positions nor what is given may be changed in place meanwhile. Values are held until it
    ends; inside another one, until that ends. They are the same to the last bit as without.
    """
    token = _VALUES.set({}) if _VALUES.get() is None else None
    try:
        yield
    finally:
        if token is not None:
            _VALUES.reset(token)


def is_remembering() -> bool:
    """Whether :func:`remembering` lasts; never in compiled functions."""
    return not torch.compiler.is_compiling() and _VALUES.get() is not None


def remembered(function: Function) -> Function:
    """Decorator of functions of ``(vertices, *others)``, to which :func:`remembering` applies.

    Others are what can be hashed, or a topology, which is told by its identity. Vertices that are differentiated, and
    tensors inside transforms, are never remembered.
    """

    @functools.wraps(function)
    def looked_up(vertices: Tensor, *others: Any, **named: Any) -> Any:
        if torch.compiler.is_compiling():  # it cannot look into the table
            return function(vertices, *others, **named)
        values = _VALUES.get()
        if values is None or type(vertices) is not Tensor or vertices.requires_grad:
            return function(vertices, *others, **named)
        place = vertices.data_ptr(), vertices.shape, vertices.stride(), vertices.dtype, vertices.device
        told = (other if isinstance(other, (str, bool, int, float)) else id(other) for other in others)
        key = function, place, vertices._version, *told, *sorted(named.items())
        if key not in values:  # what told the key is held, too, so that nothing else takes its place
            values[key] = vertices, others, function(vertices, *others, **named)
        return values[key][-1]

    return cast(Function, looked_up)
