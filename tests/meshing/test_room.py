"""Singular points and corners of creases that find no room in a mesh, and many whole numbers, end soon."""

from __future__ import annotations

import numpy as np
import pytest
from meshing_tools import ellipsoid, irregular

from torchfair.meshing import MeshingSettings, NoMeshError, principal_quads, sound_map
from torchfair.meshing.relaxation import stretched
from torchfair.meshing.seamless_map import MapProblem
from torchfair.shapes import Torus


def test_a_map_is_not_begun_where_nodes_find_no_room(monkeypatch: pytest.MonkeyPatch) -> None:
    """Singular points of an ellipsoid in a mesh that is said to have room for none."""
    begun = list[MapProblem]()

    def noted(problem: MapProblem) -> MapProblem:
        begun.append(problem)
        return stretched(problem)

    monkeypatch.setattr(sound_map, "stretched", noted)
    settings = MeshingSettings(fallback=False)
    assert principal_quads(*ellipsoid(3), count=150, settings=settings).report["singular"] == {"0.25": 8}
    assert begun
    begun.clear()
    for room, few, whole, words in ((0.0, 0, 1000, r"8 singular .* for 150 cells"), (2.0, 50, 3, r"more than 3 ")):
        monkeypatch.setattr(sound_map, "_ROOM", room)
        monkeypatch.setattr(sound_map, "_FEW", few)
        monkeypatch.setattr(sound_map, "_MOST_WHOLE", whole)
        with pytest.raises(NoMeshError, match=words) as caught:
            principal_quads(*ellipsoid(3), count=150, settings=settings)
        assert caught.value.vertex >= 0
    assert not begun


def test_where_nodes_find_no_room_spacings_a_little_different_are_not_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    """Four lengths of smoothing are, with one spacing each, of twenty plans."""
    monkeypatch.setattr(sound_map, "_ROOM", 0.0)
    monkeypatch.setattr(sound_map, "_FEW", 0)
    with pytest.raises(NoMeshError, match=r"too many for 150 cells \(4 setting\(s\) tried\)"):
        principal_quads(*ellipsoid(3), count=150)


def test_room_ends_where_nodes_are_too_many_and_whole_numbers_where_a_search_would_not_end() -> None:
    assert not sound_map._too_many(sound_map._FEW, 0.0, 100)
    assert not sound_map._too_many(850, 400.0, sound_map._MOST_WHOLE)
    assert "851 singular points and corners of creases, too many for 400 cells" in sound_map._too_many(851, 400.0, 9)
    assert "2001 whole numbers are to be found" in sound_map._too_many(850, 400.0, 2001)


def test_the_place_that_is_told_is_a_node_with_another_nearest_to_it() -> None:
    points = np.array([[0.0, 0, 0], [5, 0, 0], [5.1, 0, 0], [9, 0, 0], [9.3, 0, 0]])
    assert sound_map._densest(points, np.array([0, 1, 3, 4])) in (3, 4)  # not vertex 2, which is none
    assert sound_map._densest(points, np.array([3])) == 3


def test_no_place_is_told_where_only_holes_and_handles_have_too_many_whole_numbers(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(sound_map, "_MOST_WHOLE", 3)
    with pytest.raises(NoMeshError, match="found: 4 whole numbers are to be found") as caught:
        principal_quads(*irregular(Torus()), count=100)
    assert caught.value.vertex == -1


def test_a_plate_of_many_holes_is_within_bounds() -> None:
    """One of 324 holes asked for 1757 whole numbers, and was meshed with 16 000 quads."""
    assert not sound_map._too_many(0, 16000.0, 1757)
