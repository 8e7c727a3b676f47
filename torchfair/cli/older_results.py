"""Results of jobs that are not on the common skeleton yet, as if they were; goes with the last of them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..formfinding import JobResult, Level


def as_job(function: Callable[..., Any]) -> Callable[..., JobResult[Any]]:
    """The function with results of the common kind; those that are, stay as they are."""

    def run(*positional: Any, **named: Any) -> JobResult[Any]:
        result = function(*positional, **named)
        if isinstance(result, JobResult):
            return result
        return JobResult([_with_topology(level) for level in result.levels], result.notes, result.stopped)

    return run


def _with_topology(level: Any) -> Level:
    made = Level(level.vertices, level.principal.topology, level.before, level.after, level.runs, [])
    vars(made).update(principal=level.principal, normals=level.normals)
    return made
