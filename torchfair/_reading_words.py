"""How a file is read, in words: of the command line, and of the page of ``torchfair design`` and its histories.

A word is the name of an argument of :func:`torchfair.io.load_mesh`, with a value or alone: ``repair``, ``weld=0.01``,
``surfaces=40,20``. As options they begin with dashes.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from .errors import MeshError

UNREAD: Mapping[str, Any] = {"repair": False, "weld": False, "split_edges": False, "surfaces": None}
"""The arguments that have words, each with what it is without one."""

_SHOWN = 40  # characters of a text that is refused


def distance_of(text: str) -> float:
    """Within which edges are welded.

    Raises:
        ValueError: it is no finite number of at least 0.
    """
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value < math.inf:
        raise ValueError(f"expected a distance of at least 0, got {_shown(text)}")
    return value


def cells_of(text: str) -> int | tuple[int, int]:
    """How many cells a surface gets, in one or two numbers.

    Raises:
        ValueError: they are no whole numbers of at least 1.
    """
    words = text.split(",")
    if len(words) not in (1, 2) or not all(_is_count(word) for word in words):
        raise ValueError(f"expected whole numbers of at least 1, such as 40 or 40,20, got {_shown(text)}")
    return int(words[0]) if len(words) == 1 else (int(words[0]), int(words[1]))


def _is_count(word: str) -> bool:
    """Python refuses to read numbers of thousands of digits, in words of its own."""
    return word.isascii() and word.isdigit() and len(word) <= _SHOWN and int(word) > 0


def _shown(text: str) -> str:
    return repr(text) if len(text) <= _SHOWN else f"{text[:_SHOWN]!r}..."


def words_of(options: Mapping[str, Any]) -> tuple[str, ...]:
    """Words for arguments of :func:`torchfair.io.load_mesh`; those that are False or None have none."""
    words = []
    for name, value in options.items():
        if value is True:
            words.append(name)
        elif value is not None and value is not False:
            numbers = value if isinstance(value, tuple) else (value,)
            words.append(f"{name}={','.join(map(repr, numbers))}")
    return tuple(words)


def options_of(words: Iterable[str]) -> dict[str, Any]:
    """The arguments that such words stand for.

    Raises:
        MeshError: a word is none of them.
    """
    options: dict[str, Any] = {}
    for word in words:
        name, _, value = word.partition("=")
        try:
            options[name] = _WITH_VALUE[name](value) if value else _ALONE[name]
        except (KeyError, ValueError):
            raise MeshError(f"{word!r} is no way to read a file") from None
    return options


_ALONE = {"repair": True, "weld": True, "split_edges": True}
_WITH_VALUE: Mapping[str, Callable[[str], Any]] = {"weld": distance_of, "surfaces": cells_of}
