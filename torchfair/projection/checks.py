"""What is asked of the parts of a term: stencil, data, weights, loss."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, get_args

import torch
from torch import Tensor

from .._numbers import is_number
from .._shown import shown
from ..errors import ShapeError
from .differentiation import Way
from .loss import Squares, is_one_sided

if TYPE_CHECKING:
    from .layout import Layout
    from .term import ElementTerm

_FIRST = 5


def listed(terms: object) -> list[ElementTerm]:
    """Terms as a list; raises ShapeError naming what is none among them."""
    from .term import ElementTerm

    if isinstance(terms, ElementTerm) or not isinstance(terms, Iterable):
        raise ShapeError("terms", "a list of ElementTerm", shown(terms))
    result: list[ElementTerm] = list(terms)
    for i, term in enumerate(result):
        if not isinstance(term, ElementTerm):
            raise ShapeError(f"terms[{i}]", "an ElementTerm (unpack lists of them with *)", shown(term))
    if not result:
        raise ShapeError("terms", "at least one block and one term", "no term")
    return result


def check_term(term: ElementTerm, layout: Layout) -> None:
    """Raises ShapeError unless stencil, data and weights of a term fit each other and the blocks."""
    if not isinstance(term.name, str):
        raise ShapeError("the first argument of ElementTerm", "the name of the term", shown(term.name))
    what = f"term '{term.name}'"
    for part in ("residual", "refresh", "merit", "jacobian"):
        function = getattr(term, part)
        if not callable(function) and (function is not None or part == "residual"):
            raise ShapeError(f"{what}, {part}", "a function", shown(function))
    check_way(what, term.derivatives)
    if term.derivatives == "closed form" and term.jacobian is None:
        raise ShapeError(f"{what}, derivatives", "a jacobian, which is the closed form", "none")
    _check_stencil(what, term.stencil, layout)
    check_data(f"{what}, data", term.data, term.num_elements, layout.dtype, layout.device)
    _check_weights(what, term, layout)
    if isinstance(term.loss, type) or not (hasattr(term.loss, "value") and hasattr(term.loss, "root")):
        raise ShapeError(f"{what}, loss", "an object such as Squares() or SmoothAbsolute(0.1)", shown(term.loss))
    if term.linear and (term.refresh is not None or not isinstance(term.loss, Squares) or term.merit is not None):
        raise ShapeError(what, "a linear term with squares and without refresh or merit", "one of these")
    if term.merit is not None and is_one_sided(term.loss):
        raise ShapeError(what, "inequalities without a merit of their own", "one")
    if term.refresh is not None and len(term.data):
        raise ShapeError(what, "data or refresh, which returns all data of a state", "both")


def check_way(what: str, way: object) -> None:
    """Raises ShapeError unless this is a way to differentiate, or None."""
    if way is not None and way not in get_args(Way):
        raise ShapeError(f"{what}, derivatives", f"one of {', '.join(get_args(Way))}, or None", shown(way))


def check_data(what: str, data: object, count: int, dtype: torch.dtype, device: torch.device) -> None:
    """Raises ShapeError unless data are tensors with a row for each element; numbers with a fraction as the blocks."""
    if not isinstance(data, Sequence) or isinstance(data, str):
        raise ShapeError(what, "a sequence of tensors, such as (lengths,)", shown(data))
    for i, tensor in enumerate(data):
        _check_rows(f"{what}[{i}]", tensor, dtype, device)
        if tensor.shape[:1] != (count,):
            raise ShapeError(f"{what}[{i}]", f"({count}, ...), a row for each element", shown(tensor))


def _check_rows(what: str, tensor: object, dtype: torch.dtype, device: torch.device) -> None:
    if not isinstance(tensor, Tensor):
        raise ShapeError(what, "a tensor with a row for each element", shown(tensor))
    if (tensor.is_floating_point() or tensor.is_complex()) and tensor.dtype != dtype:
        raise ShapeError(what, f"{dtype} like the blocks (convert it with .to)", shown(tensor))
    if tensor.device != device:
        raise ShapeError(what, f"a tensor on {device} like the blocks (move it with .to)", shown(tensor))


def _check_stencil(what: str, stencil: object, layout: Layout) -> None:
    what = f"{what}, stencil"
    if not isinstance(stencil, Sequence) or isinstance(stencil, str) or not stencil:
        raise ShapeError(what, 'pairs of block name and indices, such as [("vertices", edges)]', shown(stencil))
    count = None
    for pair in stencil:
        if not isinstance(pair, Sequence) or isinstance(pair, str) or len(pair) != 2 or not isinstance(pair[0], str):
            raise ShapeError(what, 'pairs of block name and indices, such as [("vertices", edges)]', shown(pair))
        name, index = pair
        if name not in layout.sizes:
            raise ShapeError(what, f"blocks among {list(layout.sizes)}", f"'{name}'")
        place = f"{what} of '{name}'"
        if not isinstance(index, Tensor) or index.dtype not in (torch.int64, torch.int32):
            raise ShapeError(place, "indices, a tensor of int64", shown(index))
        if index.ndim != 2 or count not in (None, index.shape[0]):
            rows = "n" if count is None else count
            raise ShapeError(place, f"indices ({rows}, k), a row for each element", shown(index))
        count = index.shape[0]
        if index.device != layout.device:
            raise ShapeError(place, f"indices on {layout.device} like the blocks", shown(index))
        _check_range(place, index, layout.sizes[name][0])


def _check_range(place: str, index: Tensor, rows: int) -> None:
    if index.numel() and (int(index.min()) < 0 or int(index.max()) >= rows):
        element, entry = torch.nonzero((index < 0) | (index >= rows))[0].tolist()
        raise ShapeError(
            place, f"indices in 0..{rows - 1}", f"{int(index[element, entry])} at [{element}, {entry}] (element, entry)"
        )


def _check_weights(what: str, term: ElementTerm, layout: Layout) -> None:
    if not is_number(term.weight) or not 0.0 <= term.weight < math.inf:
        given = shown(term.weight)
        raise ShapeError(f"{what}, weight", "a finite number of at least 0 (element_weights differ by element)", given)
    weights = term.element_weights
    if weights is None:
        return
    _check_rows(f"{what}, element_weights", weights, layout.dtype, layout.device)
    if tuple(weights.shape) != (term.num_elements,):
        raise ShapeError(
            f"{what}, element_weights", f"({term.num_elements},), a number for each element", shown(weights)
        )
    bad = torch.nonzero(~((weights >= 0) & (weights < math.inf))).squeeze(1)
    if len(bad):
        first = bad[:_FIRST].tolist()
        given = f"{weights[bad[:_FIRST]].tolist()} at elements {first}"
        raise ShapeError(f"{what}, element_weights", "finite numbers of at least 0", given)
