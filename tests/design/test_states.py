"""The table of states: what it allows is done, what it forbids changes nothing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from design_tools import triangle_document

from torchfair.design.commands import COMMANDS, Command, checked_command
from torchfair.design.edits import EDITS
from torchfair.design.effects import Ask, Effect, StartEngine, Tell
from torchfair.design.engine import requests as r
from torchfair.design.engine import saying as say
from torchfair.design.folder import Folder
from torchfair.design.inquiries import INQUIRIES
from torchfair.design.session import DesignSession
from torchfair.design.states import ALLOWED, DesignState, allowed

S = DesignState
SETTINGS = {
    "type": "settings",
    "weights": [{"name": "fairness", "least": 0.0, "most": 300.0}],
    "choices": [{"name": "boundary", "values": [{"value": "glide"}]}],
}
EXAMPLES: dict[str, dict[str, Any]] = {
    "list": {},
    "camera": {"camera": {"position": [0, 0, 1], "target": [0, 0, 0], "up": [0, 1, 0], "fov": 40,
                          "orthographic": False}},
    "watch": {"views": ["stars"]},
    "worst": {"count": 3},
    "open": {"source": "example:roof"},
    "upload": {"name": "a.obj", "bytes": b"v 0 0 0"},
    "answer": {"question": 1, "choice": "repair"},
    "stop": {},
    "move": {"places": [[2, 1.0, 1.0, 0.3]]},
    "weigh": {"weights": {"fairness": 0.5}},
    "release": {},
    "hold": {"vertices": [1]},
    "free": {"vertices": [1]},
    "choose": {"choices": {"boundary": "glide"}},
    "mode": {"mode": "form"},
    "settle": {},
    "solve": {},
    "subdivide": {},
    "mesh": {"kind": "quads", "count": 20},
    "label": {"edges": [0], "principal": True},
    "strips": {},
    "undo": {},
    "redo": {},
    "pause": {"on": True},
    "save": {"format": "session", "to": "download"},
    "command_line": {},
}  # fmt: skip


def command(kind: str) -> Command:
    fields = EXAMPLES[kind]
    return Command(kind, fields) if kind == "upload" else checked_command({"type": kind, **fields})


def serial_of(effects: list[Effect]) -> int:
    return next(effect.request.serial for effect in effects if isinstance(effect, Ask))


def ready() -> DesignSession:
    """With one undo and one redo."""
    session = empty()
    serial = serial_of(session.begin(r.Open(0, "two.obj")))
    document = triangle_document()
    session.engine_said(say.Said(serial, "settings", SETTINGS))
    taken = session.engine_said(say.Made(serial, (document,)))
    session.engine_said(say.Done(serial_of(taken), document.vertices))
    for kind in ("hold", "hold", "undo"):
        session.engine_said(say.Done(serial_of(session.command(1, command(kind))), document.vertices))
    return session


def empty() -> DesignSession:
    session = DesignSession(Folder(Path.cwd()), lambda: 0.0)
    session.window_opened(1)
    return session


def opening() -> DesignSession:
    session = empty()
    serial = serial_of(session.begin(r.Open(0, "two.obj")))
    session.engine_said(say.Asked(serial, "broken", (("repair", "repair"), ("cancel", "no"))))
    return session


def after(*kinds: str) -> Callable[[], DesignSession]:
    def make() -> DesignSession:
        session = ready()
        for kind in kinds:
            session.command(1, command(kind))
        return session

    return make


def lost() -> DesignSession:
    session = ready()
    session.engine_lost()
    return session


def restoring() -> DesignSession:
    session = lost()
    session.engine_said(say.Started(0))
    return session


def failed() -> DesignSession:
    session = ready()
    for _ in range(4):
        session.engine_lost()
    return session


WAYS: dict[DesignState, Callable[[], DesignSession]] = {
    S.EMPTY: empty,
    S.OPENING: opening,
    S.READY: ready,
    S.DRAGGING: after("move"),
    S.SETTLING: after("settle"),
    S.RUNNING: after("solve"),
    S.LOST: lost,
    S.RESTORING: restoring,
    S.FAILED: failed,
}


def snapshot(session: DesignSession) -> Any:
    core = session._core
    return (core.state, core.pending, core.drag, core.history.states, core.history.position, core.paused, core.serial)


def test_every_command_is_in_the_table_and_has_something_that_does_it() -> None:
    assert set(ALLOWED) == set(EDITS) | set(INQUIRIES) == set(EXAMPLES)
    assert set(COMMANDS) == set(ALLOWED) | {"hello", "ack"}
    assert set(WAYS) == set(S)


@pytest.mark.parametrize("state", list(S), ids=lambda state: state.value)
def test_the_table(state: DesignState) -> None:
    for kind in EXAMPLES:
        session = WAYS[state]()
        assert session.state is state
        before = snapshot(session)
        effects = session.command(1, command(kind))
        errors = [e.message for e in effects if isinstance(e, Tell) and isinstance(e.message, dict)
                  and e.message["type"] == "error"]  # fmt: skip
        assert bool(errors) == (state not in ALLOWED[kind]), (kind, errors)
        if errors:
            assert snapshot(session) == before
            assert "not possible now" in errors[0]["sentence"]
            assert len(effects) == 1


@pytest.mark.parametrize("state", list(S), ids=lambda state: state.value)
def test_pages_are_told_what_is_allowed(state: DesignState) -> None:
    session = WAYS[state]()
    message = next(e.message for e in session.window_opened(2) if isinstance(e, Tell))
    assert isinstance(message, dict)
    assert message["state"] == state.value
    assert message["allowed"] == allowed(state) == [kind for kind in sorted(ALLOWED) if state in ALLOWED[kind]]


def test_an_engine_that_keeps_ending_is_given_up_and_opening_starts_another() -> None:
    session = failed()
    effects = session.command(1, command("open"))
    assert isinstance(effects[0], StartEngine)
    assert session.state is S.OPENING


def test_ends_far_apart_are_no_reason_to_give_up() -> None:
    time = [0.0]
    session = DesignSession(Folder(Path.cwd()), lambda: time[0])
    for _ in range(10):
        time[0] += 61.0
        session.engine_lost()
        session.engine_said(say.Started(0))
    assert session.state is S.EMPTY
