"""What it means that someone stopped a job."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..projection import ProjectionResult, Status


def stopped(run: ProjectionResult) -> bool:
    """Whether someone stopped the run."""
    return run.status in (Status.INTERRUPTED, Status.CALLBACK)


def interrupted(run: ProjectionResult) -> ProjectionResult:
    """The last run of a job that was interrupted after it: nothing better was found."""
    return replace(run, status=Status.INTERRUPTED, message=Status.INTERRUPTED.value)


def interrupted_at_the_start(runs: Sequence[ProjectionResult]) -> bool:
    """Whether runs were interrupted before any step was taken: what they started from is all that there is."""
    taken = any(record.accepted for run in runs for record in run.history[1:])
    return runs[-1].status is Status.INTERRUPTED and not taken
