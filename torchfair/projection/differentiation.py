"""Jacobians of element functions by torch: three ways that agree, and which is taken where none is asked for."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

import torch
from torch import Tensor

from ..errors import TorchfairError

Way = Literal["closed form", "sums", "jacrev", "jacfwd"]
AutomaticWay = Literal["sums", "jacrev", "jacfwd"]

_Function = Callable[..., Tensor]


def as_rows(values: Tensor) -> Tensor:
    """``(n,)`` or ``(n, m)`` as ``(n, m)``."""
    return values[:, None] if values.ndim == 1 else values


def differentiate(
    residual: _Function,
    arguments: tuple[Tensor, ...],
    count: int,
    *,
    batched: bool = False,
    what: str = "the residual",
    way: AutomaticWay | None = None,
) -> tuple[Tensor, Tensor]:
    """Residuals ``(n, m)`` and Jacobians ``(n, m, K)`` with respect to the first ``count`` arguments.

    ``"sums"``: elements do not depend on each other, so the gradient of the sum of one component over all elements
    holds that component's row of every element. Reverse mode through ``vmap(residual)`` costs one sweep for each of the
    m components. ``"jacrev"`` and ``"jacfwd"``: ``vmap(jacrev(residual))`` and ``vmap(jacfwd(residual))`` of
    ``torch.func``; m sweeps in reverse mode, all at once, and K in forward mode.

    Args:
        residual: Of one element, or of all if ``batched``.
        arguments: Of all elements, ``(n, ...)``.
        count: How many of them hold unknowns.
        batched: Whether the residual takes all elements at once.
        what: Its name in errors.
        way: By default the fastest of them, as ``benchmarks/bench_derivatives.py`` finds: sums, or forward mode where
            elements have more components than unknowns.

    Raises:
        TorchfairError: the residual does not depend on the first arguments (only ``"sums"`` can tell).
    """
    if way is None or way == "sums":
        values, jacobians = _by_sums(residual, arguments, count, batched, what, forward=way is None)
        if jacobians is not None:
            return values, jacobians
        way = "jacfwd"
    else:
        with torch.no_grad():
            values = as_rows((residual if batched else torch.func.vmap(residual))(*arguments))
    if not values.shape[0]:
        return values, values.new_zeros(*values.shape, 0)
    return values, _by_transform(residual, arguments, count, batched, way)


def _by_sums(
    residual: _Function, arguments: tuple[Tensor, ...], count: int, batched: bool, what: str, *, forward: bool
) -> tuple[Tensor, Tensor | None]:
    """Residuals and Jacobians; no Jacobians where forward mode is allowed and cheaper."""
    local = [a.detach().requires_grad_() for a in arguments[:count]]
    with torch.enable_grad():
        values = as_rows((residual if batched else torch.func.vmap(residual))(*local, *arguments[count:]))
        if values.numel() and not values.requires_grad:
            raise TorchfairError(
                f"{what} does not depend on its unknowns in a way that torch can differentiate: leave out "
                "detach(), comparisons and rounding, or the term"
            )
        totals = values.sum(0).unbind() if values.requires_grad else ()
    outputs, inputs = values.shape[1], sum(a[0].numel() for a in local) if values.shape[0] else 0
    if forward and outputs > inputs > 0:
        return values.detach(), None
    rows = []
    for total in totals:
        gradients = torch.autograd.grad(total, local, retain_graph=True, materialize_grads=True)
        rows.append(torch.cat([gradient.flatten(1) for gradient in gradients], dim=1))
    values = values.detach()
    return values, torch.stack(rows, dim=1) if rows else values.new_zeros(*values.shape, inputs)


def _by_transform(residual: _Function, arguments: tuple[Tensor, ...], count: int, batched: bool, way: Way) -> Tensor:
    """Jacobians by ``torch.func``, element by element."""

    def flat(*inputs: Tensor) -> Tensor:
        value = residual(*(part[None] for part in inputs))[0] if batched else residual(*inputs)
        return value.reshape(-1)

    transform = torch.func.jacrev if way == "jacrev" else torch.func.jacfwd
    blocks = torch.func.vmap(transform(flat, argnums=tuple(range(count))))(*arguments)
    return torch.cat([block.flatten(2) for block in blocks], dim=2).detach()
