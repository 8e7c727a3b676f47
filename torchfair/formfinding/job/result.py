"""What every job returns."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, TypeVar

from torch import Tensor

from ..._short_repr import short_repr
from ...projection import ProjectionResult
from ...topology import Topology
from .notebook import result_html
from .promises import Promise


@dataclass(frozen=True)
class Level:
    """The mesh of one level of refinement.

    Attributes:
        vertices: (V, 3) in the unit and dtype of the input.
        topology: Its connectivity.
        before, after: Energies and what is promised, at the start of the level and at its end.
        runs: Runs of guided projection in order, in normalised units (quantities of their histories are in the unit of
            the input). The merit falls within each run.
        promises: What was asked for, and whether it was reached.
    """

    vertices: Tensor
    topology: Topology
    before: dict[str, float]
    after: dict[str, float]
    runs: list[ProjectionResult]
    promises: list[Promise]

    __repr__ = short_repr

    @property
    def steps(self) -> int:
        """Damped steps that were tried."""
        return sum(run.iterations for run in self.runs)

    @property
    def seconds(self) -> float:
        """Time of all runs."""
        return sum(run.timings["total"] for run in self.runs)


L = TypeVar("L", bound=Level)


@dataclass(frozen=True)
class JobResult(Generic[L]):
    """A mesh, how it was found, and whether it is what was asked for.

    Attributes:
        levels: From coarse to fine; one without refinement. The first has the vertices of the input, unless a
            job was allowed to replace faces.
        notes: Decisions taken and what was missed, in words.
        stopped: Whether Ctrl-C, the callback or the time limit ended it early; the last level is the best state found,
            or was finished before.
    """

    levels: list[L]
    notes: list[str]
    stopped: bool

    def __repr__(self) -> str:
        kept, all_of_them = sum(promise.holds for promise in self.promises), len(self.promises)
        before, after = self.before.get("normal_variation"), self.after.get("normal_variation")
        energy = "" if before is None or after is None else f"E {before:.5g} -> {after:.5g}, "
        return (
            f"{type(self).__name__}({self.topology.num_vertices} vertices, {self.topology.num_faces} faces, {energy}"
            f"{kept} of {all_of_them} promises kept, {self.steps} steps, {self.seconds:.3g} s"
            f"{', stopped' * self.stopped})"
        )

    def _repr_html_(self) -> str:
        """Figures and a picture, for notebooks."""
        return result_html(self)

    @property
    def vertices(self) -> Tensor:
        """(V', 3) of the finest level, in the unit and dtype of the input."""
        return self.levels[-1].vertices

    @property
    def topology(self) -> Topology:
        """Of the finest level."""
        return self.levels[-1].topology

    @property
    def before(self) -> dict[str, float]:
        """Measures of the input."""
        return self.levels[0].before

    @property
    def after(self) -> dict[str, float]:
        """Measures of the result."""
        return self.levels[-1].after

    @property
    def promises(self) -> list[Promise]:
        """Of the result."""
        return self.levels[-1].promises

    @property
    def holds(self) -> bool:
        """Whether all promises hold."""
        return all(promise.holds for promise in self.promises)

    @property
    def runs(self) -> list[ProjectionResult]:
        """All runs of all levels, in order."""
        return [run for level in self.levels for run in level.runs]

    @property
    def projection(self) -> ProjectionResult:
        """The last run."""
        return self.levels[-1].runs[-1]

    @property
    def preparation(self) -> list[ProjectionResult]:
        """All runs but the last."""
        return self.runs[:-1]

    @property
    def message(self) -> str:
        """Why the last run ended."""
        return self.projection.message

    @property
    def steps(self) -> int:
        """Damped steps that were tried, over all levels."""
        return sum(level.steps for level in self.levels)

    @property
    def seconds(self) -> float:
        """Time of all runs, over all levels."""
        return sum(level.seconds for level in self.levels)
