"""Where a design stands, and the few ways in which it goes on: what commands and events have in common."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from .commands import Command, CommandRefused
from .document import Document
from .effects import Ask, Autosave, Effect, StartEngine, Tell
from .engine import requests as r
from .engine import saying as say
from .folder import Folder
from .history import History
from .pending import Drag, Pending
from .questions import kept_question
from .session_writing import session_bytes
from .states import DesignState, allowed
from .telling import done_messages, dragged_words, error_message, handles_message, notice, state_message

S = DesignState
_RESTARTS, _WITHIN = 3, 60.0  # seconds
_AUTOSAVED = 20  # states
_CHANGING = ("drag", "settle", "solve", "edit", "undo", "redo")


class Core:
    """One design.

    Args:
        folder: Where files are.
        clock: Seconds.
        upload_bytes: Largest upload.

    Attributes:
        state: What it is doing.
        history: All that was made.
        pending: What the engine is doing; None for nothing but drags.
        drag: What is being dragged.
        question: What was asked and not yet answered.
        kept: Messages that a new window is told, by name.
        frame: The last state that was drawn, and how many there were.
        windows: What each window wants to see besides.
    """

    def __init__(self, folder: Folder, clock: Callable[[], float], upload_bytes: int) -> None:
        self.folder, self.clock, self.upload_bytes = folder, clock, upload_bytes
        self.state, self.history, self.paused = S.EMPTY, History[Document](), False
        self.pending: Pending | None = None
        self.drag: Drag | None = None
        self.question: dict[str, Any] | None = None
        self.kept: dict[str, dict[str, Any] | bytes] = {}
        self.frame: say.Shown | None = None
        self.frames = self.questions = self.serial = 0
        self.windows: dict[int, tuple[str, ...]] = {}
        self.camera: Mapping[str, Any] | None = None
        self.worst, self.began = 8, clock()
        self.saved: Document | None = None
        self.told: set[str] = set()
        self.examples: tuple[str, ...] = ()
        self._lost: list[float] = []

    # ---- what it is ------------------------------------------------------------------------------------

    @property
    def document(self) -> Document | None:
        """What is on the screen: the last settled shape, with what a drag has changed."""
        if self.drag is not None:
            return self.drag.document
        return self.history.now if self.history.position >= 0 else None

    @property
    def now(self) -> Document:
        """The last settled shape; LookupError before there is one."""
        return self.history.now

    @property
    def doing(self) -> str:
        """What is going on, in words."""
        busy = self.pending.busy if self.pending is not None else ""
        return busy or _DOING.get(self.state, "the design is busy")

    @property
    def is_saved(self) -> bool:
        """Whether all is in a session file."""
        return self.history.position < 0 or self.now is self.saved

    # ---- telling ---------------------------------------------------------------------------------------

    def state_message(self) -> dict[str, Any]:
        """What is going on."""
        busy = self.pending.busy if self.pending is not None else ""
        return state_message(
            self.state, self.history, self.document, allowed(self.state), busy=busy, paused=self.paused,
            saved=self.is_saved, windows=len(self.windows),
        )  # fmt: skip

    def tell_state(self, *, all_but: int | None = None) -> list[Effect]:
        """Tells every window what is going on."""
        message = self.state_message()
        return [Tell(message, window) for window in self.windows if window != all_but]

    def watch(self) -> Ask:
        """Says what all windows together want to see."""
        views = tuple(dict.fromkeys(view for views in self.windows.values() for view in views))
        return Ask(r.Watch(self.serial, views, self.worst))

    def files_message(self) -> dict[str, Any]:
        """What can be opened; examples are known once the engine is there."""
        examples = [{"name": f"example:{name}", "words": name.replace("_", " ")} for name in self.examples]
        folder = self.folder
        return {"type": "files", "folder": folder.path.name, "files": folder.listing(), "examples": examples}

    def ask(self, sentence: str, choices: Iterable[tuple[str, str]]) -> list[Effect]:
        """Asks all windows; :attr:`pending` says what it is about."""
        self.questions += 1
        listed = [{"value": value, "words": words} for value, words in choices]
        question = {"type": "question", "question": self.questions, "sentence": sentence, "choices": listed}
        self.question = question
        return [Tell(question), *self.tell_state()]

    def done(self, window: int, command: Command) -> list[Effect]:
        """Tells that a command has been carried out."""
        return done_messages(window, command.id)

    # ---- going on --------------------------------------------------------------------------------------

    def next_serial(self) -> int:
        """Of another request."""
        self.serial += 1
        return self.serial

    def pend(self, state: DesignState, make: Callable[[int], r.Request], what: str, **others: Any) -> list[Effect]:
        """Asks the engine, and waits for what it says.

        Args:
            state: Meanwhile.
            make: The request, from its serial.
            what: Kind of what is pending.
            others: Further attributes of :class:`Pending`.
        """
        serial = self.next_serial()
        self.pending, self.state = Pending(serial, what, **others), state
        return [Ask(make(serial)), *self.tell_state()]

    def open(self, opening: r.Open, window: int | None, id: int | None) -> list[Effect]:
        """Begins to open something."""
        start: list[Effect] = []
        if self.state is S.FAILED:
            start, self._lost = [StartEngine()], []
        name = opening.title or opening.name
        if opening.data is None and not opening.fresh and self.folder.kept(Path(opening.name)) is not None:
            self.pending, self.state = Pending(self.next_serial(), "open", None, window, id, "", opening), S.OPENING
            return [*start, *self.ask(*kept_question(name))]
        busy = f"opens {name}"
        asked = self.pend(
            S.OPENING, lambda serial: replace(opening, serial=serial), "open", window=window, id=id, busy=busy,
            extra=opening,
        )  # fmt: skip
        return [*start, *asked]

    def take(
        self,
        what: str,
        document: Document,
        window: int | None = None,
        id: int | None = None,
        *,
        then: str = "",
        busy: str = "",
        state: DesignState | None = None,
        extra: Any = None,
    ) -> list[Effect]:
        """Makes a document the one on the screen; ``then`` it settles or does the whole job."""
        others = {"document": document, "window": window, "id": id, "busy": busy or document.words, "extra": extra}
        state = state or (S.SETTLING if then == "settle" else S.RUNNING)
        return self.pend(state, lambda serial: r.Take(serial, document, then), what, **others)

    def remake(self, how: str, options: Mapping[str, Any], window: int, id: int | None, busy: str) -> list[Effect]:
        """Begins to make another mesh of this one."""
        now = self.now
        return self.pend(
            S.RUNNING, lambda serial: r.Remake(serial, now, how, options), how, window=window, id=id, busy=busy
        )

    def dragging(self, window: int) -> tuple[Drag, list[Effect]]:
        """The drag that goes on, or a new one; what settles is kept as it is then.

        Raises:
            CommandRefused: another window drags.
        """
        if self.drag is not None:
            if self.drag.window != window:
                raise CommandRefused("another window drags")
            return self.drag, []
        if self.state is S.SETTLING and self.pending is not None and self.pending.document is not None:
            document, frame = self.pending.document, self.frame
            if frame is not None and len(frame.vertices) == document.count:
                document = replace(document, vertices=frame.vertices)
            self.history.push(document)
        self.pending = None
        self.drag = Drag(self.next_serial(), window, self.now, self.now)
        self.state = S.DRAGGING
        return self.drag, self.tell_state()

    def let_go(self, window: int | None = None, id: int | None = None) -> list[Effect]:
        """The drag is over, the mesh settles."""
        drag, self.drag = self.drag, None
        assert drag is not None
        document = replace(drag.document, words=dragged_words(drag.began, drag.document))
        others = {"document": document, "window": window, "id": id, "busy": "comes to rest"}
        return self.pend(S.SETTLING, r.Release, "drag", **others)

    def rest(self) -> list[Effect]:
        """Nothing is going on any more."""
        changed = self.pending is not None and self.pending.what in _CHANGING
        self.pending = self.drag = self.question = None
        if self.history.position < 0:
            self.state = S.EMPTY
            return self.tell_state()
        self.state = S.READY
        effects: list[Effect] = [Tell(handles_message(self.now)), *self.tell_state()]
        return [*effects, self._autosave()] if changed else effects

    def _autosave(self) -> Autosave:
        now, camera = self.history.position, self.camera
        kept = self.history.states[max(0, now + 1 - _AUTOSAVED) : now + 1]
        return Autosave(lambda: session_bytes(kept, len(kept) - 1, camera))

    def restart(self, sentence: str) -> list[Effect]:
        """Another engine instead of the one that has gone or hangs, up to a limit; what was pending is given up."""
        now = self.clock()
        self._lost = [*(time for time in self._lost if time > now - _WITHIN), now]
        pending, self.pending, self.drag, self.question = self.pending, None, None, None
        told: list[Effect] = [Tell(notice(sentence, "warning"))]
        if pending is not None and pending.id is not None and pending.window is not None:
            told.append(Tell(error_message(sentence, pending.what, pending.id), pending.window))
        if len(self._lost) > _RESTARTS:
            self.state = S.FAILED
            return [*told, Tell(notice(_GIVEN_UP, "warning")), *self.tell_state()]
        self.state = S.LOST
        return [*told, StartEngine(), *self.tell_state()]


_GIVEN_UP = "the engine has ended several times; save the session, then open something else"
_DOING = {
    S.EMPTY: "nothing is open",
    S.FAILED: "the engine cannot be started; save the session, then open something else",
    S.LOST: "the engine is being started again",
    S.RESTORING: "the last settled shape is being brought back",
    S.DRAGGING: "a handle is being dragged",
    S.SETTLING: "the mesh is coming to rest",
    S.READY: "nothing is going on",
}
