"""Handles and held vertices as data: any vertex can be pulled, held or let go without a new problem."""

from __future__ import annotations

import copy
from dataclasses import replace

import torch
from torch import Tensor

from ...constraints.handles import handle_terms
from ...projection import ElementTerm
from ...projection.layout import State


class Pulls:
    """Which vertices are pulled where, and which keep their places; all in the unit of the problem.

    Args:
        start: (V, 3) vertices.

    Attributes:
        targets: (V, 3) where vertices are pulled; where they start, if they are not pulled.
        aims: (V, 3) where they are pulled for now, on the way to their targets.
        pulled: (V,) bool.
        held: (V,) bool, vertices that keep their places.
        strength: Factor of the weight of handles; below 1 they yield.
        everywhere: Whether terms cover all vertices, so that others can be pulled without new index maps.
        version: Another number whenever terms have changed, which with ``everywhere`` see other targets, aims and
            strengths by themselves.
    """

    def __init__(self, start: Tensor) -> None:
        self.targets, self.aims = start.clone(), start.clone()
        self.pulled = torch.zeros(start.shape[0], dtype=torch.bool, device=start.device)
        self.held = self.pulled.clone()
        self.strength, self.everywhere, self.version = 1.0, False, 0

    @property
    def vertices(self) -> Tensor:
        """(n,) vertices that are pulled."""
        return torch.nonzero(self.pulled).squeeze(1)

    def pull(self, vertices: Tensor, places: Tensor) -> None:
        """Pulls ``vertices`` (n,) to ``places`` (n, 3), also those that were held."""
        self.targets[vertices] = places
        self.aims[vertices] = places
        changes = not bool(self.pulled[vertices].all()) or bool(self.held[vertices].any())
        self.version += changes or not self.everywhere
        self.pulled[vertices], self.held[vertices] = True, False

    def trace(self, places: Tensor) -> None:
        """Pulls the vertices that are pulled to ``places`` (n, 3), of which terms are differentiable functions."""
        self.targets = self.targets.index_put((self.vertices,), places)
        self.aims = self.targets

    def hold(self, vertices: Tensor) -> None:
        """Keeps ``vertices`` (n,) where they are, also those that were pulled."""
        self.version += 1
        self.held[vertices], self.pulled[vertices] = True, False

    def free(self, vertices: Tensor) -> None:
        """Lets ``vertices`` (n,) go that were pulled or held."""
        self.version += 1
        self.held[vertices], self.pulled[vertices] = False, False

    def aim(self, share: float, start: Tensor) -> None:
        """Pulls only a part of the way from ``start`` (V, 3) on."""
        self.version += not self.everywhere
        self.aims = torch.where(self.pulled[:, None], start.lerp(self.targets, min(share, 1.0)), self.targets)

    def aim_near(self, vertices: Tensor, reach: float) -> None:
        """Pulls by no more than ``reach`` from where the ``vertices`` (V, 3) are."""
        way = self.targets - vertices
        length = torch.linalg.vector_norm(way, dim=1, keepdim=True)
        self.version += not self.everywhere
        near = vertices + way * (reach / length.clamp_min(reach))
        self.aims = torch.where(length > reach, near, self.targets)

    def away(self, vertices: Tensor) -> Tensor:
        """(n,) distances of pulled vertices from their targets, for ``vertices`` (V, 3)."""
        chosen = self.vertices
        distances: Tensor = torch.linalg.vector_norm(vertices[chosen] - self.targets[chosen], dim=1)
        return distances

    def farthest(self, vertices: Tensor) -> float:
        """Largest distance of pulled ``vertices`` (V, 3) from their targets; 0 if none is pulled."""
        away = self.away(vertices)
        return float(away.max()) if away.numel() else 0.0

    def lag(self, vertices: Tensor) -> float:
        """Largest distance of pulled ``vertices`` (V, 3) from their aims."""
        lags = torch.linalg.vector_norm(vertices - self.aims, dim=1)
        return float(torch.where(self.pulled, lags, 0.0).max())

    def terms(self, *, weight: float, as_data: bool = False) -> list[ElementTerm]:
        """Squared distances from the aims; if they cover all vertices, refreshed, unless asked for as data."""
        if not self.everywhere:
            chosen = self.vertices
            return handle_terms(chosen, self.aims[chosen], weight=weight * self.strength)
        if not as_data:
            return self.refreshed_terms(weight=weight)
        (term,) = self.refreshed_terms(weight=weight)
        return [replace(term, data=self._aims_and_roots({"vertices": self.aims}), refresh=None)]

    def refreshed_terms(self, *, weight: float) -> list[ElementTerm]:
        """Those of all vertices, which see other handles, aims and strengths by themselves."""
        every = torch.arange(self.pulled.shape[0], device=self.pulled.device)[:, None]
        return [
            ElementTerm(
                "handles",
                pulled_offsets,
                [("vertices", every)],
                weight=weight,
                refresh=self._aims_and_roots,
                jacobian=pulled_derivatives,
                batched=True,
            )
        ]

    def _aims_and_roots(self, state: State) -> tuple[Tensor, Tensor]:
        like = state["vertices"]
        return self.aims.to(like), self.pulled.to(like) * self.strength**0.5

    def copy(self) -> Pulls:
        """The same; what is done to one does not change the other."""
        result = copy.copy(self)
        for name, value in vars(self).items():
            if isinstance(value, Tensor):
                setattr(result, name, value.clone())
        return result

    def restore(self, other: Pulls) -> None:
        """Becomes equal to ``other``, which shares nothing with it."""
        vars(self).update(vars(other.copy()))


def pulled_offsets(x: Tensor, aim: Tensor, root: Tensor) -> Tensor:
    """(n, 3) from the aims to the vertices ``x`` (n, 1, 3), times the roots (n,) of their pulls."""
    return (x[:, 0] - aim) * root[:, None]


def pulled_derivatives(x: Tensor, aim: Tensor, root: Tensor) -> Tensor:
    """(n, 3, 3) derivatives of :func:`pulled_offsets`."""
    return root[:, None, None] * torch.eye(3, dtype=x.dtype, device=x.device)
