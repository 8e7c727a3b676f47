"""An element term: the residual of one element, repeated over many elements of the state."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import torch
from torch import Tensor

from ..errors import ShapeError, TorchfairError
from .checks import check_data, check_term
from .differentiation import AutomaticWay, Way, as_rows, differentiate
from .element_function import checked, mapped
from .layout import Layout, State
from .loss import Loss, Squares, apply_root, is_one_sided
from .portions import Arguments, by_portions

Residual = Callable[..., Tensor]
Refresh = Callable[[State], Sequence[Tensor]]


@dataclass(frozen=True)
class ElementTerm:
    r"""A sum over elements of ``weight * element_weight * loss(residual)``.

    Write :attr:`residual` for ONE element, in torch: it takes one tensor ``(k, d)`` for each entry of
    :attr:`stencil`, then one tensor for each entry of the data, and returns a scalar or ``(m,)``. The
    library maps it over the elements, differentiates it and assembles the sparse system::

        def stretched(x, length):           # x: (2, 3), the two ends of an edge
            return torch.linalg.vector_norm(x[1] - x[0]) - length

        ElementTerm("edge length", stretched, [("vertices", topology.edges)], data=(lengths,), weight=10.0)

    Everything is in the dtype of the blocks and on their device. A solve is not differentiated through: data and
    weights that require gradients are detached, silently.

    Attributes:
        name: Shown in the residual table; terms of one name are reported together.
        residual: The element function. It must be finite and differentiable where the solver goes; a value
            that is not finite rejects the step (this makes barriers possible).
        stencil: ``(block name, (n, k) index tensor)`` pairs; rows of the block, counted from 0.
        data: Tensors ``(n, ...)`` handed to the residual element by element, constant for derivatives.
        weight: Dimensionless weight of the term, at least 0. It multiplies the loss, so with :class:`Squares` half the
            squares.
        element_weights: ``(n,)`` optional factors, at least 0.
        loss: :class:`Squares`, :class:`SmoothAbsolute`, :class:`OneSided` for inequalities, or another :class:`Loss`.
        refresh: Called with every state that is evaluated; returns the ``data`` for that state (closest
            points, frozen directions), a sequence. The merit is therefore a function of the state alone.
        merit: Element function with the same arguments that replaces the loss in the acceptance test, for
            reweighted targets whose residual is only a quadratic model; same gradient, never below zero.
        jacobian: Closed form of the derivative of the residual, ``(m, k_1 d_1 + k_2 d_2 + ...)`` or, for a
            scalar residual, ``(k_1 d_1 + ...,)``; by default torch differentiates. At the first start it is compared
            with that at a few elements, in float64 where the functions allow it; one that differs is an error.
        derivatives: How the residual is differentiated. ``"closed form"`` by :attr:`jacobian`; ``"sums"`` by reverse
            mode through ``vmap(residual)``, once for each component, summed over the elements; ``"jacrev"`` and
            ``"jacfwd"`` by ``torch.func`` under ``vmap``. They agree up to rounding. By default the fastest: the closed
            form if there is one; sums; forward mode where an element has more components than unknowns.
        linear: The residual is affine in the state and has no refresh: differentiated only once.
        silent: The derivative is zero wherever the residual is exactly zero, as that of a barrier far from its bound.
            Where there are many elements, those take no part in linear systems, and their derivatives are not computed.
        batched: :attr:`residual`, :attr:`merit` and :attr:`jacobian` take all n elements at once, ``(n, k, d)`` and
            data ``(n, ...)``, and return results with n rows: faster where closed forms are written for it. They work
            for any n; rows must not depend on each other.
    """

    name: str
    residual: Residual
    stencil: Sequence[tuple[str, Tensor]]
    data: Sequence[Tensor] = ()
    weight: float = 1.0
    element_weights: Tensor | None = None
    loss: Loss = field(default_factory=Squares)
    refresh: Refresh | None = None
    merit: Residual | None = None
    jacobian: Residual | None = None
    derivatives: Way | None = None
    linear: bool = False
    silent: bool = False
    batched: bool = False

    @property
    def num_elements(self) -> int:
        """N, the number of elements."""
        return self.stencil[0][1].shape[0]

    def check(self, layout: Layout) -> None:
        """Raises ShapeError unless stencil, data and weights fit each other and the blocks."""
        check_term(self, layout)

    def arguments(self, state: State) -> tuple[Tensor, ...]:
        """Arguments of :attr:`residual` for all elements at once: ``(n, k, d)`` locals, then the data."""
        return tuple(self.arguments_at(state))

    def arguments_at(self, state: State) -> Arguments:
        """The same, gathered when they are needed; the data are those of the state."""
        for name, _ in self.stencil:
            if state[name].ndim != 2:
                expected = f"(n, {state[name].shape[-1]}), of one member (constraints.Constraint takes batches)"
                raise ShapeError(f"term '{self.name}', block '{name}'", expected, tuple(state[name].shape))
        data, first = self.data, state[self.stencil[0][0]]
        if self.refresh is not None:
            data = self.refresh(state)
            what = f"term '{self.name}', data that refresh returns"
            check_data(what, data, self.num_elements, first.dtype, first.device)
        return Arguments(self, state, tuple(tensor.detach() for tensor in data))

    def roots(self, residuals: Tensor) -> Tensor:
        """Square roots (n,) or (n, m, m) of all weights of the quadratic model made at residuals ``(n, m)``."""
        root = self.loss.root(residuals)
        n, m = residuals.shape
        if root.shape not in ((n,), (n, m, m)):
            raise ShapeError(f"term '{self.name}', root of its loss", f"({n},) or ({n}, {m}, {m})", tuple(root.shape))
        weights = residuals.new_full((1,), self.weight)
        if self.element_weights is not None:
            return apply_root((weights * self.element_weights).sqrt(), root)
        if n and root.stride() == (0,):
            return (weights.sqrt() * root[:1]).expand(n)  # one number for all, kept once
        return apply_root(weights.sqrt().expand(n), root)

    def values(self, arguments: Sequence[Tensor]) -> Tensor:
        """Residuals ``(n, m)``."""
        return as_rows(by_portions(mapped(self, "residual"), arguments))

    def missed(self, residuals: Tensor) -> Tensor:
        """Residuals ``(n, m)`` without what holds of inequalities."""
        return residuals.clamp_min(0.0) if is_one_sided(self.loss) else residuals

    def contributions(self, arguments: Sequence[Tensor], residuals: Tensor) -> Tensor:
        """(n,) merit of every element."""
        if self.merit is None:
            own = self.loss.value(residuals)
            if own.shape != residuals.shape[:1]:
                raise ShapeError(f"term '{self.name}', value of its loss", f"({len(residuals)},)", tuple(own.shape))
        else:
            own = by_portions(mapped(self, "merit"), arguments)
        value = self.weight * own
        return value if self.element_weights is None else value * self.element_weights

    @property
    def has_closed_form(self) -> bool:
        """Whether :attr:`jacobian` is there and not passed over."""
        return self.jacobian is not None and self.derivatives in (None, "closed form")

    def linearised(self, arguments: tuple[Tensor, ...]) -> tuple[Tensor, Tensor]:
        """Residuals ``(n, m)`` and Jacobians ``(n, m, K)``, K unknowns of the stencil in order."""
        if not self.has_closed_form:
            return self.automatic_derivatives(arguments)
        values, closed = self.values(arguments), self.jacobians(arguments)
        if closed.shape[:2] != values.shape:
            what = f"({values.shape[1]}, {closed.shape[2]}) as residual and unknowns"
            raise ShapeError(f"term '{self.name}', jacobian of an element", what, tuple(closed.shape[1:]))
        return values, closed

    def automatic_derivatives(
        self, arguments: tuple[Tensor, ...], way: AutomaticWay | None = None
    ) -> tuple[Tensor, Tensor]:
        """The same by differentiating :attr:`residual`, also where there is a closed form.

        Args:
            arguments: Of all elements.
            way: By default that of :attr:`derivatives`, or the fastest.
        """
        if torch.is_inference_mode_enabled():
            raise TorchfairError(f"term '{self.name}' is differentiated, but not in inference mode: use torch.no_grad")
        function, what = checked(self, "residual"), f"the residual of term '{self.name}'"
        own = None if self.derivatives == "closed form" else self.derivatives
        return differentiate(function, arguments, len(self.stencil), batched=self.batched, what=what, way=way or own)

    def jacobians(self, arguments: tuple[Tensor, ...]) -> Tensor:
        """Jacobians ``(n, m, K)``."""
        if not self.has_closed_form:
            return self.automatic_derivatives(arguments)[1]
        closed = mapped(self, "jacobian")(*arguments)
        return closed if closed.ndim == 3 else closed[:, None]
