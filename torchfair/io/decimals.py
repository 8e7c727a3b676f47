"""Plain decimal numbers of a text, in the grammar of ``float`` and rounded as it does, at the speed of C."""

from __future__ import annotations

import io

import numpy as np
import numpy.typing as npt

from .raw_mesh import Floats, Ints

Codes = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]

DIGITS, BLANKS = b"0123456789", b" \t\r\n"
_BLANK, _NEWLINE, _PLUS, _MINUS, _DOT, _ZERO, _EXPONENT = b" \n+-.0e"
FEW = 2_000_000  # bytes of text whose numbers Python reads in less time than importing a faster reader takes
_NO_CASE = 32  # the bit that tells e from E
_TEN = np.uint8(10)


def has_plain_blanks(codes: Codes) -> bool:
    """Whether spaces, tabs and line ends are all there is among codes up to that of the space."""
    count = np.count_nonzero(codes <= _BLANK)
    for blank in b" \n\t\r":  # the most frequent ones first
        count -= np.count_nonzero(codes == blank)
        if not count:
            return True
    return False


def decimals(codes: Codes, starts: Ints, ends: Ints, total: int) -> Floats | None:
    """The numbers of a text; None if a word of it is no plain decimal number.

    Args:
        codes: ``(N,)`` bytes; the last is a blank.
        starts: ``(n,)`` first byte of each word.
        ends: ``(n,)`` the blank behind each word.
        total: bytes of all the text that this is a part of.
    """
    plus = _leading_plus(codes, starts)
    if plus is None:
        return None
    try:
        return _few(codes) if total <= FEW or not starts.size else _many(codes, starts, ends, plus)
    except (ValueError, OverflowError):
        return None


def _few(codes: Codes) -> Floats:
    return np.array([float(word) for word in codes.tobytes().split()])


def _many(codes: Codes, starts: Ints, ends: Ints, plus: Ints) -> Floats:
    """By the reader of Matrix Market files of SciPy.

    It takes one number of a line and leaves what is behind it, knows no ``plus`` in front, drops the sign of zeros, and
    ends the process where there is no number at all.
    """
    from scipy.io import mmread  # takes a quarter of a second

    header = b"%%%%MatrixMarket matrix array real general\n%d 1\n" % starts.size
    text = np.empty(len(header) + codes.size, np.uint8)
    text[: len(header)] = np.frombuffer(header, np.uint8)
    body = text[len(header) :]
    body[:] = codes
    body[ends], body[plus] = _NEWLINE, _BLANK
    values: Floats = np.asarray(mmread(io.BytesIO(text.data))).reshape(-1)
    zeros = np.flatnonzero(values == 0)
    values[zeros[codes[starts[zeros]] == _MINUS]] = -0.0
    return values


def _leading_plus(codes: Codes, starts: Ints) -> Ints | None:
    """Places of each plus that a word begins with; None if a word is no plain decimal number.

    Lone signs and words without digits in front of their exponent pass: readers refuse them.
    """
    if not has_plain_blanks(codes):
        return None
    is_dot = codes == _DOT
    is_mark = ~_is_digit(codes)
    is_mark &= codes > _BLANK
    is_mark ^= is_dot
    places = np.flatnonzero(is_mark)
    marks, behind = codes[places], codes[places + 1]
    before = np.where(places, codes[places - 1], _BLANK)
    is_exponent = (marks | _NO_CASE) == _EXPONENT
    is_sign = (marks == _PLUS) | (marks == _MINUS)
    leading, in_exponent = before <= _BLANK, (before | _NO_CASE) == _EXPONENT
    counts = _is_digit(behind)  # what stands behind an exponent, and behind its sign
    good = is_sign & (leading | (in_exponent & counts))
    good |= is_exponent & (counts | (behind == _PLUS) | (behind == _MINUS))
    if not good.all() or not _are_once(np.flatnonzero(is_dot), places[is_exponent], starts):
        return None
    plus: Ints = places[leading & (marks == _PLUS)]
    return plus


def _is_digit(codes: Codes) -> Mask:
    return codes - np.uint8(_ZERO) < _TEN  # below zero it begins at 255 again


def _are_once(dots: Ints, exponents: Ints, starts: Ints) -> bool:
    """Whether words have at most one dot and at most one exponent, in this order."""
    if dots.size == starts.size and (dots >= starts).all() and (dots[:-1] < starts[1:]).all():
        if not exponents.size:
            return True  # the usual case: one dot in each
        words = np.searchsorted(starts, exponents, side="right") - 1
        return bool((words[1:] > words[:-1]).all() and (dots[words] < exponents).all())
    places = np.concatenate([dots, exponents])
    order = np.argsort(places, kind="stable")
    words = np.searchsorted(starts, places[order], side="right")
    is_dot = order < dots.size
    shared = words[1:] == words[:-1]
    return not (shared & ~(is_dot[:-1] & ~is_dot[1:])).any()
