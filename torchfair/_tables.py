"""Tables that are made once and kept, wherever they are first asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import cached_property
from typing import Any, TypeVar

import torch

Value = TypeVar("Value")


def cached_table(function: Callable[[Any], Value]) -> cached_property[Value]:
    """``functools.cached_property`` whose tensors are ordinary ones.

    Those made under ``torch.inference_mode`` cannot be used in training ever after; those made under a transform of
    ``torch.func`` or while something is recorded belong to that. ``torch.compile`` records how they are made, unless
    they are there.
    """

    def make(owner: Any) -> Value:
        if torch.compiler.is_compiling():
            return function(owner)
        with outside_of_transforms():
            return function(owner)

    make.__doc__, make.__name__ = function.__doc__, function.__name__
    return cached_property(make)


@contextmanager
def outside_of_transforms() -> Iterator[None]:
    """Leaves inference mode, transforms of ``torch.func``, and modes that record, for as long as tables are made."""
    with ExitStack() as stack:
        stack.enter_context(torch.inference_mode(False))
        tracing = torch._C._get_tracing_state()
        if tracing is not None:  # of torch.jit.trace
            torch._C._set_tracing_state(None)  # type: ignore[attr-defined]  # the stubs leave it out
            stack.callback(torch._C._set_tracing_state, tracing)  # type: ignore[attr-defined]
        if torch._C._are_functorch_transforms_active():
            from torch._functorch.pyfunctorch import temporarily_clear_interpreter_stack

            stack.enter_context(temporarily_clear_interpreter_stack())
        if torch._C._len_torch_dispatch_stack():
            from torch._subclasses.fake_tensor import unset_fake_temporarily
            from torch.fx.experimental.proxy_tensor import disable_proxy_modes_tracing

            stack.enter_context(disable_proxy_modes_tracing())
            stack.enter_context(unset_fake_temporarily())
        yield
