"""Settings in files: nothing is lost on the way, and what does not belong there is named."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

from torchfair.errors import SettingsError
from torchfair.formfinding import FairSettings, FormSettings, SymmetricSettings
from torchfair.linear import ScipyDirect
from torchfair.projection import ProjectionSettings
from torchfair.settings import plain_settings, read_settings, settings_from


def written(path: Path, values: object) -> Path:
    path.write_text(values if isinstance(values, str) else json.dumps(values, allow_nan=False))
    return path


ODD = {
    "nothing and infinity": FairSettings(
        distance_limit=None, continuation=(), planar=(3, 9), projection=ProjectionSettings(least_extrapolation=math.inf)
    ),
    "digits": FairSettings(fairness_weight=0.1 + 0.2, corner_angle=math.radians(40.1), distance_limit=1.0 / 3.0),
    "minus infinity": SymmetricSettings(),
    "form": FormSettings(smoothing=1e-17, projection=ProjectionSettings(time_limit=5, solver="cg")),
}


@pytest.mark.parametrize("name", ODD)
def test_settings_come_back_to_the_last_digit(name: str, tmp_path: Path) -> None:
    settings = ODD[name]
    plain = plain_settings(settings)
    assert read_settings(written(tmp_path / "x.json", plain), type(settings)) == settings
    report = {"job": "fair", "settings": plain, "levels": []}
    assert read_settings(written(tmp_path / "report.json", report), type(settings), job="fair") == settings


def test_what_a_file_does_not_name_has_the_default_of_the_job(tmp_path: Path) -> None:
    path = written(tmp_path / "x.json", {"boundary": "free", "projection": {"time_limit": 2}})
    expected = replace(FairSettings(), boundary="free", projection=replace(FairSettings().projection, time_limit=2.0))
    assert read_settings(path, FairSettings) == expected
    assert expected.projection != ProjectionSettings(time_limit=2.0)
    assert read_settings(written(path, {}), FairSettings) == FairSettings()


def test_toml_has_the_same_fields_with_none_as_a_word_and_angles_also_in_degrees(tmp_path: Path) -> None:
    text = """
    distance_limit = "none"
    smallest_angle_degrees = 12
    planar = [1, 2]
    smoothing = 1
    [projection]
    solver = "scipy"
    least_uncorrected_gain = -inf
    """
    found = read_settings(written(tmp_path / "x.toml", text), FairSettings)
    assert (found.distance_limit, found.planar, found.smoothing) == (None, (1, 2), 1.0)
    assert found.smallest_angle == math.radians(12.0)
    assert found.projection.solver == "scipy"
    assert found.projection.least_uncorrected_gain == -math.inf


REFUSED: dict[str, tuple[object, list[str]]] = {
    "unknown": ({"fairness": 1.0}, ["unknown field 'fairness'", "did you mean fairness_weight?", "distance_limit"]),
    "unknown inside": ({"projection": {"iterations": 1}}, ["'projection.iterations'", "projection.max_iterations"]),
    "degrees of a weight": ({"energy_weight_degrees": 1.0}, ["unknown field 'energy_weight_degrees'"]),
    "word": ({"boundary": "loose"}, ["boundary: expected one of glide, fixed, free, got 'loose'"]),
    "type": ({"smoothing": "much"}, ["smoothing: expected a number, got 'much'"]),
    "true": ({"smoothing": True}, ["smoothing: expected a number, got True"]),
    "whole": ({"projection": {"patience": 1.5}}, ["projection.patience: expected a whole number, got 1.5"]),
    "unit": ({"corner_angle": "x"}, ["corner_angle: expected a number of radians"]),
    "table": ({"projection": 3}, ["projection: expected a table of fields, got 3"]),
    "range": ({"smoothing": -1.0}, ["smoothing must be a finite number above 0, got -1.0"]),
    "range inside": ({"projection": {"accuracy": 2.0}}, ["accuracy must be a number above 0 and at most 1, got 2.0"]),
    "other job": ({"job": "form", "settings": {}}, ["the report of the job 'form', not of 'fair'"]),
    "list": ([1, 2], ["expected fields with their values, got list"]),
    "no JSON": ("{", ["neither TOML nor JSON"]),
}


@pytest.mark.parametrize("name", REFUSED)
def test_faults_are_named_with_file_field_and_what_is_allowed(name: str, tmp_path: Path) -> None:
    values, words = REFUSED[name]
    path = written(tmp_path / "mine.json", values)
    with pytest.raises(SettingsError) as caught:
        read_settings(path, FairSettings, job="fair")
    assert str(caught.value).startswith(f"{path}: ")
    for word in words:
        assert word in str(caught.value)


def test_broken_toml_is_named(tmp_path: Path) -> None:
    path = written(tmp_path / "mine.toml", "smoothing = \n")
    with pytest.raises(SettingsError, match=r"mine\.toml: .*line 1"):
        read_settings(path, FairSettings)


def test_missing_files_are_errors_of_the_system(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        read_settings(tmp_path / "none.json", FairSettings)


def test_mappings_are_read_without_a_file() -> None:
    assert settings_from({"smoothing": 0.5}, FairSettings) == FairSettings(smoothing=0.5)
    with pytest.raises(SettingsError, match=r"^settings: unknown field"):
        settings_from({"x": 1}, FairSettings)


def test_solvers_that_are_objects_are_written_by_name() -> None:
    settings: Any = ProjectionSettings(solver=ScipyDirect())
    assert plain_settings(settings)["solver"] == "scipy"
