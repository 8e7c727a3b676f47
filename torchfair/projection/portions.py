"""Functions of all elements, evaluated portion by portion: temporaries are small and stay in the cache."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from .._portions import PORTION, portions_unless

if TYPE_CHECKING:
    from .layout import State
    from .term import ElementTerm

_PORTION = PORTION


class Arguments(Sequence[Tensor]):
    """Arguments of the functions of a term at a state, as :meth:`ElementTerm.arguments` gives them.

    The unknowns of elements are gathered whenever they are asked for.

    Attributes:
        term: Of the elements.
        state: Blocks.
        data: That of the term at this state.
    """

    def __init__(self, term: ElementTerm, state: State, data: tuple[Tensor, ...]) -> None:
        self.term, self.state, self.data = term, state, data

    def __len__(self) -> int:
        return len(self.term.stencil) + len(self.data)

    def __getitem__(self, number):  # type: ignore[no-untyped-def]
        return self.part(slice(None))[number]

    def __iter__(self) -> Iterator[Tensor]:
        return iter(self.part(slice(None)))

    def part(self, elements: slice | Tensor) -> tuple[Tensor, ...]:
        """Those of some elements, a range or their numbers."""
        local = tuple(self.state[name][index[elements]] for name, index in self.term.stencil)
        return (*local, *(tensor[elements] for tensor in self.data))


def portions(count: int, like: Tensor) -> list[slice]:
    """Elements to be worked on at once; all of them while anything is recorded, and on other devices than CPUs."""
    return portions_unless(torch.is_grad_enabled(), count, like, _PORTION)


def are_many(count: int) -> bool:
    """Whether there are so many elements that it pays to look which of them matter."""
    return count > 2 * _PORTION


def by_portions(function: Callable[..., Tensor], arguments: Sequence[Tensor]) -> Tensor:
    """``function(*arguments)``, whose rows do not depend on each other.

    Args:
        function: Of tensors ``(n, ...)``, for any n.
        arguments: Tensors, or :class:`Arguments`.
    """
    if isinstance(arguments, Arguments):
        count, like = arguments.term.num_elements, next(iter(arguments.state.values()))
    else:
        count, like = arguments[0].shape[0], arguments[0]
    parts = [function(*_part(arguments, elements)) for elements in portions(count, like)]
    return parts[0] if len(parts) == 1 else torch.cat(parts)


def _part(arguments: Sequence[Tensor], elements: slice) -> tuple[Tensor, ...]:
    if isinstance(arguments, Arguments):
        return arguments.part(elements)
    return tuple(argument[elements] for argument in arguments)
