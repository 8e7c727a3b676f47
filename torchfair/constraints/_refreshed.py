"""Data that a term works out anew for every state, for all members of a batch and under transforms of torch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import torch
from torch import Tensor
from torch.autograd import Function

from ..projection import ElementTerm
from ..projection.checks import check_data


def refreshed(term: ElementTerm, members: Tensor) -> list[Tensor]:
    """Data (B, n, ...) of a term at each of ``members`` (B, V, d), its one block; constant for derivatives.

    The search for closest points, and whatever users write, sees plain tensors (V, d), also under ``torch.func``: what
    it keeps for the next time holds no graph.
    """
    if torch.compiler.is_compiling():  # as a decorator it would load the compiler, a second long, for everybody
        uncompiled = torch.compiler.disable(_refreshed)  # type: ignore[no-untyped-call]
        compiled: list[Tensor] = uncompiled(term, members)
        return compiled
    return _refreshed(term, members)


def _refreshed(term: ElementTerm, members: Tensor) -> list[Tensor]:
    found = _Refreshed.apply(members.detach(), term)  # type: ignore[no-untyped-call]
    return [tensor.detach() for tensor in found]


class _Refreshed(Function):
    """``(members, term) -> data``; a function of autograd, since that unwraps the tensors of all transforms."""

    @staticmethod
    def forward(members: Tensor, term: ElementTerm) -> tuple[Tensor, ...]:
        assert term.refresh is not None
        block, what = term.stencil[0][0], f"term '{term.name}', data that refresh returns"
        parts: list[Sequence[Tensor]] = []
        for member in members.unbind(0):
            parts.append(term.refresh({block: member}))
            check_data(what, parts[-1], term.num_elements, members.dtype, members.device)
        return tuple(torch.stack(pieces) for pieces in zip(*parts, strict=True))

    @staticmethod
    def setup_context(ctx: Any, inputs: tuple[Tensor, ElementTerm], output: tuple[Tensor, ...]) -> None:
        ctx.mark_non_differentiable(*output)
        ctx.count = len(output)

    @staticmethod
    def backward(ctx: Any, *cotangents: Tensor | None) -> tuple[None, None]:
        return None, None

    @staticmethod
    def jvp(ctx: Any, *tangents: Any) -> tuple[None, ...]:
        return (None,) * int(ctx.count)

    @staticmethod
    def vmap(info: Any, in_dims: tuple[int, None], members: Tensor, term: ElementTerm) -> tuple[Any, tuple[int, ...]]:
        whole = members.movedim(in_dims[0], 0)
        found = _Refreshed.apply(whole.flatten(0, 1), term)  # type: ignore[no-untyped-call]
        return tuple(tensor.unflatten(0, whole.shape[:2]) for tensor in found), (0,) * len(found)
