"""Commands about files, and those that change nothing."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from .command_line import command_line
from .commands import Command, CommandRefused
from .core import Core
from .edits import Handler
from .effects import Autosave, Deliver, Effect, Store, Tell
from .engine import requests as r
from .formats import FORMATS, SESSION
from .questions import FILE, KEPT, REPAIRS
from .session_writing import session_bytes
from .states import DesignState

S = DesignState


@dataclass(frozen=True)
class Saving:
    """Where a file goes.

    Attributes:
        path: Of the file; None where it is downloaded.
        name: Of the file.
        overwrite: Whether it may replace one.
    """

    path: str | None
    name: str
    overwrite: bool

    def effect(self, content: Callable[[], bytes], window: int, id: int | None) -> Effect:
        """What brings it there."""
        if self.path is None:
            return Deliver(self.name, content, window, id)
        return Store(self.path, content, self.overwrite, window, id)


def _list(core: Core, window: int, command: Command) -> list[Effect]:
    return [Tell(core.files_message(), window), *core.done(window, command)]


def _camera(core: Core, window: int, command: Command) -> list[Effect]:
    core.camera = command["camera"]
    return core.done(window, command)


def _watch(core: Core, window: int, command: Command) -> list[Effect]:
    core.windows[window] = command["views"]
    return [core.watch(), *core.done(window, command)]


def _worst(core: Core, window: int, command: Command) -> list[Effect]:
    core.worst = command["count"]
    return [core.watch(), *core.done(window, command)]


def _open(core: Core, window: int, command: Command) -> list[Effect]:
    source: str = command["source"]
    if source.startswith("example:"):
        return core.open(r.Open(0, source), window, command.id)
    path = core.folder.to_read(source, typed=command["typed"])
    return core.open(r.Open(0, str(path), None, path.name), window, command.id)


def _upload(core: Core, window: int, command: Command) -> list[Effect]:
    data, name = command["bytes"], _base(command["name"])
    if len(data) > core.upload_bytes:
        raise CommandRefused(f"{name} has {len(data)} bytes, at most {core.upload_bytes} can be uploaded")
    return core.open(r.Open(0, name, data, name), window, command.id)


def _answer(core: Core, window: int, command: Command) -> list[Effect]:
    question, pending = core.question, core.pending
    if question is None or pending is None or command["question"] != question["question"]:
        raise CommandRefused("that question is no longer asked")
    choices = [choice["value"] for choice in question["choices"]]
    if command["choice"] not in choices:
        raise CommandRefused(f"answers are {', '.join(choices)}")
    core.question = None
    if command["choice"] == choices[-1]:
        return [*core.rest(), *core.done(window, command)]
    opening = _answered(core, pending.extra, command["choice"])
    return [*core.open(opening, window, pending.id), *core.done(window, command)]


def _answered(core: Core, opening: r.Open, choice: str) -> r.Open:
    """What is opened after an answer."""
    kept = core.folder.kept(Path(opening.name)) if choice == KEPT else None
    if kept is not None:
        return r.Open(0, str(kept), None, opening.title, asked=True, fresh=True)
    if choice in (KEPT, FILE):
        return replace(opening, fresh=True)
    return replace(opening, repair=REPAIRS[choice][0] if choice in REPAIRS else (), asked=True, fresh=True)


def _strips(core: Core, window: int, command: Command) -> list[Effect]:
    now = core.now
    return core.pend(
        S.RUNNING, lambda serial: r.Unroll(serial, now), "strips", window=window, id=command.id, busy="unrolls strips"
    )


def _save(core: Core, window: int, command: Command) -> list[Effect]:
    format, now = command["format"], core.now
    if format not in FORMATS:
        raise CommandRefused(f"formats are {', '.join(FORMATS)}")
    suffix, path = FORMATS[format][0], None
    name = command["name"] or f"{now.title}{suffix}"
    if command["to"] == "folder":
        path = str(core.folder.to_write(name, suffix, typed=command["typed"]))
    base = _base(name)
    saving = Saving(path, base if base.lower().endswith(suffix) else base + suffix, command["overwrite"])
    if format == SESSION:
        return _save_session(core, saving, window, command.id)
    if core.state is not S.READY:
        raise CommandRefused(f"only a session file can be saved now: {core.doing}")
    others = {"window": window, "id": command.id, "busy": f"writes {saving.name}", "extra": saving}
    return core.pend(S.RUNNING, lambda serial: r.Write(serial, now, format), "save", **others)


def _save_session(core: Core, saving: Saving, window: int, id: int | None) -> list[Effect]:
    states, position, camera = core.history.states, core.history.position, core.camera
    core.saved = core.now
    stored = saving.effect(lambda: session_bytes(states, position, camera), window, id)
    return [stored, Autosave(None), *core.tell_state()]


def _command_line(core: Core, window: int, command: Command) -> list[Effect]:
    text, exact, sentence = command_line(core.now)
    message = {"type": "command_line", "text": text, "exact": exact, "sentence": sentence}
    return [Tell(message, window), *core.done(window, command)]


def _base(name: str) -> str:
    """The last part of a path of whatever system."""
    return name.replace("\\", "/").rpartition("/")[2] or "mesh"


INQUIRIES: Mapping[str, Handler] = {
    "list": _list,
    "camera": _camera,
    "watch": _watch,
    "worst": _worst,
    "open": _open,
    "upload": _upload,
    "answer": _answer,
    "strips": _strips,
    "save": _save,
    "command_line": _command_line,
}
"""What is done with each command."""
