"""What a term declares about its functions, tried at a few elements: closed forms, rows independent of each other."""

from __future__ import annotations

import torch
from torch import Tensor

from ..errors import TorchfairError
from .differentiation import as_rows, differentiate
from .element_function import checked
from .portions import Arguments
from .term import ElementTerm

_ELEMENTS = 8
_TOLERANCE = {torch.float64: 1e-3, torch.float32: 5e-2}  # of the largest derivative of the same component
_MOVED = 1e-2  # of the size of an element


def check_declarations(term: ElementTerm, arguments: Arguments) -> None:
    """Raises TorchfairError unless a closed form is the derivative and rows of a batched term stand for themselves.

    Likewise where the residual does not depend on the unknowns, for which ``torch.func`` gives zeros without a word.

    Args:
        term: With at least one element.
        arguments: Of all its elements, at any state.

    Raises:
        ShapeError: a closed form has the wrong shape.
    """
    transformed = term.derivatives in ("jacrev", "jacfwd")
    if not (term.batched or term.has_closed_form or transformed or term.silent):
        return
    count, device = term.num_elements, term.stencil[0][1].device
    chosen = torch.linspace(0, count - 1, min(count, _ELEMENTS), device=device).round().long()
    few = arguments.part(chosen)
    if term.batched:
        _check_rows(term, _moved(term, few))
    if transformed:
        term.automatic_derivatives(few, "sums")
    if term.has_closed_form:
        _check_derivative(term, few, chosen.tolist())
    if term.silent:
        _check_silence(term, few, chosen.tolist())


def _check_silence(term: ElementTerm, arguments: tuple[Tensor, ...], elements: list[int]) -> None:
    """Where residuals are zero, derivatives have to be."""
    values, jacobians = term.linearised(arguments)
    bad = torch.nonzero((values == 0.0).all(1) & (jacobians != 0.0).any(2).any(1)).flatten().tolist()
    if bad:
        raise TorchfairError(
            f"term '{term.name}' is declared silent, but in element {elements[bad[0]]}, where its residual is zero, "
            "its derivative is not: leave out silent=True"
        )


def _check_rows(term: ElementTerm, arguments: tuple[Tensor, ...]) -> None:
    """The last element has to have alone the residual that it has among several."""
    together = term.values(arguments)
    alone = term.values(tuple(argument[-1:] for argument in arguments))
    same = alone.shape[1] == together.shape[1]
    apart = (alone - together[-1:]).abs().max() if same else torch.inf
    if apart > 1e-3 * torch.nan_to_num(together).abs().max():
        raise TorchfairError(
            f"the residual of term '{term.name}' for the last element is another one for that element alone: write it "
            "for arrays (n, k, d) of any number n of elements, or leave out batched=True"
        )


def _check_derivative(term: ElementTerm, arguments: tuple[Tensor, ...], elements: list[int]) -> None:
    """Compares a closed form with automatic differentiation.

    Where a residual has a kink, a closed form may give another subgradient than automatic differentiation, and next to
    singular places rounding decides. Neither remains if the element is moved a little, a wrong closed form does. So
    elements that differ are looked at again there; what is not finite is no verdict, nor is a residual that torch
    cannot differentiate. All this is done in float64, if the functions of the term can.
    """
    try:
        few = tuple(argument.double() if argument.is_floating_point() else argument for argument in arguments)
        closed = term.linearised(few)[1]
    except TorchfairError:
        few = arguments
        closed = term.linearised(few)[1]
    if not _mixture_differs(term, few, closed):
        return
    automatic = term.automatic_derivatives(few)[1]
    wrong = _differ(closed, automatic)
    moved = _moved(term, few)
    bad = torch.nonzero(wrong & _differ(term.linearised(moved)[1], term.automatic_derivatives(moved)[1]))
    if len(bad):
        element, component, unknown = bad[0].tolist()
        rates = [float(part[element, component, unknown]) for part in (automatic, closed)]
        raise TorchfairError(
            f"the jacobian of term '{term.name}' is not the derivative of its residual: in element "
            f"{elements[element]}, component {component} changes by {rates[0]:.4g} with "
            f"{_in_words(term, elements[element], unknown, few)}, not by {rates[1]:.4g}. "
            "Correct the closed form, or leave out jacobian= and let torch differentiate"
        )


def _mixture_differs(term: ElementTerm, arguments: tuple[Tensor, ...], closed: Tensor) -> bool:
    """Whether a mixture of the rows of Jacobians (n, m, K) is not the derivative of that mixture of components.

    Differentiating it costs one sweep instead of m. Every component has about the same share in it.
    """
    sizes = torch.nan_to_num(closed).abs().amax((0, 2))
    sizes = torch.where(sizes > 0.0, sizes, sizes.max() if float(sizes.max()) else 1.0)
    shares = (2.0 + torch.sin(torch.arange(1, sizes.shape[0] + 1, device=sizes.device))).to(sizes) / sizes
    residual = checked(term, "residual")

    def mixture(*arguments: Tensor) -> Tensor:
        values = residual(*arguments)
        return ((as_rows(values) if term.batched else values) * shares).sum(-1)

    try:
        automatic = differentiate(mixture, arguments, len(term.stencil), batched=term.batched)[1]
    except TorchfairError:
        return False
    return bool(_differ(torch.einsum("m,nmk->nk", shares, closed)[:, None], automatic).any())


def _differ(closed: Tensor, automatic: Tensor) -> Tensor:
    """(n, m, K) bool: entries that are finite and differ by more than rounding."""
    finite = (torch.isfinite(closed) & torch.isfinite(automatic)).all(2)
    sizes = torch.where(finite, torch.maximum(closed.abs(), automatic.abs()).amax(2), 0.0)
    rounding = torch.finfo(sizes.dtype).eps ** 0.5 * sizes.max()
    allowed = (_TOLERANCE[sizes.dtype] * sizes.amax(0)).clamp_min(rounding)
    return ((closed - automatic).abs() > allowed[:, None]) & finite[:, :, None]


def _moved(term: ElementTerm, arguments: tuple[Tensor, ...]) -> tuple[Tensor, ...]:
    count = len(term.stencil)
    return (*(_moved_unknowns(local) for local in arguments[:count]), *arguments[count:])


def _moved_unknowns(local: Tensor) -> Tensor:
    """Unknowns (n, k, d) of elements, moved by a hundredth of the size of each, no two alike."""
    if not local.numel():
        return local
    spread = (local - local.mean(1, keepdim=True)).abs().amax((1, 2), keepdim=True)
    size = torch.where(spread > 0.0, spread, local.abs().amax((1, 2), keepdim=True))
    size = torch.where(size > 0.0, size, 1.0)
    ways = torch.sin(torch.arange(1, local.numel() + 1, device=local.device, dtype=local.dtype))
    return local + _MOVED * size * ways.reshape(local.shape)


def _in_words(term: ElementTerm, element: int, unknown: int, arguments: tuple[Tensor, ...]) -> str:
    """The unknown (of K) of an element by coordinate, row and block."""
    names = [
        f"coordinate {coordinate} of row {row} of block '{name}'"
        for (name, index), local in zip(term.stencil, arguments, strict=False)
        for row in index[element].tolist()
        for coordinate in range(local.shape[2])
    ]
    return names[unknown]
