"""What a job does without iterations is told to whoever shows its progress."""

from __future__ import annotations

import pytest

from torchfair.formfinding import FairSettings, minimise_normal_variation
from torchfair.progress import listening
from torchfair.projection import ProjectionSettings
from torchfair.shapes import Catenoid, irregular_triangles


@pytest.mark.parametrize("levels", [0, 1])
def test_every_phase_of_a_job_is_told(levels: int) -> None:
    mesh = irregular_triangles(Catenoid(), 60)
    settings = FairSettings(continuation=(), projection=ProjectionSettings(max_iterations=2, damping_scale="identity"))
    told: list[str] = []
    with listening(told.append):
        minimise_normal_variation(
            mesh.vertices, mesh.topology, levels=levels, settings=settings, callback=lambda _: told.append("step")
        )
    told = [words for words in told if words]
    assert told[:3] == ["preparing the mesh", "distances from the reference surface", "preparing the mesh"]
    made = told.index("preparing the reference surface")  # of the start itself when something is to leave it
    assert told[made - 1] == told[made + 1] == "evaluating the start"
    steps = ["setting up the solver", "evaluating the start", "step", "step", "step", "checking the result"]
    found = [words for words in told if words in {"measuring the start", "refining", *steps}]
    within = {"refining", "evaluating the start"}  # phases with others in them
    found = [word for word, before in zip(found, ["", *found], strict=False) if word != before or word not in within]
    assert found == [*(["measuring the start", *steps]), *(["refining", "measuring the start", *steps] * levels)]
