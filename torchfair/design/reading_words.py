"""How a file is read, as words of the command line without dashes: ``repair``, ``weld=0.01``, ``surfaces=40,20``."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Any

from ..errors import MeshError


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


def _cells(text: str) -> int | tuple[int, int]:
    first, *second = map(int, text.split(","))
    if not second:
        return first
    (other,) = second
    return first, other


_ALONE = {"repair": True, "weld": True, "split_edges": True}
_WITH_VALUE: Mapping[str, Callable[[str], Any]] = {"weld": float, "surfaces": _cells}
