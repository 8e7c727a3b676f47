"""The functions of a term, with what they return checked where it is returned."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from .._shown import shown
from ..errors import ShapeError, TorchfairError

if TYPE_CHECKING:
    from .term import ElementTerm

_EXPECTED = {"residual": "a scalar or (m,)", "merit": "a scalar", "jacobian": "({K},) or (m, {K})"}
_EXPECTED_BATCHED = {"residual": "(n,) or (n, m)", "merit": "(n,)", "jacobian": "(n, {K}) or (n, m, {K})"}
_DIMENSIONS = {"residual": (0, 1), "merit": (0,), "jacobian": (1, 2)}


def checked(term: ElementTerm, part: str) -> Callable[..., Tensor]:
    """The residual, merit or jacobian of a term, as the user wrote it: for one element, or for all if it is batched.

    Raises:
        ShapeError: (the function) it returns something else than a tensor of the right shape and dtype.
        TorchfairError: (the function) it raises an error, which is the cause of this one; the term is named.
    """
    function = getattr(term, part)

    def with_checks(*arguments: Tensor) -> Tensor:
        try:
            value = function(*arguments)
        except (TorchfairError, MemoryError, torch.OutOfMemoryError):
            raise
        except Exception as error:
            raise TorchfairError(_failure(term, part, arguments, error)) from error
        _check_value(term, part, arguments, value)
        result: Tensor = value
        return result

    return with_checks


def mapped(term: ElementTerm, part: str) -> Callable[..., Tensor]:
    """The same for all elements at once."""
    function = checked(term, part)
    if term.batched:
        return function
    over_elements: Callable[..., Tensor] = torch.func.vmap(function)
    return over_elements


def _check_value(term: ElementTerm, part: str, arguments: tuple[Tensor, ...], value: object) -> None:
    dtype, batch = arguments[0].dtype, arguments[0].shape[: int(term.batched)]
    unknowns = sum(local.numel() for local in arguments[: len(term.stencil)]) // (batch[0] if batch else 1)
    expected = (_EXPECTED_BATCHED if term.batched else _EXPECTED)[part].format(K=unknowns)
    what = f"term '{term.name}', {part} of {'all elements' if term.batched else 'an element'}"
    if not isinstance(value, Tensor):
        raise ShapeError(what, f"a tensor, {expected}", shown(value))
    shape = value.shape[len(batch) :]
    if len(shape) not in _DIMENSIONS[part] or value.shape[: len(batch)] != batch or 0 in shape[:1]:
        raise ShapeError(what, expected, shown(value))
    if part == "jacobian" and shape[-1] != unknowns:
        raise ShapeError(what, expected, shown(value))
    if value.dtype != dtype:
        raise ShapeError(what, f"{dtype} like the blocks (make constants with x.new_tensor)", shown(value))


def _failure(term: ElementTerm, part: str, arguments: tuple[Tensor, ...], error: Exception) -> str:
    count = len(term.stencil)
    given = [str(tuple(a.shape)) for a in arguments]
    data = f" and data {', '.join(given[count:])}" if given[count:] else ""
    first = (str(error).strip().splitlines() or [""])[0].split(". ")[0].rstrip(" .")
    if isinstance(error, TypeError):
        remedy = "It is called with a tensor for each entry of the stencil, then one for each of the data"
    elif term.batched:
        remedy = "It has to take any number n of elements, with what differs by element in data"
    else:
        remedy = "Write it for one element in torch alone, with torch.where for if, without .item() or changes in place"
    return (
        f"term '{term.name}': its {part} fails for unknowns {', '.join(given[:count])}{data} with "
        f"{type(error).__name__}: {first}. {remedy}"
    )
