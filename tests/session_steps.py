"""A sheet with a handle in its middle, and a session that follows it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import torch
from helpers import DOUBLE, grid_faces, split_quads
from torch import Tensor

from torchfair import Topology
from torchfair.formfinding import FairRecipe, FairSettings, Session
from torchfair.formfinding.job import Recipe

R = TypeVar("R", bound=Recipe[Any])

MIDDLE = 24  # of the sheet


def sheet(n: int = 7) -> tuple[Tensor, Topology]:
    """A saddle over a bent grid with edges of about one; no symmetry, or rounding chooses among mirrored minima."""
    x, y = torch.meshgrid(*(torch.arange(n, dtype=DOUBLE) - n // 2,) * 2, indexing="ij")
    x, y = x + 0.1 * torch.sin(2.0 * y), y + 0.1 * torch.sin(3.0 * x)
    vertices = torch.stack([x, y, 0.08 * (x**2 - y**2) + 0.003 * (x**3 + x * y)], dim=-1).reshape(-1, 3)
    return vertices, Topology.from_faces(split_quads(grid_faces(n, n)))


def opened(**settings: object) -> Session[FairRecipe]:
    return Session(FairRecipe(*sheet(), settings=FairSettings(**settings)))  # type: ignore[arg-type]


def above(session: Session[FairRecipe], height: float, vertex: int = MIDDLE) -> list[float]:
    """A place over where a vertex started, in mean edge lengths."""
    up = torch.tensor([0.0, 0.0, height * session.recipe.unit.length], dtype=DOUBLE)
    place: list[float] = (session.recipe.given[vertex] + up).tolist()
    return place


def dragged(
    session: Session[R], handle: int, place: Callable[[float], list[float]], moves: int, start: float
) -> list[float]:
    """Lags of a handle behind its target after each move by a tenth of a mean edge, in mean edges.

    Args:
        session: Of any job.
        handle: The vertex.
        place: Where it is to be, by the height above where it started in mean edges.
        moves: How many.
        start: Height before the first.
    """
    lags = []
    for number in range(1, moves + 1):
        target = place(start + 0.1 * number)
        session.move({handle: target})
        assert session.step().accepted
        lags.append(float((session.vertices[handle] - torch.tensor(target)).norm()) / session.recipe.unit.length)
    return lags


def drag(session: Session[FairRecipe], moves: int = 4, start: float = 0.0) -> list[float]:
    """Lags of the handle behind its target after each move, in mean edges."""
    return dragged(session, MIDDLE, lambda height: above(session, height), moves, start)
