"""What jobs say on the console."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any

from torchfair.cli.summary import measures_table, missed_lines, note_lines, work_lines
from torchfair.formfinding import Promise

BEFORE = {
    "smallest_angle_degrees": 30.0,
    "normal_variation": 8.0,
    "total_absolute_curvature": 5.0,
    "largest_planarity": 0.0,
    "largest_handle_distance": 0.0,
    "sigma_of_noise": 0.25,
    "mean_edge_length": 1.0,
    "flipped_faces": 0,
}
AFTER = BEFORE | {"normal_variation": 6.0, "largest_handle_distance": 0.5, "energy_over_curvature": math.nan}


def test_measures_are_lines_in_the_order_of_interest_with_changes_in_percent() -> None:
    lines = measures_table(BEFORE, AFTER)
    assert lines[0].split() == ["before", "after"]
    assert [line.split("  ")[0] for line in lines[1:]] == [
        "E",
        "C (normal cycle, E is never below)",
        "smallest angle, degrees",
        "faces flipped",
        "largest distance of a handle from its target",
        "sigma of noise",  # a measure that no table knows
    ]
    assert lines[1].split() == ["E", "8", "6", "-25.0", "%"]
    assert len({len(line.removesuffix("  -25.0 %").removesuffix("  +0.0 %")) for line in lines}) == 1
    assert lines[4].split()[-2:] == ["0", "0"]


def test_what_is_no_number_is_a_dash() -> None:
    assert measures_table({"area": 0.0, "x": math.nan}, {"area": 2.0, "x": 1.0})[1:] == [
        "area           0           2",
        "x              -           1",
    ]


def job(*promises: Promise, levels: int = 1) -> Any:
    level = SimpleNamespace(topology=SimpleNamespace(num_vertices=9), steps=4, seconds=1.5, runs=[0, 0])
    return SimpleNamespace(
        promises=promises,
        levels=[level] * levels,
        runs=[0, 0] * levels,
        steps=4 * levels,
        seconds=1.5 * levels,
        message="done",
    )


def test_work_is_that_of_all_levels_together() -> None:
    assert work_lines(job()) == ["4 steps in 2 runs, 1.50 s: done"]
    assert work_lines(job(levels=2)) == [
        "level 0: 9 vertices, 4 steps in 2 runs, 1.50 s",
        "level 1: 9 vertices, 4 steps in 2 runs, 1.50 s",
        "8 steps in 4 runs, 3.00 s: done",
    ]


def test_what_is_missed_is_said_once_at_the_end() -> None:
    missed, kept = Promise("x", 1.0, 2.0, remedy="pull less"), Promise("y", 1.0, 0.5)
    lines = missed_lines(job(missed, kept), 0)
    assert lines == ["x 2, at most 1 asked for: NOT REACHED; pull less"]
    assert note_lines(["c"], ["a", f"level 1: {missed}", "b"], lines) == ["repaired: c", "note: a", "note: b"]
    assert missed_lines(job(kept, levels=2), 1) == []
    assert missed_lines(job(kept, levels=2), 2) == ["1 of 2 refinements: NOT REACHED; done"]
