"""Singular points and corners of creases that find no room in a mesh, and many whole numbers, end soon."""

from __future__ import annotations

import numpy as np
import pytest
from meshing_tools import cut, ellipsoid, problem_of, punched

from torchfair.meshing import MeshingSettings, NoMeshError, principal_quads, seamless_map, sound_map
from torchfair.meshing.failed_attempt import FailedAttemptError
from torchfair.meshing.relaxation import stretched
from torchfair.meshing.seamless_map import MapProblem
from torchfair.shapes import icosphere


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
        with pytest.raises(NoMeshError, match=words):
            principal_quads(*ellipsoid(3), count=150, settings=settings)
    assert not begun


def test_room_ends_where_nodes_are_too_many_and_whole_numbers_where_a_search_would_not_end() -> None:
    sound_map._check_room(sound_map._FEW, 0.5, 100)
    sound_map._check_room(850, 400.0, sound_map._MOST_WHOLE)
    for nodes, whole in ((851, 100), (850, sound_map._MOST_WHOLE + 1)):
        with pytest.raises(FailedAttemptError) as caught:
            sound_map._check_room(nodes, 400.0, whole)
        assert caught.value.hopeless  # nothing near it is tried


@pytest.mark.parametrize("name", ["ellipsoid", "sphere with holes"])
def test_the_optimum_of_real_numbers_is_the_same_without_dense_matrices(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    round_one = icosphere(3)
    surface = ellipsoid(3) if name == "ellipsoid" else punched(round_one.vertices, round_one.topology, 0, 20, 40)
    frames, graph = cut(*surface)
    problem = problem_of(frames, graph, 0.2)[0]
    assert problem.split.basis.shape[1] > 0
    dense = problem.real_jacobians
    monkeypatch.setattr(seamless_map, "_MOST_DENSE", 0)
    monkeypatch.delattr(seamless_map.MapProblem, "_optimum")
    sparse = problem_of(frames, graph, 0.2)[0].real_jacobians
    assert np.abs(sparse - dense).max() < 1e-5 * np.abs(dense).max()
