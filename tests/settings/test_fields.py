"""Fields of settings: what the dataclass says is what help, files and options are made from."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass, field
from typing import Literal

import pytest

from torchfair.formfinding import FairSettings, FormSettings, SymmetricSettings
from torchfair.projection import ProjectionSettings
from torchfair.settings import fields_of, setting

KINDS = (FairSettings, FormSettings, SymmetricSettings, ProjectionSettings)


@dataclass(frozen=True)
class Inner:
    """Inside.

    Attributes:
        steps: How many.
    """

    steps: int = 3


@dataclass(frozen=True)
class Example:
    """All kinds; see :func:`~torchfair.somewhere.else_`.

    Attributes:
        coarse, fine: How far, in two
            lines; ``"auto"`` or :class:`~torchfair.errors.MeshError`: a colon inside.
        angle: How much it turns, radians.
        word: ``"a"`` or ``"b"``.
        limit: At most, or None.
        several: Some.
        numbers: A word, or numbers.
        switch: On or off.
        inner: Another dataclass.

    Raises:
        Nothing: ever.
    """

    coarse: float = setting(0.5, unit="mean edges")
    fine: float = 0.25
    angle: float = setting(math.radians(30.0), unit="radians")
    word: Literal["a", "b"] = "a"
    limit: float | None = None
    several: tuple[float, ...] = (10.0, 3.0)
    numbers: Literal["all", "none"] | tuple[int, ...] = "none"
    switch: bool = False
    inner: Inner = field(default_factory=lambda: Inner(steps=7))


def test_fields_have_everything_and_inner_ones_their_place() -> None:
    fields = fields_of(Example)
    assert list(fields) == [
        *("coarse", "fine", "angle", "word", "limit", "several", "numbers", "switch", "inner.steps")
    ]
    assert fields["inner.steps"].default == 7  # of the outer dataclass
    assert fields["inner.steps"].help == "How many."
    assert fields["coarse"].unit == "mean edges"
    assert fields["coarse"].help == fields["fine"].help
    assert fields["fine"].help == "How far, in two lines; auto or MeshError: a colon inside."
    assert fields["switch"].help == "On or off."
    assert fields["inner.steps"].name == "inner.steps"
    assert [fields[name].is_switch for name in ("switch", "fine")] == [True, False]


@pytest.mark.parametrize(
    ("name", "text", "value"),
    [
        ("fine", "-1e-3", -1e-3),
        ("fine", "inf", math.inf),
        ("angle", "30", math.radians(30.0)),
        ("word", "b", "b"),
        ("limit", "none", None),
        ("limit", "None", None),
        ("limit", "2", 2.0),
        ("several", "4,2.5", (4.0, 2.5)),
        ("several", "none", ()),
        ("numbers", "none", "none"),  # the word of the choice, not the empty tuple
        ("numbers", "3", (3,)),
        ("numbers", "3,9", (3, 9)),
        ("inner.steps", "12", 12),
    ],
)
def test_words_of_a_command_line(name: str, text: str, value: object) -> None:
    found = fields_of(Example)[name].parse(text)
    assert found == value
    assert type(found) is type(value)


@pytest.mark.parametrize(
    ("name", "text", "expected"),
    [
        ("fine", "x", "a number, got 'x'"),
        ("fine", "nan", "a number"),
        ("angle", "200", "degrees from 0 to 180, got '200'"),
        ("angle", "-1", "degrees from 0 to 180"),
        ("word", "c", "one of a, b, got 'c'"),
        ("limit", "some", "a number or none"),
        ("several", "1,,2", "a number, or more with commas between them, or none"),
        ("numbers", "1.5", "one of all, none or a whole number, or more"),
        ("inner.steps", "1.0", "a whole number"),
    ],
)
def test_what_does_not_fit_is_refused_with_what_was_expected(name: str, text: str, expected: str) -> None:
    with pytest.raises(ValueError, match="expected " + expected):
        fields_of(Example)[name].parse(text)


@pytest.mark.parametrize(
    ("name", "value", "read"),
    [
        ("fine", 2, 2.0),
        ("fine", "-inf", -math.inf),
        ("angle", 0.5, 0.5),  # radians, as in the library
        ("limit", None, None),
        ("limit", "none", None),
        ("several", [10, 3], (10.0, 3.0)),
        ("several", [], ()),
        ("numbers", [4], (4,)),
        ("switch", True, True),
    ],
)
def test_values_of_files(name: str, value: object, read: object) -> None:
    found = fields_of(Example)[name].read(value)
    assert found == read
    assert type(found) is type(read)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        *(("fine", value) for value in (True, "2", None, [1.0], math.nan, 10**400, {})),
        *(("inner.steps", value) for value in (2.0, True, "3")),
        *(("switch", value) for value in (1, "true")),
        *(("several", value) for value in (1.0, "1,2", [True], [None])),
        *(("word", value) for value in ("c", None, ["a"])),
    ],
)
def test_values_of_other_kinds_are_refused(name: str, value: object) -> None:
    with pytest.raises(ValueError, match="expected "):
        fields_of(Example)[name].read(value)


def test_shown_values_are_understood_again() -> None:
    for entry in fields_of(Example).values():
        value = entry.parse(entry.show(entry.default))
        assert value == (pytest.approx(entry.default) if entry.unit == "radians" else entry.default)
    assert fields_of(Example)["angle"].show(math.pi / 2.0) == "90"
    assert fields_of(Example)["several"].show(()) == "none"


@pytest.mark.parametrize("kind", KINDS)
def test_every_field_of_every_job_is_explained_and_angles_have_a_unit(kind: type) -> None:
    for name, entry in fields_of(kind).items():
        assert entry.help, name
        assert "`" not in entry.help, name
        assert (entry.unit == "radians") is name.endswith("_angle"), name
        assert (entry.unit == "radians") is (", radians" in entry.help and "squared" not in entry.help), name
    assert {name.partition(".")[0] for name in fields_of(kind)} == {f.name for f in dataclasses.fields(kind)}


def test_types_that_cannot_be_written_are_refused() -> None:
    @dataclass(frozen=True)
    class Opaque:
        thing: dict[str, int] = field(default_factory=dict)

    with pytest.raises(TypeError, match="dict"):
        fields_of(Opaque)
