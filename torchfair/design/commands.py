"""What a page may say: commands with their fields, checked one by one before anything is done."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

PROTOCOL = 1
MOST_JSON = 1 << 20
"""Bytes of a command, uploads apart."""
_MOST_VERTICES = 1_000_000
_MOST_TEXT = 4096
_LARGEST = 1e15


class CommandRefused(ValueError):
    """A command that is none, or has a field that is none; the message is a sentence for the page.

    Attributes:
        command: Its type as far as it is known.
        id: That of the command, as far as it is known.
    """

    def __init__(self, sentence: str, command: str = "", id: int | None = None) -> None:
        super().__init__(sentence)
        self.command, self.id = command, id


@dataclass(frozen=True)
class Command:
    """A command that is well formed.

    Attributes:
        type: Its name.
        fields: All its fields, with defaults filled in.
        id: Comes back in the answer; None without.
    """

    type: str
    fields: Mapping[str, Any] = field(default_factory=dict)
    id: int | None = None

    def __getitem__(self, name: str) -> Any:
        return self.fields[name]


Check = Callable[[object], Any]
"""Gives the value; ValueError that says what is expected."""


@dataclass(frozen=True)
class _Field:
    check: Check
    default: Any = None
    needed: bool = True


def _optional(check: Check, default: Any) -> _Field:
    return _Field(check, default, needed=False)


# ---- values ----------------------------------------------------------------------------------------------------------


def _flag(value: object) -> bool:
    if not isinstance(value, bool):
        raise ValueError("expected true or false")
    return value


def _whole(least: int, most: int) -> Check:
    def check(value: object) -> int:
        if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= most:
            raise ValueError(f"expected a whole number from {least} to {most}")
        return value

    return check


def _number(value: object) -> float:
    whole = isinstance(value, int) and not isinstance(value, bool) and abs(value) < 2**63
    if not whole and not isinstance(value, float):
        raise ValueError("expected a number")
    found = float(value)  # type: ignore[arg-type]
    if not (math.isfinite(found) and abs(found) <= _LARGEST):
        raise ValueError(f"expected a finite number of at most {_LARGEST:g}")
    return found


def _text(value: object) -> str:
    if not isinstance(value, str) or not 0 < len(value) <= _MOST_TEXT or "\0" in value:
        raise ValueError(f"expected a text of 1 to {_MOST_TEXT} characters")
    if any(0xD800 <= ord(letter) <= 0xDFFF for letter in value):
        raise ValueError("expected a text that can be written in UTF-8")
    return value


def _one_of(*words: str) -> Check:
    def check(value: object) -> str:
        if not isinstance(value, str) or value not in words:
            raise ValueError(f"expected one of {', '.join(words)}")
        return value

    return check


def _data(value: object) -> bytes:
    if not isinstance(value, bytes):
        raise ValueError("expected bytes, which only a container holds")
    return value


def _items(check: Check, *, least: int = 0, most: int = _MOST_VERTICES) -> Check:
    def check_all(value: object) -> tuple[Any, ...]:
        if not isinstance(value, list) or not least <= len(value) <= most:
            raise ValueError(f"expected a list of {least} to {most}")
        return tuple(check(item) for item in value)

    return check_all


def _place(value: object) -> tuple[int, tuple[float, float, float]]:
    if not isinstance(value, list) or len(value) != 4:
        raise ValueError("expected [vertex, x, y, z]")
    x, y, z = (_number(item) for item in value[1:])
    return _vertex(value[0]), (x, y, z)


def _places(value: object) -> dict[int, tuple[float, float, float]]:
    pairs = _items(_place, least=1, most=10_000)(value)
    if len(dict(pairs)) < len(pairs):
        raise ValueError("expected each vertex once")
    return dict(pairs)


def _named(check: Check, most: int = 40) -> Check:
    def check_all(value: object) -> dict[str, Any]:
        if not isinstance(value, dict) or not 0 < len(value) <= most:
            raise ValueError(f"expected an object of 1 to {most} names")
        return {_text(name): check(item) for name, item in value.items()}

    return check_all


def _weight(value: object) -> float:
    found = _number(value)
    if found < 0.0:
        raise ValueError("expected a weight of at least 0")
    return found


_point = _items(_number, least=3, most=3)


def _camera(value: object) -> dict[str, Any]:
    names = {"position": _point, "target": _point, "up": _point, "fov": _number, "orthographic": _flag}
    if not isinstance(value, dict) or set(value) != set(names):
        raise ValueError(f"expected an object of {', '.join(names)}")
    return {name: check(value[name]) for name, check in names.items()}


_vertex = _whole(0, _MOST_VERTICES)
_vertices = _items(_vertex, least=1)
_views = _items(_one_of("stars", "deviation", "planarity"), most=3)

COMMANDS: Mapping[str, Mapping[str, _Field]] = {
    "hello": {"token": _Field(_text), "protocol": _Field(_whole(0, 1000))},
    "ack": {"frame": _Field(_whole(0, 2**32 - 1))},
    "list": {},
    "open": {"source": _Field(_text), "typed": _optional(_flag, False)},
    "answer": {"question": _Field(_whole(0, 2**32)), "choice": _Field(_text)},
    "move": {
        "places": _Field(_places),
        "release": _optional(_flag, False),
        "count": _optional(_whole(0, 65535), 0),
    },
    "weigh": {"weights": _Field(_named(_weight)), "release": _optional(_flag, False)},
    "release": {"back": _optional(_flag, False)},
    "hold": {"vertices": _Field(_vertices)},
    "free": {"vertices": _Field(_vertices)},
    "choose": {"choices": _Field(_named(_text))},
    "mode": {"mode": _Field(_one_of("fair", "form", "symmetric"))},
    "settle": {},
    "solve": {},
    "stop": {},
    "pause": {"on": _Field(_flag)},
    "subdivide": {},
    "mesh": {"kind": _Field(_one_of("quads", "triangles")), "count": _Field(_whole(4, 20_000))},
    "label": {"edges": _Field(_items(_whole(0, 3 * _MOST_VERTICES))), "principal": _Field(_flag)},
    "strips": {},
    "undo": {},
    "redo": {},
    "watch": {"views": _Field(_views)},
    "worst": {"count": _Field(_whole(0, 100))},
    "camera": {"camera": _Field(_camera)},
    "save": {
        "format": _Field(_text),
        "to": _Field(_one_of("download", "folder")),
        "name": _optional(_text, None),
        "typed": _optional(_flag, False),
        "overwrite": _optional(_flag, False),
    },
    "command_line": {},
    "upload": {"name": _Field(_text), "bytes": _Field(_data)},
}
"""Fields of every command."""


def read_command(text: str) -> Command:
    """A command from the text of a message.

    Raises:
        CommandRefused: it is no JSON, no object, none of the commands, or has a field that is wrong.
    """
    if len(text) > MOST_JSON:
        raise CommandRefused(f"a message has at most {MOST_JSON} characters")
    try:
        value = json.loads(text, parse_constant=_no_number)
    except (ValueError, RecursionError):
        raise CommandRefused("a message has to be JSON with finite numbers") from None
    return checked_command(value)


def checked_command(value: object) -> Command:
    """A command from a decoded message; see :func:`read_command`."""
    if not isinstance(value, dict):
        raise CommandRefused("a message has to be an object")
    fields = dict(value)
    kind, number = fields.pop("type", None), fields.pop("id", None)
    if isinstance(number, bool) or not (number is None or (isinstance(number, int) and abs(number) < 2**53)):
        raise CommandRefused("id: expected a whole number")
    if not isinstance(kind, str) or kind not in COMMANDS:
        raise CommandRefused("there is no such command", id=number)
    known = COMMANDS[kind]
    strange = [name for name in fields if name not in known]
    if strange:
        raise CommandRefused(f"{kind}: there is no field {strange[0][:40]!r}", kind, number)
    return Command(kind, {name: _read(kind, name, rule, fields, number) for name, rule in known.items()}, number)


def _read(kind: str, name: str, rule: _Field, fields: Mapping[str, Any], number: int | None) -> Any:
    if name not in fields:
        if rule.needed:
            raise CommandRefused(f"{kind}: the field {name} is missing", kind, number)
        return rule.default
    try:
        return rule.check(fields[name])
    except (ValueError, TypeError, OverflowError) as error:
        raise CommandRefused(f"{kind}: {name}: {error}", kind, number) from None


def _no_number(word: str) -> float:
    raise ValueError(word)
