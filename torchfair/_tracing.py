"""What follows a computation from outside: compilers and tracers that record it, transforms that change it."""

from __future__ import annotations

import torch

from .errors import TorchfairError


def is_recorded() -> bool:
    """Whether calls are recorded or intercepted: torch.compile, export, ``make_fx``, ``jit.trace``, dispatch modes.

    ``torch.func.linearize`` records, too, after its transform has ended: dual numbers of autograd are all that is left.
    """
    return (
        torch.compiler.is_compiling()
        or torch._C._get_tracing_state() is not None
        or torch._C._len_torch_dispatch_stack() > 0
    )


def is_transformed() -> bool:
    """Whether a transform of ``torch.func`` is active."""
    # torch.autograd.Function.apply asks the same question.
    return torch._C._are_functorch_transforms_active()


def refuse_recording(what: str) -> None:
    """Raises TorchfairError where sizes that depend on values cannot be known: in recordings and under ``vmap``.

    ``torch.compile`` is not refused: there ``what`` is left to eager mode.
    """
    exporting = _is_exporting()
    if torch.compiler.is_compiling() and not exporting:
        return
    if exporting or torch._C._get_tracing_state() is not None or _proxies_are_made():
        raise TorchfairError(
            f"{what} cannot be recorded (export, make_fx, jit.trace, torch.func.linearize): which face is seen where "
            "depends on the vertices. Call it in eager mode, leave it out of what is exported, and use torch.func.jvp "
            "in place of linearize."
        )
    if any(level.key() == torch._C._functorch.TransformType.Vmap for level in _transforms()):
        raise TorchfairError(
            f"{what} does not work under vmap (nor jacfwd and hessian, which are made of it): which face is "
            "seen where depends on the vertices. Give it the batch as leading dimensions (*batch, V, 3), and take "
            "derivatives row by row."
        )


def _is_exporting() -> bool:
    asked = getattr(torch.compiler, "is_exporting", None)  # from torch 2.7 on
    return asked is not None and bool(asked())


def _proxies_are_made() -> bool:
    from torch.fx.experimental.proxy_tensor import get_proxy_mode

    return get_proxy_mode() is not None


def _transforms() -> list[torch._C._functorch.CInterpreter]:
    return torch._C._functorch.get_interpreter_stack() or []
