"""Geometry is computed in single precision at least, whatever the training around it is in."""

from __future__ import annotations

import functools
import warnings
from collections.abc import Callable
from typing import Any, ParamSpec, TypeVar

import torch
from torch import Tensor

Arguments = ParamSpec("Arguments")
Value = TypeVar("Value")
_HALF = (torch.float16, torch.bfloat16)


def in_single_at_least(function: Callable[Arguments, Value]) -> Callable[Arguments, Value]:
    """Decorator: tensors in half precision among the arguments become float32, and autocast is off inside.

    What losses of torch do under autocast (``torch.amp.custom_fwd(cast_inputs=torch.float32)``), here also without it:
    edges are differences of nearly equal numbers, and what bends a mesh is a difference of differences. A warning says
    once that half precision has lost that before it comes here.
    """

    @functools.wraps(function)
    def guarded(*args: Arguments.args, **kwargs: Arguments.kwargs) -> Value:
        given = (*args, *kwargs.values())
        kind = next((value.device.type for value in given if isinstance(value, Tensor)), "cpu")
        if any(_is_half(value) for value in given):
            single: Callable[..., Value] = guarded
            return single(*map(_single, args), **{name: _single(value) for name, value in kwargs.items()})
        if _has_autocast(kind) and torch.is_autocast_enabled(kind):
            with torch.autocast(kind, enabled=False):
                return function(*args, **kwargs)
        return function(*args, **kwargs)

    return guarded


def _has_autocast(kind: str) -> bool:
    if torch.compiler.is_compiling():  # torch 2.10 cannot compile the question
        return kind in ("cpu", "cuda", "xpu")
    return torch.amp.is_autocast_available(kind)


def _is_half(value: object) -> bool:
    return isinstance(value, Tensor) and value.dtype in _HALF


def _single(value: Any) -> Any:
    if not _is_half(value):
        return value
    if not torch.compiler.is_compiling():
        _warn(value.dtype)
    return value.float()


@functools.cache
def _warn(dtype: torch.dtype) -> None:
    warnings.warn(
        f"geometry in {dtype}: rounding it so far costs as much as what bends a mesh, and float32, in which it is "
        "computed from here on, does not bring that back. Keep vertices in float32 or float64: under autocast, make "
        "them with autocast off (torch.autocast(..., enabled=False)).",
        stacklevel=4,
    )
