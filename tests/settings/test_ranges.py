"""What no setting can be is refused by the name of the field, of all settings alike."""

from __future__ import annotations

import math
from typing import Any

import pytest

from torchfair.errors import SettingsError
from torchfair.formfinding import DenoiseSettings, FairSettings, FormSettings, SymmetricSettings
from torchfair.meshing import MeshingSettings
from torchfair.projection import ProjectionSettings
from torchfair.settings import fields_of
from torchfair.settings.files import with_fields
from torchfair.settings.kinds import Count, Number

KINDS: tuple[Any, ...] = (
    *(DenoiseSettings, FairSettings, FormSettings, SymmetricSettings),
    *(MeshingSettings, ProjectionSettings),
)
FIELDS = [(kind, field) for kind in KINDS for field in fields_of(kind).values() if "." not in field.name]
NUMBERS = [(kind, field.name) for kind, field in FIELDS if isinstance(field.kinds[0], Number)]
COUNTS = [(kind, field.name) for kind, field in FIELDS if isinstance(field.kinds[0], Count)]
ANGLES = [(kind, field.name) for kind, field in FIELDS if field.unit == "radians"]
NEGATIVE = {"least_uncorrected_gain"}


def refuses(kind: Any, name: str, value: object) -> None:
    with pytest.raises(SettingsError, match=name):
        with_fields(kind(), {name: value})


@pytest.mark.parametrize(("kind", "name"), NUMBERS)
def test_numbers_are_numbers(kind: Any, name: str) -> None:
    for value in (math.nan, "x", True, *(() if name in NEGATIVE else (-1.0,))):
        refuses(kind, name, value)


@pytest.mark.parametrize(("kind", "name"), COUNTS)
def test_counts_are_counts(kind: Any, name: str) -> None:
    for value in (math.nan, 1.5, True, -1):
        refuses(kind, name, value)


@pytest.mark.parametrize(("kind", "name"), ANGLES)
def test_angles_are_radians_up_to_pi(kind: Any, name: str) -> None:
    for value in (math.nextafter(math.pi, 4.0), 40.0, math.inf, -1e-9):
        refuses(kind, name, value)


def test_fields_are_found() -> None:
    assert {len(NUMBERS) > 50, len(COUNTS) > 4, len(ANGLES) > 7} == {True}


@pytest.mark.parametrize("name", ["smallest_area", "smallest_edge"])
def test_shares_are_at_most_the_whole(name: str) -> None:
    refuses(FairSettings, name, 1.01)
    assert getattr(FairSettings(**{name: 1.0}), name) == 1.0
