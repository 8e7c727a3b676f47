"""Presets give whole settings by a name, with numbers of their own."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from torchfair.errors import SettingsError
from torchfair.formfinding import DenoiseSettings, FairSettings, FormSettings, SymmetricSettings
from torchfair.settings import plain_settings, preset_settings, presets_of, read_settings

KINDS = (FairSettings, FormSettings, SymmetricSettings)


@pytest.mark.parametrize("kind", KINDS)
def test_a_preset_is_found_by_name_and_survives_a_file(kind: Any, tmp_path: Path) -> None:
    assert set(presets_of(kind)) == {"paper"}
    settings = preset_settings("paper", kind)
    assert settings == kind.paper() != kind()
    path = tmp_path / "paper.json"
    path.write_text(json.dumps(plain_settings(settings)))
    assert read_settings(path, kind) == settings


@pytest.mark.parametrize("kind", KINDS)
def test_numbers_of_a_preset_go_by_the_papers_names(kind: Any) -> None:
    found = preset_settings("paper,w_reg=0.25,w_fair=3,w_target=0.5,steps=7", kind)
    assert found == kind.paper(w_reg=0.25, w_fair=3.0, w_target=0.5, steps=7)
    assert found.projection.initial_damping == 0.25
    assert found.projection.max_iterations == 7


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("papers", "presets are paper, got 'papers'"),
        ("", "presets are paper, got ''"),
        ("paper,w_far=1", "numbers of the preset 'paper' are w_reg, w_fair, .* as NAME=X, got 'w_far=1'"),
        ("paper,w_fair", "as NAME=X, got 'w_fair'"),
        ("paper,w_fair=much", "preset 'paper': w_fair must be a number of at least 0, got 'much'"),
        ("paper,w_fair=-1", "w_fair must be a number of at least 0, got '-1'"),
        ("paper,w_reg=inf", "w_reg must be a number of at least 0, got 'inf'"),
        ("paper,steps=1.5", "steps must be a whole number of at least 0, got '1.5'"),
        ("paper,w_reg=0", "initial_damping"),
    ],
)
def test_what_is_no_preset_is_refused(text: str, message: str) -> None:
    with pytest.raises(SettingsError, match=message):
        preset_settings(text, FairSettings)


def test_a_job_without_presets_says_so() -> None:
    assert not presets_of(DenoiseSettings)
    with pytest.raises(SettingsError, match="presets are none, got 'paper'"):
        preset_settings("paper", DenoiseSettings)
