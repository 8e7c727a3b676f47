"""What it means that someone stopped a job."""

from __future__ import annotations

from dataclasses import replace

from ..projection import ProjectionResult, Status


def stopped(run: ProjectionResult) -> bool:
    """Whether someone stopped the run."""
    return run.status in (Status.INTERRUPTED, Status.CALLBACK)


def interrupted(run: ProjectionResult) -> ProjectionResult:
    """The last run of a job that was interrupted after it: nothing better was found."""
    return replace(run, status=Status.INTERRUPTED, message=Status.INTERRUPTED.value)
