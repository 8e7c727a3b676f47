"""A job as a report: what was asked for, what came of it, and how."""

from __future__ import annotations

from collections import Counter
from typing import Any

from ...projection import ProjectionResult
from ...settings import plain_settings
from .result import JobResult, Level


def job_report(result: JobResult[Any], settings: Any) -> dict[str, Any]:
    """Everything that a job did, as mappings, lists, dataclasses, words and numbers.

    Args:
        result: Of the job.
        settings: With which it was done.

    Returns:
        ``energies``: the measures ``before`` and ``after``; ``promises`` of the result and whether all of them hold
        (``holds``); ``notes``; ``stopped``; ``status``, ``message`` and ``converged`` of the last run; ``steps``,
        ``seconds`` and ``timings`` of all runs together; ``levels``, each with its measures, promises and ``runs``;
        ``settings``, as :func:`~torchfair.settings.read_settings` reads them.
    """
    timings: Counter[str] = Counter()
    for run in result.runs:
        timings.update(run.timings)
    last = result.projection
    return {
        "energies": {"before": result.before, "after": result.after},
        "promises": [promise.as_dict() for promise in result.promises],
        "holds": result.holds,
        "notes": result.notes,
        "stopped": result.stopped,
        "status": last.status,
        "message": last.message,
        "converged": last.status.converged,
        "steps": result.steps,
        "seconds": result.seconds,
        "timings": dict(timings),
        "levels": [_level(level) for level in result.levels],
        "settings": plain_settings(settings),
    }


def _level(level: Level) -> dict[str, Any]:
    return {
        "vertices": level.topology.num_vertices,
        "faces": level.topology.num_faces,
        "before": level.before,
        "after": level.after,
        "promises": [promise.as_dict() for promise in level.promises],
        "steps": level.steps,
        "seconds": level.seconds,
        "runs": [_run(run) for run in level.runs],
    }


def _run(run: ProjectionResult) -> dict[str, Any]:
    return {
        "status": run.status,
        "message": run.message,
        "converged": run.status.converged,
        "solver": run.solver,
        "steps": run.iterations,
        "scaled_gradient": run.gradient,
        "recent_fall": run.recent_fall,
        "timings": run.timings,
        "initial_residuals": run.initial_residuals,
        "residuals": run.residuals,
        "history": [record.as_dict() for record in run.history],
    }
