"""The number of faces is about that asked for, or it is said."""

from __future__ import annotations

import math

import pytest
from creased_shapes import box

from torchfair.meshing import principal_quads
from torchfair.meshing.counts import next_spacing
from torchfair.shapes import example_roof


def test_counts_that_grow_with_the_squared_spacing_are_met_at_once() -> None:
    def counted(spacing: float) -> int:
        return round(1e8 / spacing**2)

    for tried in ([2.0], [2.0, 7.0], [2.0, 5.0, 9.0]):
        pairs = [(spacing, counted(spacing)) for spacing in tried]
        assert next_spacing(pairs, counted(4.0)) == pytest.approx(4.0, rel=1e-4)


def test_the_next_spacing_lies_between_those_that_gave_more_and_fewer() -> None:
    tried = [(1.0, 300), (1.4, 180), (1.6, 60)]
    assert 1.0 * math.exp(0.19 * math.log(1.4)) < next_spacing(tried, 299) < next_spacing(tried, 181) < 1.4
    assert 1.4 < next_spacing(tried, 100) < 1.6


@pytest.mark.parametrize("count", [100, 200])
def test_cells_that_the_boundary_clips_count_as_panels(count: int) -> None:
    """The roof, with re-entrant corners, had 163 panels of 200: the spacing beside gives 246."""
    made = principal_quads(*example_roof(), count=count)
    assert abs(made.report["faces"] / count - 1) <= 0.15
    assert not any("instead of" in note for note in made.notes)


def test_a_count_that_is_not_met_is_said() -> None:
    """A box has six sides."""
    made = principal_quads(*box(2), count=2)
    assert made.report["faces"] >= 6
    assert any(f"{made.report['faces']} faces instead of 2" in note for note in made.notes)
