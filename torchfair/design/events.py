"""What follows from what the engine says."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from .core import Core
from .document import Document
from .effects import Ask, Draw, Effect, Tell
from .engine import requests as r
from .engine import saying as say
from .history import History
from .inquiries import Saving
from .pending import Pending
from .states import DesignState
from .telling import done_messages, error_message, notice

S = DesignState


def heard(core: Core, event: say.Event) -> list[Effect]:
    """What has to be done; nothing for what belongs to nothing that is going on."""
    at_once = _AT_ONCE.get(type(event))
    if at_once is not None:
        return at_once(core, event)
    if core.drag is not None and event.serial == core.drag.serial and isinstance(event, say.Failed):
        return _drag_failed(core, event)
    pending = core.pending
    if pending is None or event.serial != pending.serial:
        return []
    return _ENDS[type(event)](core, pending, event)


# ---- at once ---------------------------------------------------------------------------------------------------------


def _started(core: Core, event: say.Started) -> list[Effect]:
    new, core.examples = event.examples != core.examples, event.examples
    effects: list[Effect] = [core.watch(), *([Tell(core.files_message())] if new else [])]
    if core.paused:
        effects.append(Ask(r.Pause(core.serial, True)))
    if core.state is not S.LOST:
        return effects
    if core.history.position < 0:
        return [*effects, *core.rest()]
    return [*effects, *core.take("restore", core.now, busy="brings the last settled shape back", state=S.RESTORING)]


def _shown(core: Core, event: say.Shown) -> list[Effect]:
    core.frame, core.frames = event, core.frames + 1
    return [Draw(event, core.frames)]


def _said(core: Core, event: say.Said) -> list[Effect]:
    message = event.message
    if event.keep == "topology":
        core.frame = None
        core.kept = {name: kept for name, kept in core.kept.items() if name == "settings"}
    if event.keep == "numbers" and isinstance(message, dict):
        message = {**message, "frame": core.frames, "time": round(core.clock() - core.began, 3)}
    core.kept[event.keep] = message
    return [Tell(message)]


def _drag_failed(core: Core, event: say.Failed) -> list[Effect]:
    drag, core.drag = core.drag, None
    assert drag is not None
    told = Tell(error_message(event.sentence, "move", None), drag.window)
    return [told, *core.take("back", drag.began, busy="goes back")]


# ---- at the end of what was pending ----------------------------------------------------------------------------------


def _done(core: Core, pending: Pending, event: say.Done) -> list[Effect]:
    if pending.document is not None:
        _commit(core, pending, pending.document, event)
    return [*done_messages(pending.window, pending.id), *_new_notes(core, event.notes), *core.rest()]


def _commit(core: Core, pending: Pending, document: Document, event: say.Done) -> None:
    """Puts what was done into the history."""
    if pending.what == "undo":
        core.history.undo()
    elif pending.what == "redo":
        core.history.redo()
    elif pending.what == "open":
        made: say.Made = pending.extra
        core.history = History(made.documents, made.now)
        core.began, core.told = core.clock(), set()
        core.saved = document if made.is_session else None
    elif pending.what not in ("back", "restore"):
        same = np.array_equal(event.vertices, document.vertices)
        if not (pending.what == "settle" and same):
            core.history.push(document if same else replace(document, vertices=event.vertices))


def _new_notes(core: Core, notes: tuple[str, ...]) -> list[Effect]:
    """Those that say something new, whatever their numbers are."""
    effects: list[Effect] = []
    for note in notes:
        words = re.sub(r"[\d.]+(e-?\d+)?", "#", note)
        if words not in core.told:
            core.told.add(words)
            effects.append(Tell(notice(note)))
    return effects


def _made(core: Core, pending: Pending, event: say.Made) -> list[Effect]:
    told: list[Effect] = [Tell(notice(note)) for note in event.notes]
    if event.camera is not None:
        core.camera = event.camera
        told.append(Tell({"type": "camera", "camera": event.camera}))
    document = event.documents[event.now]
    opens = pending.what == "open"
    taken = core.take(
        "open" if opens else "edit", document, pending.window, pending.id, busy=pending.busy,
        state=S.OPENING if opens else S.RUNNING, extra=event,
    )  # fmt: skip
    return [*told, *taken]


def _asked(core: Core, pending: Pending, event: say.Asked) -> list[Effect]:
    return core.ask(event.sentence, event.choices)


def _answered(core: Core, pending: Pending, event: say.Answered) -> list[Effect]:
    window = pending.window if pending.window is not None else 0
    if pending.what == "save":
        saving: Saving = pending.extra
        return [saving.effect(lambda: event.data, window, pending.id), *core.rest()]
    return [Tell(event.data, window), *done_messages(window, pending.id), *core.rest()]


def _failed(core: Core, pending: Pending, event: say.Failed) -> list[Effect]:
    told: list[Effect] = [Tell(error_message(event.sentence, pending.what, pending.id), pending.window)]
    if pending.what in ("back", "restore"):
        core.pending, core.state = None, S.FAILED
        return [*told, *core.tell_state()]
    if pending.document is None or core.history.position < 0:
        return [*told, *core.rest()]
    return [*told, *core.take("back", core.now, busy="goes back")]


_AT_ONCE: Mapping[type, Callable[[Core, Any], list[Effect]]] = {
    say.Started: _started,
    say.Shown: _shown,
    say.Said: _said,
}
_ENDS: Mapping[type, Callable[[Core, Pending, Any], list[Effect]]] = {
    say.Done: _done,
    say.Made: _made,
    say.Asked: _asked,
    say.Answered: _answered,
    say.Failed: _failed,
}
