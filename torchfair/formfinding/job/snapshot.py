"""Where a session stood, to be put back bit for bit."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ...projection import ProjectionResult
from ...projection.layout import State
from .live import Following


@dataclass(frozen=True)
class Snapshot:
    """What steering and solving may change.

    Attributes:
        state: The blocks.
        pulls: Handles and held vertices.
        settings: Of the job.
        of_recipe: Puts back what the recipe has decided.
        runs: So far.
        of_problems: Puts back what is compiled.
        following: Where live steps stand.
        moved: Whether something was steered since.
    """

    state: State
    pulls: Any
    settings: Any
    of_recipe: Callable[[], None]
    runs: list[ProjectionResult]
    of_problems: Callable[[], None]
    following: Following | None
    moved: bool
