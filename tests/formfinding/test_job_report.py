"""The report of a job: every level with all its runs, and sums over them."""

from __future__ import annotations

import pytest
from helpers import wavy_grid

from torchfair.formfinding import FairSettings, JobResult, job_report, minimise_normal_variation
from torchfair.settings import settings_from


def test_report_counts_all_runs_of_all_levels() -> None:
    vertices, topology = wavy_grid(6, 5, triangles=True)
    settings = FairSettings(boundary="fixed")
    once = minimise_normal_variation(vertices, topology, settings=settings)
    result = JobResult([once.levels[0], once.levels[0]], ["a note"], False)
    report = job_report(result, settings)
    runs = once.runs
    assert len(runs) > 1
    assert [len(level["runs"]) for level in report["levels"]] == [len(runs)] * 2
    assert report["steps"] == 2 * sum(run.iterations for run in runs)
    assert report["seconds"] == pytest.approx(2 * sum(run.timings["total"] for run in runs))
    for phase in runs[0].timings:
        assert report["timings"][phase] == pytest.approx(2 * sum(run.timings[phase] for run in runs))
    for level in report["levels"]:
        assert (level["vertices"], level["faces"]) == (topology.num_vertices, topology.num_faces)
        for entry, run in zip(level["runs"], runs, strict=True):
            assert (entry["status"], entry["message"]) == (run.status, run.message)
            assert (entry["scaled_gradient"], entry["recent_fall"]) == (run.gradient, run.recent_fall)
            assert [record["merit"] for record in entry["history"]] == [record.merit for record in run.history]
            assert (entry["initial_residuals"], entry["residuals"]) == (run.initial_residuals, run.residuals)
    assert report["holds"] is all(promise["holds"] for promise in report["promises"])
    assert {promise["name"] for promise in report["promises"]} == {promise.name for promise in once.promises}
    assert report["notes"] == ["a note"]
    assert (report["status"], report["converged"]) == (runs[-1].status, runs[-1].status.converged)
    assert settings_from(report["settings"], FairSettings) == settings
