"""Closed-form Jacobians compared with automatic differentiation of the residual, at a few elements."""

from __future__ import annotations

import torch
from torch import Tensor

from ..errors import TorchfairError
from .term import ElementTerm

_ELEMENTS = 8
_TOLERANCE = 1e-3  # of the largest derivative of the same component, as for linear terms
_MOVED = 1e-2  # of the size of an element


def check_derivative(term: ElementTerm, arguments: tuple[Tensor, ...]) -> None:
    """Raises TorchfairError if the closed form of a term is not the derivative of its residual.

    Where a residual has a kink, a closed form may give another subgradient than automatic differentiation, and where
    it cancels all digits, other digits. Neither remains if the element is moved a little, a wrong closed form does. So
    elements that differ are looked at again there; what is not finite is no verdict.

    Args:
        term: With a closed form, and at least one element.
        arguments: Of all its elements, at any state.

    Raises:
        ShapeError: the closed form has the wrong shape.
    """
    count = arguments[0].shape[0]
    chosen = torch.linspace(0, count - 1, min(count, _ELEMENTS), device=arguments[0].device).round().long()
    few = tuple(argument[chosen] for argument in arguments)
    wrong = _differs(term, few)
    if not bool(wrong.any()):
        return
    blocks = len(term.stencil)
    moved = (*(_moved(local) for local in few[:blocks]), *few[blocks:])
    bad = torch.nonzero(wrong & _differs(term, moved))
    if len(bad):
        element, component, unknown = bad[0].tolist()
        closed, automatic = (part[element, component, unknown] for part in _both(term, few))
        raise TorchfairError(
            f"the jacobian of term '{term.name}' is not the derivative of its residual: at element "
            f"{int(chosen[element])}, component {component} changes by {float(automatic):.4g} with "
            f"{_unknown(term, int(chosen[element]), unknown, few)}, not by {float(closed):.4g}. "
            "Correct the closed form, or leave out jacobian= and let torch differentiate"
        )


def _both(term: ElementTerm, arguments: tuple[Tensor, ...]) -> tuple[Tensor, Tensor]:
    """Jacobians (n, m, K), closed and automatic."""
    return term.derivatives(arguments)[1], term.automatic_derivatives(arguments)[1]


def _differs(term: ElementTerm, arguments: tuple[Tensor, ...]) -> Tensor:
    """(n, m, K) bool: entries that are finite and differ by more than rounding."""
    closed, automatic = _both(term, arguments)
    apart = (closed - automatic).abs()
    finite = torch.isfinite(closed).all(2) & torch.isfinite(automatic).all(2)
    sizes = torch.maximum(closed.abs(), automatic.abs()).amax(2)
    sizes = torch.where(finite, sizes, 0.0)
    rounding = torch.finfo(sizes.dtype).eps ** 0.5 * sizes.max()
    allowed = (_TOLERANCE * sizes.amax(0)).clamp_min(rounding)
    return (apart > allowed[:, None]) & finite[:, :, None]


def _moved(local: Tensor) -> Tensor:
    """Unknowns (n, k, d) of elements, moved by a hundredth of the size of each, no two alike."""
    spread = (local - local.mean(1, keepdim=True)).abs().amax((1, 2), keepdim=True)
    size = torch.where(spread > 0.0, spread, local.abs().amax((1, 2), keepdim=True))
    size = torch.where(size > 0.0, size, 1.0)
    ways = torch.sin(torch.arange(1, local.numel() + 1, device=local.device, dtype=local.dtype))
    return local + _MOVED * size * ways.reshape(local.shape)


def _unknown(term: ElementTerm, element: int, unknown: int, arguments: tuple[Tensor, ...]) -> str:
    """The unknown (of K) of an element in words, by block, row and coordinate."""
    for (name, index), local in zip(term.stencil, arguments, strict=False):
        width = local.shape[2]
        if unknown < index.shape[1] * width:
            return f"coordinate {unknown % width} of row {int(index[element, unknown // width])} of block '{name}'"
        unknown -= index.shape[1] * width
    raise AssertionError("no such unknown")
