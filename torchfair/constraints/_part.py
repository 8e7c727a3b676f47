"""One term of a constraint: its element function over all elements of all members of a batch."""

from __future__ import annotations

import inspect
from dataclasses import replace

import torch
from torch import Tensor, nn

from ..geometry._ops import gather
from ..projection import ElementTerm
from ._indexed import IndexedModule
from ._refreshed import refreshed


class Part(IndexedModule):
    """A term over one block, with its data as buffers; its stencil and data without a fraction as indices."""

    element_weights: Tensor | None

    def __init__(self, term: ElementTerm) -> None:
        super().__init__(*(index for _, index in term.stencil), *filter(_is_index, term.data))
        self._blocks, self._is_index = len(term.stencil), [_is_index(tensor) for tensor in term.data]
        self.block = term.stencil[0][0]
        self.refresh = term.refresh  # moves with this one where it is a module
        self._bare = replace(term, stencil=(), data=(), element_weights=None, refresh=None)
        self._names = _data_names(term, taken=set(dir(self)) | {"element_weights"})
        for name, tensor in zip([*self._names, "element_weights"], [*term.data, term.element_weights], strict=True):
            if tensor is not None and _is_index(tensor):
                continue
            if isinstance(tensor, nn.Parameter):
                self.register_parameter(name, tensor)
            else:
                self.register_buffer(name, tensor)

    @property
    def data(self) -> list[Tensor]:
        """Data of the term, those that are not refreshed."""
        whole = iter(self.indices[self._blocks :])
        pairs = zip(self._names, self._is_index, strict=True)
        return [next(whole) if is_index else getattr(self, name) for name, is_index in pairs]

    def term(self, weight: float) -> ElementTerm:
        """The term with the present data, and its weight times ``weight``."""
        return replace(
            self._bare,
            stencil=[(self.block, index) for index in self.indices[: self._blocks]],
            data=self.data,
            element_weights=self.element_weights,
            refresh=self.refresh,
            weight=weight * self._bare.weight,
        )

    def evaluate(self, vertices: Tensor) -> tuple[Tensor, Tensor]:
        """Residuals (*batch, n, m) and contributions (*batch, n) at ``vertices`` (*batch, V, d)."""
        batch = vertices.shape[:-2]
        if not batch.numel():  # one state tells the shapes
            values, costs = self.evaluate(vertices.new_zeros(vertices.shape[-2:]))
            return values.expand(*batch, -1, -1), costs.expand(*batch, -1)
        members = vertices.reshape(-1, *vertices.shape[-2:])
        term = replace(self.term(1.0), element_weights=None)
        local = [gather(members, index).flatten(0, 1) for index in self.indices[: self._blocks]]
        data = [tensor.to(vertices.dtype) if tensor.is_floating_point() else tensor for tensor in self._data(members)]
        first = term.values(tuple(argument.detach() for argument in (*local, *data)))
        spared = ~(torch.isfinite(term.missed(first)).all(1) & _are_below(torch.inf, local))
        arguments = (*_generic(spared, local), *(_held(spared, tensor) for tensor in data))
        values = term.values(arguments)
        costs = term.contributions(arguments, values)
        # What overflows, as what is not finite from the start, may not pass for a degenerate element.
        usual = _are_below(torch.finfo(vertices.dtype).max ** 0.25, local)
        price = torch.where(torch.isnan(first).any(1), 0.0, torch.inf).to(costs)
        costs = torch.where(spared, torch.where(usual, price, torch.nan), costs).reshape(*batch, -1)
        instead = torch.where(usual[:, None], first.nan_to_num(0.0, torch.inf, -torch.inf), torch.nan)
        values = torch.where(spared[:, None], instead, values)
        if self.element_weights is not None:
            costs = costs * self.element_weights.to(costs.dtype)
        return values.reshape(*batch, -1, values.shape[-1]), costs

    def _data(self, members: Tensor) -> list[Tensor]:
        """Data (B * n, ...) of the elements of all members (B, V, d)."""
        if self.refresh is not None:
            found = refreshed(self.term(1.0), members)
        else:
            found = [tensor.expand(members.shape[0], *tensor.shape) for tensor in self.data]
        return [tensor.flatten(0, 1) for tensor in found]

    def extra_repr(self) -> str:
        """Name and size of the term."""
        return f"{self._bare.name}: {self.indices[0].shape[0]} elements"


def _is_index(data: Tensor) -> bool:
    """Whether data are numbers without a fraction, or marks."""
    return not (data.is_floating_point() or data.is_complex() or isinstance(data, nn.Parameter))


def _are_below(most: float, local: list[Tensor]) -> Tensor:
    """(n,) bool: elements all of whose coordinates are smaller."""
    return torch.stack([(positions.abs() < most).flatten(1).all(1) for positions in local]).all(0)


def _generic(spared: Tensor, local: list[Tensor]) -> list[Tensor]:
    """Positions (n, k, d) of elements; those ``spared`` (n,) become constant ones at which nothing is degenerate.

    So no NaN arises that a mask would have to hold back, in derivatives of any order.
    """
    places = []
    for number, positions in enumerate(local):
        shape = positions.shape[1:]
        other = torch.arange(shape.numel(), device=positions.device, dtype=positions.dtype).add(number).cos()
        places.append(torch.where(spared[:, None, None], other.view(shape), positions))
    return places


def _held(spared: Tensor, data: Tensor) -> Tensor:
    """Data (n, ...), without derivatives where elements are ``spared`` (n,)."""
    if not data.is_floating_point():
        return data
    return torch.where(spared.view(-1, *[1] * (data.ndim - 1)), data.detach(), data)


def _data_names(term: ElementTerm, taken: set[str]) -> list[str]:
    """What the residual calls the data, or ``data0``, ``data1``, ... where that cannot be told."""
    try:
        parameters = list(inspect.signature(term.residual).parameters.values())[len(term.stencil) :]
    except (TypeError, ValueError):
        parameters = []
    plain = [p.name for p in parameters if p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD)]
    names = plain[: len(term.data)]
    usable = len(names) == len(term.data) and not taken.intersection(names)
    return names if usable else [f"data{number}" for number in range(len(term.data))]
