"""Results of runs that were interrupted before their start was judged."""

from __future__ import annotations

import math
from contextlib import suppress

from .evaluate import residual_tables
from .layout import State
from .problem import Problem
from .result import IterationRecord, ProjectionResult, Status, TermResidual
from .stopwatch import Stopwatch

_NOT_EVALUATED = "its merit was not evaluated"
_LARGE = 300_000  # unknowns: evaluating them takes seconds, in which whoever pressed Ctrl-C waits


def unbegun(problem: Problem, blocks: State, watch: Stopwatch) -> list[ProjectionResult]:
    """The start, for each member of a batch, or for the one member of a single problem.

    The merit is NaN and the residual tables are empty if evaluating them is interrupted too, and where the problem is
    large; the message says so.
    """
    layout = problem.layout
    start = {name: block.detach().clone() for name, block in blocks.items()}
    tables: list[list[TermResidual]] = [[] for _ in range(layout.members)]
    merits, message = [math.nan] * layout.members, f"{Status.INTERRUPTED.value}; {_NOT_EVALUATED}"
    if sum(block.numel() for block in start.values()) < _LARGE:
        with suppress(KeyboardInterrupt):
            evaluation = problem.structure.evaluate(start)
            tables = residual_tables(problem.structure, problem.terms, evaluation)
            merits, message = evaluation.merits.tolist(), Status.INTERRUPTED.value
    views = {name: block.view(layout.members, -1, block.shape[1]) for name, block in start.items()}
    return [
        ProjectionResult(
            blocks={name: view[member].clone() for name, view in views.items()},
            status=Status.INTERRUPTED,
            message=message,
            residuals=table,
            initial_residuals=table,
            history=[_record(merit, watch.elapsed)],
            solver=problem.solver.name,
            timings={"total": watch.elapsed},
        )
        for member, (table, merit) in enumerate(zip(tables, merits, strict=True))
    ]


def _record(merit: float, elapsed: float) -> IterationRecord:
    return IterationRecord(0, merit, math.nan, math.nan, 0.0, math.nan, True, 0, elapsed)
