"""Results of runs that were interrupted before their start was judged."""

from __future__ import annotations

import math
from contextlib import suppress

from .evaluate import residual_tables
from .layout import State
from .problem import Problem
from .result import IterationRecord, ProjectionResult, Status, TermResidual
from .stopwatch import Stopwatch

_NOT_EVALUATED = f"{Status.INTERRUPTED.value}; its merit was not evaluated"
_NO_SOLVER = "none"
_LARGE = 300_000  # unknowns


def unbegun(problem: Problem, blocks: State, watch: Stopwatch) -> list[ProjectionResult]:
    """The start, for each member of a batch, or for the one member of a single problem.

    The merit is NaN and the residual tables are empty if evaluating them is interrupted too, and where the problem is
    large; the message says so.
    """
    layout = problem.layout
    tables: list[list[TermResidual]] = [[] for _ in range(layout.members)]
    merits, message = [math.nan] * layout.members, _NOT_EVALUATED
    if not is_large(blocks):
        with suppress(KeyboardInterrupt):
            evaluation = problem.structure.evaluate({name: block.detach().clone() for name, block in blocks.items()})
            tables = residual_tables(problem.structure, problem.terms, evaluation)
            merits, message = evaluation.merits.tolist(), Status.INTERRUPTED.value
    views = {name: block.detach().view(layout.members, -1, block.shape[1]) for name, block in blocks.items()}
    return [
        _result({name: view[member] for name, view in views.items()}, merit, table, message, problem.solver.name, watch)
        for member, (table, merit) in enumerate(zip(tables, merits, strict=True))
    ]


def not_set_up(blocks: State, watch: Stopwatch) -> ProjectionResult:
    """The start of one large problem that was not even compiled; of a solver none is named."""
    return _result(blocks, math.nan, [], _NOT_EVALUATED, _NO_SOLVER, watch)


def is_large(blocks: State) -> bool:
    """Whether compiling a problem, or evaluating it, takes seconds in which whoever pressed Ctrl-C waits."""
    return sum(block.numel() for block in blocks.values()) >= _LARGE


def _result(
    blocks: State, merit: float, table: list[TermResidual], message: str, solver: str, watch: Stopwatch
) -> ProjectionResult:
    record = IterationRecord(0, merit, math.nan, math.nan, 0.0, math.nan, True, 0, watch.elapsed)
    return ProjectionResult(
        blocks={name: block.detach().clone() for name, block in blocks.items()},
        status=Status.INTERRUPTED,
        message=message,
        residuals=table,
        initial_residuals=table,
        history=[record],
        solver=solver,
        timings={"total": watch.elapsed},
    )
