"""A sheet with a handle in its middle, and a session that follows it."""

from __future__ import annotations

import torch
from helpers import DOUBLE, grid_faces, split_quads
from torch import Tensor

from torchfair import Topology
from torchfair.formfinding import FairRecipe, FairSettings, Session

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


def drag(session: Session[FairRecipe], moves: int = 4, start: float = 0.0) -> list[float]:
    """Lags of the handle behind its target after each move, in mean edges."""
    lags = []
    for number in range(1, moves + 1):
        place = above(session, start + 0.1 * number)
        session.move({MIDDLE: place})
        assert session.step().accepted
        lags.append(float((session.vertices[MIDDLE] - torch.tensor(place)).norm()) / session.recipe.unit.length)
    return lags
