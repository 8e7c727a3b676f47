"""Whole numbers of few digits, eight bytes at a time."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from .decimals import Codes
from .raw_mesh import Ints

Words = npt.NDArray[np.uint64]

_MOST = 8  # bytes of a machine word
_ZEROS = np.uint64(0x3030303030303030)
_ABOVE_NINE = np.uint64(0x7676767676767676)  # carries into the highest bit of each byte that is more than 9
_HIGHEST = np.uint64(0x8080808080808080)
_EVERY_FOURTH = np.uint64(0x000000FF000000FF)


def short_numbers(codes: Codes, starts: Ints, ends: Ints) -> Ints | None:
    """Numbers of words; None if one of them has more than eight bytes, or anything but digits.

    The eight bytes up to the end of a word are taken as one integer, zeros in place of what is in front of the word,
    and its digits are added up in pairs, pairs of pairs, and both halves, for all words at once.

    Args:
        codes: ``(N,)`` bytes.
        starts: ``(n,)`` first byte of each word.
        ends: ``(n,)`` the byte behind each word.
    """
    sizes = ends - starts
    if sizes.max(initial=0) > _MOST:
        return None
    words = _eight_bytes(codes, ends)
    words ^= _ZEROS
    in_front = ((_MOST - sizes) << 3).view(np.uint64)
    words >>= in_front  # the first bytes are the lowest ones
    words <<= in_front
    wrong = words + _ABOVE_NINE
    wrong |= words
    wrong &= _HIGHEST
    return None if wrong.any() else _sum_of_digits(words)


def _eight_bytes(codes: Codes, ends: Ints) -> Words:
    """The bytes in front of each place as integers, the first of them the lowest."""
    around = np.empty(codes.size + _MOST + 2 * _MOST - codes.size % _MOST, np.uint8)
    around[:_MOST] = around[_MOST + codes.size :] = 0
    around[_MOST : _MOST + codes.size] = codes
    aligned: Words = around.view("<u8")
    at, shift = ends >> 3, ((ends & 7) << 3).view(np.uint64)
    first, second = aligned[at], aligned[at + 1]
    first >>= shift
    second <<= np.uint64(63) ^ shift  # in two steps, as integers cannot be shifted by all their bits
    second <<= np.uint64(1)
    found: Words = first | second
    return found


def _sum_of_digits(words: Words) -> Ints:
    pairs = words * np.uint64(10)
    pairs += words >> np.uint64(8)
    outer = pairs & _EVERY_FOURTH  # the first pair and the third
    outer *= np.uint64(100 + (1_000_000 << 32))
    pairs >>= np.uint64(16)
    pairs &= _EVERY_FOURTH
    pairs *= np.uint64(1 + (10_000 << 32))
    outer += pairs
    outer >>= np.uint64(32)
    return outer.view(np.int64)
