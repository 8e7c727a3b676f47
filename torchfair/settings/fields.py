"""The fields of a settings dataclass, with all that its users want to know of them."""

from __future__ import annotations

import dataclasses
import inspect
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any, get_type_hints

from .kinds import Kind, Switch, kinds_of

_KNOWN: dict[type, dict[str, SettingField]] = {}


@dataclass(frozen=True)
class SettingField:
    """A field of a settings dataclass, or of one inside it.

    Attributes:
        name: With dots where it stands inside another field, such as ``projection.max_iterations``.
        kinds: What it may be.
        default: Its default.
        unit: Of numbers, as the library has them; empty where there is none.
        help: What it means, one paragraph of plain text.
    """

    name: str
    kinds: tuple[Kind, ...]
    default: Any
    unit: str
    help: str

    @property
    def words(self) -> str:
        """What may stand in a file, in words."""
        return " or ".join(kind.words for kind in self.kinds)

    @property
    def symbol(self) -> str:
        """What may stand on a command line, in symbols."""
        return "|".join(kind.symbol for kind in self.kinds)

    @property
    def is_switch(self) -> bool:
        """Whether it is true or false."""
        return isinstance(self.kinds[0], Switch)

    def read(self, value: object) -> Any:
        """The setting from a value of JSON or TOML; ValueError that says what is expected."""
        return self._first(lambda kind: kind.read(value), value, self.words)

    def parse(self, text: str) -> Any:
        """The setting from a word of a command line; ValueError that says what is expected."""
        return self._first(lambda kind: kind.parse(text), text, " or ".join(kind.spoken for kind in self.kinds))

    def show(self, value: Any) -> str:
        """A value as it is written on a command line."""
        shown: str = self._first(lambda kind: kind.show(value), value, self.words)
        return shown

    def _first(self, attempt: Callable[[Kind], Any], value: object, words: str) -> Any:
        for kind in self.kinds:
            try:
                return attempt(kind)
            except ValueError:
                continue
        raise ValueError(f"expected {words}, got {value!r}")


def fields_of(kind: type) -> dict[str, SettingField]:
    """All fields of a settings dataclass by name, in order, those of dataclasses inside it in their place.

    Raises:
        TypeError: a field has no default, or a type that cannot be written in a file.
    """
    if kind not in _KNOWN:
        _KNOWN[kind] = {field.name: field for field in _fields(kind, kind(), "")}
    return _KNOWN[kind]


def _fields(kind: Any, defaults: Any, prefix: str) -> Iterator[SettingField]:
    hints, texts = get_type_hints(kind), _texts(kind)
    for field in dataclasses.fields(kind):
        name, default, hint = prefix + field.name, getattr(defaults, field.name), hints[field.name]
        if dataclasses.is_dataclass(hint):
            yield from _fields(hint, default, f"{name}.")
            continue
        unit = field.metadata.get("unit", "")
        kinds = kinds_of(hint, unit, field.metadata.get("choices", ()))
        yield SettingField(name, kinds, default, unit, texts.get(field.name, ""))


def _texts(kind: type) -> dict[str, str]:
    """What the section ``Attributes:`` of a docstring says of every name, without markup."""
    section = re.search(r"^Attributes:\n(.*?)(?:^\S|\Z)", inspect.getdoc(kind) or "", re.M | re.S)
    entries = re.split(r"^ {4}(?=\w[\w, ]*: )", section[1] if section else "", flags=re.M)[1:]
    texts: dict[str, str] = {}
    for entry in entries:
        names, _, text = entry.partition(": ")
        texts |= dict.fromkeys(names.split(", "), _without_markup(" ".join(text.split())))
    return texts


def _without_markup(text: str) -> str:
    text = re.sub(r":\w+:`~?(?:[\w.]*\.)?(\w+)`", r"\1", text)  # :func:`~torchfair.x.name`
    return re.sub(r"``\"?(.*?)\"?``", r"\1", text)
