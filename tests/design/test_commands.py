"""What pages may say: nothing but well formed commands gets in, whatever is sent."""

from __future__ import annotations

import json
from typing import Any

import pytest
from hostile_messages import RIGHT, texts

from torchfair.design.commands import COMMANDS, MOST_JSON, CommandRefused, checked_command, read_command

WRONG: list[Any] = [
    None, True, -1, 1.5, "", "x" * 5000, [], {}, [[]], {"a": 1}, 1e400, "\0", [None], [-1], [1e20], -0.5, 2**70,
    "\ud800",
    [[1, 2, 3]], [[1, 0, 0, "0"]], {"": 0.0}, {"fairness": -1.0}, [True],
]  # fmt: skip


def whole(kind: str) -> dict[str, Any]:
    return {"type": kind, **{name: values[0] for name, values in RIGHT.get(kind, {}).items()}}


def refuses(kind: str, message: dict[str, Any], words: str) -> bool:
    """Whether a message is refused, which is then said with its place."""
    found = None
    try:
        checked_command(message)
    except CommandRefused as error:
        found = error
    assert found is None or (found.command == kind and str(found).startswith(words))
    return found is not None


@pytest.mark.parametrize("kind", sorted(set(COMMANDS) - {"upload"}))
def test_every_field_is_checked(kind: str) -> None:
    assert set(RIGHT.get(kind, {})) == set(COMMANDS[kind])
    for name, values in RIGHT.get(kind, {}).items():
        for value in values:
            command = checked_command({**whole(kind), name: value, "id": 5})
            assert command.id == 5
            assert command.type == kind
        refused = 0
        for value in WRONG:
            refused += refuses(kind, {**whole(kind), name: value}, f"{kind}: {name}: ")
        assert refused >= len(WRONG) - 5
        if COMMANDS[kind][name].needed:
            with pytest.raises(CommandRefused, match=f"{name} is missing"):
                checked_command({key: value for key, value in whole(kind).items() if key != name})


@pytest.mark.parametrize("kind", sorted(set(COMMANDS) - {"upload"}))
def test_fields_that_there_are_not_are_refused(kind: str) -> None:
    with pytest.raises(CommandRefused, match="there is no field 'strange'"):
        checked_command({**whole(kind), "strange": 1})


NO_COMMANDS = [
    "", "{", "[]", "3", "null", '{"type": 3}', '{"type": "exec"}', '{"type": "__init__"}',
    '{"type": "list", "id": true}', '{"type": "list", "id": 1.5}', '{"type": "worst", "count": NaN}',
    '{"type": "worst", "count": Infinity}', "[" * 100_000, '{"type": "upload", "name": "a.obj", "bytes": "abc"}',
    '{"type":"list"}' + " " * MOST_JSON,
]  # fmt: skip


@pytest.mark.parametrize("text", NO_COMMANDS, ids=range(len(NO_COMMANDS)))
def test_what_is_no_command_is_refused(text: str) -> None:
    with pytest.raises(CommandRefused):
        read_command(text)


def test_places_are_places() -> None:
    for places in (
        [[1, 0, 0, float("nan")]],
        [[1, 0, 0, float("inf")]],
        [[1, 0, 0, 0], [1, 0, 0, 1]],
        [[0.0, 0, 0, 0]],
    ):
        with pytest.raises(CommandRefused, match="move: places: "):
            checked_command({"type": "move", "places": places})


def test_ten_thousand_hostile_messages_are_commands_or_refused() -> None:
    refusals = []
    for text in texts(10_000):
        try:
            command = read_command(text)
        except CommandRefused as error:
            refusals.append(str(error))
        else:
            assert set(command.fields) == set(COMMANDS[command.type])
    assert 1_000 < len(refusals) < 9_900
    assert all(refusals)
    json.dumps(refusals).encode()
