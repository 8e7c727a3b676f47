"""The number of faces is about that asked for, or it is said."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import pytest
import torch
from creased_shapes import box

from torchfair import Topology
from torchfair.fields import Directions
from torchfair.meshing import MeshingSettings, counts, principal_quads
from torchfair.meshing.counts import mesh_to_count, next_spacing
from torchfair.meshing.ladder import Again
from torchfair.meshing.no_mesh import NoMeshError
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


def corrected(monkeypatch: pytest.MonkeyPatch, count: int, faces: Any) -> tuple[int, list[tuple[float, list[Again]]]]:
    """Faces in the end, and what was asked for to come to a count, where a spacing gives ``faces(spacing)``."""
    asked: list[tuple[float, list[Again]]] = []

    def made(_surface: Any, _lattices: Any, spacing: float, _settings: Any, again: list[Again] | None = None) -> Any:
        if again is not None:
            asked.append((spacing, again))
        if faces(spacing) is None:
            raise NoMeshError("none")
        return SimpleNamespace(faces=faces(spacing), notes=[], plans=[3], creases=SimpleNamespace(length=0.0))

    monkeypatch.setattr(counts, "mesh_components", made)
    monkeypatch.setattr(counts, "_told", lambda pieces, *_: pieces)
    surface = cast(Any, SimpleNamespace(parts=[]))
    found, _ = mesh_to_count(surface, [], 1.0, MeshingSettings(), count, lambda pieces: cast(Any, pieces).faces)
    return cast(Any, found).faces, asked


@pytest.mark.parametrize(("first", "others"), [(76, False), (74, True), (124, False), (126, True)])
def test_other_plans_are_taken_only_where_the_count_is_far_off(
    monkeypatch: pytest.MonkeyPatch, first: int, others: bool
) -> None:
    found, asked = corrected(monkeypatch, 100, lambda spacing: first if spacing == 1 else 100)
    assert found == 100
    assert [again for _, (again,) in asked] == [Again(3, 1.0, others)]


def test_triangles_are_cut_finer_for_spacings_that_are_much_smaller(monkeypatch: pytest.MonkeyPatch) -> None:
    for first, finer in ((50, False), (48, True)):
        _, asked = corrected(monkeypatch, 100, lambda spacing, first=first: first if spacing == 1 else 100)
        (spacing, (again,)) = asked[0]
        assert spacing == pytest.approx(math.sqrt(first / 100))
        assert again.resolution == (spacing if finer else 1.0)


def test_spacings_that_failed_are_not_tried_again(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a mesh the next spacing is half as far; with that the search came back to the one before."""
    found, asked = corrected(monkeypatch, 100, lambda at: 85 if at > 0.99 else (86 if at > 0.93 else None))
    assert found == 86
    assert [spacing for spacing, _ in asked] == pytest.approx([0.85**0.5, 0.85**0.25])


@pytest.mark.parametrize(("fine", "found", "cuts"), [(110, 110, True), (130, 60, True), (110, 60, False)])
def test_where_no_spacing_comes_near_the_count_finer_triangles_are_tried(
    monkeypatch: pytest.MonkeyPatch, fine: int, found: int, cuts: bool
) -> None:
    """Turned boxes had 60 of 100 triangles with all spacings on the same triangles; finer ones count if they help.

    Where triangles are not cut for half of the spacing, all would be done once more for the same meshes.
    """
    resolutions: list[float] = []
    parts = [SimpleNamespace(is_cut_for=lambda _: False), SimpleNamespace(is_cut_for=lambda at: cuts and at == 0.5)]
    surface = cast(Any, SimpleNamespace(parts=parts))

    def made(_surface: Any, _lattices: Any, _spacing: float, _settings: Any, again: list[Again] | None = None) -> Any:
        resolutions.extend([] if again is None else [again[0].resolution])
        is_fine = again is not None and again[0].resolution == 0.5
        return SimpleNamespace(faces=fine if is_fine else 60, notes=[], plans=[0], creases=SimpleNamespace(length=0.0))

    monkeypatch.setattr(counts, "mesh_components", made)
    monkeypatch.setattr(counts, "_told", lambda pieces, *_: pieces)
    pieces, _ = mesh_to_count(surface, [], 1.0, MeshingSettings(), 100, lambda of: cast(Any, of).faces)
    assert cast(Any, pieces).faces == found
    assert (0.5 in resolutions) == cuts
