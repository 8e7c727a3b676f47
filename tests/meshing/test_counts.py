"""The number of faces is about that asked for, or it is said."""

from __future__ import annotations

import math

import pytest
import torch
from creased_shapes import box

from torchfair import Topology
from torchfair.fields import Directions
from torchfair.meshing import principal_quads
from torchfair.meshing.counts import next_spacing
from torchfair.meshing.surface import DesignSurface
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


def test_counts_that_do_not_change_lead_on() -> None:
    """A sphere has 236 quads at two spacings: the third is not the second again."""
    assert next_spacing([(0.2, 236), (0.18, 236)], 300) == pytest.approx(0.18 * math.sqrt(236 / 300))
    assert next_spacing([(0.2, 350), (0.25, 360)], 300) == pytest.approx(0.25 * math.sqrt(360 / 300))


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


@pytest.mark.slow
def test_the_count_does_not_depend_on_numbering() -> None:
    """Of 400 panels the roof had 486, or 370, as it was numbered: too few whole vectors were looked at."""
    vertices, topology = example_roof()
    found = principal_quads(vertices, topology, count=400)
    order = torch.randperm(len(vertices), generator=torch.Generator().manual_seed(1))
    faces = order.argsort()[topology.triangles].roll(1, 1).flip(0)
    again = principal_quads(vertices[order], Topology.from_faces(faces), count=400)
    assert again.report["faces"] == found.report["faces"]
    assert again.report["spacing"] == pytest.approx(found.report["spacing"])
    assert abs(found.report["faces"] / 400 - 1) < 0.15
    assert torch.cdist(found.singular_points, again.singular_points).amin(1).max() < 0.1 * found.report["spacing"]


def test_spacings_near_the_first_are_laid_on_the_same_triangles(monkeypatch: pytest.MonkeyPatch) -> None:
    """Counts jumped by two thirds where the next spacing was laid on triangles that were cut once more."""
    asked: list[float] = []
    cut_finer = DesignSurface.cut_finer

    def recorded(surface: DesignSurface, directions: Directions, length: float) -> tuple[DesignSurface, Directions]:
        asked.append(length)
        return cut_finer(surface, directions, length)

    monkeypatch.setattr(DesignSurface, "cut_finer", recorded)
    principal_quads(*example_roof(), count=200)
    assert len(asked) > 1
    assert all(length == asked[0] or length < 0.8 * asked[0] for length in asked)
