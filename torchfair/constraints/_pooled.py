"""Polygons of few corners as elements of one term, whatever their sizes: each term takes time, however few it has."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import torch
from torch import Tensor

from ..topology import Topology

_FEW = 256  # elements: from there on it takes longer to evaluate corners twice than a term by itself
_MOST_CORNERS = 16


class Group(NamedTuple):
    """Elements of one term.

    Attributes:
        numbers: (n,) of the elements.
        stencil: (n, k) their corners, run after run.
        sources: (n, k) the corner of each element that counts in a place, where elements differ in size: there the last
            corner of a run fills its other places. None where all corners count.
        runs: Places of each run; they add to k.
    """

    numbers: Tensor
    stencil: Tensor
    sources: Tensor | None
    runs: list[int]

    @property
    def data(self) -> tuple[Tensor, ...]:
        """Of a term, the last of them: what :class:`Pooled` functions ask for."""
        return () if self.sources is None else (self.sources,)

    def function(self, function: Callable[..., Tensor]) -> Callable[..., Tensor]:
        """A function of corners and data, for this group."""
        return function if self.sources is None else Pooled(function)

    def jacobian(self, jacobian: Callable[..., Tensor]) -> Callable[..., Tensor]:
        """Its Jacobian, for this group."""
        return jacobian if self.sources is None else PooledJacobian(jacobian)


def pooled(groups: Iterable[tuple[Tensor, Sequence[Tensor]]]) -> list[Group]:
    """Groups of elements with equal sizes; small ones become a single group.

    Args:
        groups: Numbers (n,) and corners, runs of ``(n, k_1), (n, k_2), ...``; each run has at least one.
    """
    alone: list[tuple[Tensor, Sequence[Tensor]]] = []
    few: list[tuple[Tensor, Sequence[Tensor]]] = []
    for numbers, runs in groups:
        is_small = len(numbers) < _FEW and sum(run.shape[1] for run in runs) <= _MOST_CORNERS
        (few if is_small else alone).append((numbers, runs))
    if len(few) == 1:
        alone, few = [*alone, *few], []
    made = [Group(numbers, torch.cat(list(runs), 1), None, [run.shape[1] for run in runs]) for numbers, runs in alone]
    return [*made, _filled(few)] if few else made


def pooled_faces(topology: Topology) -> list[Group]:
    """The faces of a mesh, as one run of corners."""
    return pooled((numbers, [corners]) for numbers, corners in topology.faces_by_size.values())


def _filled(groups: list[tuple[Tensor, Sequence[Tensor]]]) -> Group:
    """One group of all."""
    most = [max(run.shape[1] for run in runs) for runs in zip(*(runs for _, runs in groups), strict=True)]
    stencils, sources = [], []
    for numbers, runs in groups:
        places = [torch.arange(width, device=numbers.device) for width in most]
        own = [place.clamp_max(run.shape[1] - 1) for place, run in zip(places, runs, strict=True)]
        stencils.append(torch.cat([run[:, chosen] for run, chosen in zip(runs, own, strict=True)], 1))
        starts = [sum(most[:number]) for number in range(len(most))]
        source = torch.cat([place + start for place, start in zip(own, starts, strict=True)])
        sources.append(source.expand(len(numbers), -1))
    return Group(torch.cat([numbers for numbers, _ in groups]), torch.cat(stencils), torch.cat(sources), most)


@dataclass(frozen=True)
class Pooled:
    """A function of elements of any size for those of a pool: ``(x, *data, sources)`` with corners x (n, k, 3).

    Attributes:
        plain: ``(x, *data)``, whatever the size, for which a corner that is there twice side by side counts once.
    """

    plain: Callable[..., Tensor]

    def __call__(self, x: Tensor, *data: Tensor) -> Tensor:
        """What the plain one gives, with no derivative by places that do not count."""
        *others, sources = data
        return self.plain(x.gather(1, sources[..., None].expand_as(x)), *others)

    @property
    def __signature__(self) -> inspect.Signature:
        """So that modules find what data are called."""
        plain = inspect.signature(self.plain)
        named = [of for of in plain.parameters.values() if of.kind is of.POSITIONAL_OR_KEYWORD]
        return plain.replace(parameters=[*named, inspect.Parameter("sources", inspect.Parameter.POSITIONAL_OR_KEYWORD)])


@dataclass(frozen=True)
class PooledJacobian:
    """Its Jacobian ``(n, 3k)`` or ``(n, m, 3k)``: what the places of one corner have is added where it counts.

    Attributes:
        plain: Of the plain function.
    """

    plain: Callable[..., Tensor]

    def __call__(self, x: Tensor, *data: Tensor) -> Tensor:
        """As the automatic derivative of the pooled function."""
        *others, sources = data
        found = self.plain(x, *others)
        by_corner: Any = found.reshape(len(x), -1, *x.shape[1:])
        index = sources[:, None, :, None].expand_as(by_corner)
        return torch.zeros_like(by_corner).scatter_add(2, index, by_corner).view(found.shape)
