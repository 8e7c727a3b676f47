"""Whole numbers eight bytes at a time are those of Python; anything else is left to other readers."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from torchfair.io.gathered import Gathered
from torchfair.io.quick_rows import int_rows, portions
from torchfair.io.short_numbers import short_numbers


def numbers_of(words: list[bytes]) -> list[int] | None:
    sizes = np.array([len(word) for word in words])
    ends = np.cumsum(sizes + 1) - 1
    found = short_numbers(np.frombuffer(b" ".join(words) + b"\n", np.uint8), ends - sizes, ends)
    return None if found is None else found.tolist()


@given(st.lists(st.integers(0, 99_999_999).map(lambda n: b"%d" % n), min_size=1, max_size=20), st.integers(1, 8))
@example([b"00000000", b"99999999", b"12345678", b"0", b"09"], 1)
def test_up_to_eight_digits(words: list[bytes], width: int) -> None:
    words += [word.rjust(width, b"0") for word in words]
    assert numbers_of(words) == [int(word) for word in words]


@given(st.lists(st.integers(0, 999).map(lambda n: b"%d" % n), max_size=5), st.data())
def test_any_other_byte_is_refused(words: list[bytes], data: st.DataObject) -> None:
    """Wherever it stands in a word."""
    code = data.draw(st.sampled_from([code for code in range(256) if not 48 <= code <= 57]))
    digits = data.draw(st.binary(min_size=0, max_size=7).map(lambda text: bytes(48 + code % 10 for code in text)))
    place = data.draw(st.integers(0, len(digits)))
    wrong = digits[:place] + bytes([code]) + digits[place:]
    assert numbers_of([*words, wrong, *words]) is None


@pytest.mark.parametrize("place", range(8))
@pytest.mark.parametrize("code", [b":", b"/", b"?", b"\xb0", b"\xba"])
def test_neighbours_of_the_digits_are_refused(place: int, code: bytes) -> None:
    assert numbers_of([b"9" * place + code + b"9" * (7 - place)]) is None


def test_nine_digits_are_too_many() -> None:
    assert numbers_of([b"1", b"123456789"]) is None
    (text,) = portions(b"1 123456789\n")
    rows = int_rows(text)
    assert rows is not None
    assert rows[0].tolist() == [1, 123456789]


@pytest.mark.parametrize("blank", [b"\x0b", b"\x0c", b"\x1f", b"\x01"])
def test_other_blanks_are_left_to_the_careful_way(blank: bytes) -> None:
    (text,) = portions(b"1" + blank + b"2 3\n")
    assert int_rows(text) is None


@given(st.lists(st.lists(st.integers(), max_size=6), max_size=8), st.integers(0, 30))
@example([[1], [2], [3], [4]], 0)
def test_portions_follow_each_other(portions: list[list[int]], expected: int) -> None:
    """Whatever number was expected."""
    gathered = Gathered()
    for portion in portions:
        gathered.add(np.array(portion, object), expected)
    assert gathered.rows.tolist() == [number for portion in portions for number in portion]
