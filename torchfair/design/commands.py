"""What a page may say: commands with their fields, checked one by one before anything is done."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from . import values as v
from .limits import MOST_NUMBERED

PROTOCOL = 1
MOST_JSON = 1 << 20
"""Bytes of a command, uploads apart."""


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


@dataclass(frozen=True)
class _Field:
    check: v.Check
    default: Any = None
    needed: bool = True


def _optional(check: v.Check, default: Any) -> _Field:
    return _Field(check, default, needed=False)


COMMANDS: Mapping[str, Mapping[str, _Field]] = {
    "hello": {"token": _Field(v.text), "protocol": _Field(v.whole(0, 1000))},
    "ack": {"frame": _Field(v.whole(0, 2**32 - 1))},
    "list": {},
    "open": {"source": _Field(v.text), "typed": _optional(v.flag, False)},
    "answer": {"question": _Field(v.whole(0, 2**32)), "choice": _Field(v.text)},
    "move": {
        "places": _Field(v.places),
        "release": _optional(v.flag, False),
        "count": _optional(v.whole(0, 65535), 0),
    },
    "weigh": {"weights": _Field(v.named(v.weight)), "release": _optional(v.flag, False)},
    "release": {"back": _optional(v.flag, False)},
    "hold": {"vertices": _Field(v.vertices)},
    "free": {"vertices": _Field(v.vertices)},
    "choose": {"choices": _Field(v.named(v.text))},
    "mode": {"mode": _Field(v.one_of("fair", "form", "symmetric"))},
    "settle": {},
    "solve": {},
    "stop": {},
    "pause": {"on": _Field(v.flag)},
    "subdivide": {},
    "mesh": {"kind": _Field(v.one_of("quads", "triangles")), "count": _Field(v.whole(4, 20_000))},
    "label": {"edges": _Field(v.items(v.whole(0, 3 * MOST_NUMBERED))), "principal": _Field(v.flag)},
    "strips": {},
    "undo": {},
    "redo": {},
    "watch": {"views": _Field(v.views)},
    "worst": {"count": _Field(v.whole(0, 100))},
    "camera": {"camera": _Field(v.camera)},
    "save": {
        "format": _Field(v.text),
        "to": _Field(v.one_of("download", "folder")),
        "name": _optional(v.text, None),
        "typed": _optional(v.flag, False),
        "overwrite": _optional(v.flag, False),
    },
    "command_line": {},
    "upload": {"name": _Field(v.text), "bytes": _Field(v.data)},
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
