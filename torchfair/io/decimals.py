"""Plain decimal numbers of a text, in the grammar of ``float`` and rounded as it does, at the speed of C."""

from __future__ import annotations

import io

import numpy as np
import numpy.typing as npt

from .raw_mesh import Floats, Ints

Codes = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]

DIGITS, BLANKS = b"0123456789", b" \t\r\n"
_BLANK, _PLUS, _MINUS, _DOT, _ZERO, _NINE, _EXPONENT = b" +-.09e"
FEW = 100_000  # numbers that Python reads in less time than importing a faster reader takes
_NO_CASE = 32  # the bit that tells e from E
_ROWS = bytes(10 if code in BLANKS else code for code in range(256))
_IS_MARK = bytes(code not in DIGITS + BLANKS for code in range(256))


def decimals(codes: Codes, starts: Ints) -> Floats | None:
    """The numbers of a text; None if a word of it is no plain decimal number.

    Args:
        codes: ``(N,)`` bytes; the last is a blank.
        starts: ``(n,)`` first byte of each word.
    """
    plus = _leading_plus(codes, starts)
    if plus is None:
        return None
    try:
        return _few(codes) if starts.size <= FEW else _many(codes, starts, plus)
    except (ValueError, OverflowError):
        return None


def _few(codes: Codes) -> Floats:
    return np.array([float(word) for word in codes.tobytes().split()])


def _many(codes: Codes, starts: Ints, plus: Ints) -> Floats:
    """By the reader of Matrix Market files of SciPy.

    It takes one number of a line and leaves what is behind it, knows no ``plus`` in front, drops the sign of zeros, and
    ends the process where there is no number at all.
    """
    from scipy.io import mmread  # takes a quarter of a second

    if plus.size:
        codes = codes.copy()
        codes[plus] = _BLANK
    header = b"%%%%MatrixMarket matrix array real general\n%d 1\n" % starts.size
    values: Floats = np.asarray(mmread(io.BytesIO(header + codes.tobytes().translate(_ROWS)))).reshape(-1)
    zeros = np.flatnonzero(values == 0)
    values[zeros[codes[starts[zeros]] == _MINUS]] = -0.0
    return values


def _leading_plus(codes: Codes, starts: Ints) -> Ints | None:
    """Places of each plus that a word begins with; None if a word is no plain decimal number.

    Lone signs and words without digits in front of their exponent pass: readers refuse them.
    """
    places = np.flatnonzero(np.frombuffer(codes.tobytes().translate(_IS_MARK), np.bool_))
    marks, behind = codes[places], codes[places + 1]
    before = np.where(places, codes[places - 1], _BLANK)
    is_dot, is_exponent = marks == _DOT, (marks | _NO_CASE) == _EXPONENT
    is_sign = (marks == _PLUS) | (marks == _MINUS)
    leading, in_exponent = before <= _BLANK, (before | _NO_CASE) == _EXPONENT
    counts = _is_digit(behind)  # what stands behind an exponent, and behind its sign
    good = is_dot | (is_sign & (leading | (in_exponent & counts)))
    good |= is_exponent & (counts | (behind == _PLUS) | (behind == _MINUS))
    if not good.all() or not _are_once(places[~is_sign], is_dot[~is_sign], starts):
        return None
    plus: Ints = places[leading & (marks == _PLUS)]
    return plus


def _is_digit(codes: Codes) -> Mask:
    return (codes >= _ZERO) & (codes <= _NINE)


def _are_once(places: Ints, is_dot: Mask, starts: Ints) -> bool:
    """Whether words have at most one dot and at most one exponent, in this order."""
    if places.size == starts.size and (places >= starts).all() and (places[:-1] < starts[1:]).all():
        return True  # the usual case: one in each
    words = np.searchsorted(starts, places, side="right")
    shared = words[1:] == words[:-1]
    return not (shared & ~(is_dot[:-1] & ~is_dot[1:])).any()
