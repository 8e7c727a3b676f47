"""Messages about where a design stands."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from .document import Document, Faces
from .effects import Effect, Tell
from .history import History
from .states import DesignState

_WORDS = {
    "fair": "lowers E near the surface",
    "form": "lowers C between its boundaries",
    "symmetric": "keeps the mesh principal-symmetric",
}


def handles_message(document: Document) -> dict[str, Any]:
    """Where vertices are pulled, and which are fixed."""
    handles = [{"vertex": vertex, "target": list(place)} for vertex, place in document.handles.items()]
    return {"type": "handles", "handles": handles, "held": list(document.held)}


def state_message(
    state: DesignState,
    history: History[Document],
    document: Document | None,
    allowed: Sequence[str],
    *,
    busy: str,
    paused: bool,
    saved: bool,
    windows: int,
) -> dict[str, Any]:
    """What is going on, what could be undone, and what may be asked for."""
    following = history.next
    return {
        "type": "state",
        "state": state.value,
        "mode": "" if document is None else document.mode,
        "title": "" if document is None else document.title,
        "paused": paused,
        "busy": busy,
        "undo": max(0, history.position),
        "redo": history.ahead if history.position >= 0 else 0,
        "undo_words": history.now.words if history.position > 0 else "",
        "redo_words": "" if following is None else following.words,
        "allowed": list(allowed),
        "modes": [] if document is None else _modes(document.faces),
        "windows": windows,
        "saved": saved,
    }


def _modes(faces: Faces) -> list[dict[str, str]]:
    refusals = {
        "form": "the mesh is closed: the mode form needs a boundary" if is_closed(faces) else "",
        "symmetric": "" if bool((np.diff(faces.offsets) == 3).all()) else "mesh this surface with triangles first",
    }
    return [{"mode": mode, "words": words, "refused": refusals.get(mode, "")} for mode, words in _WORDS.items()]


_CLOSED: dict[int, tuple[Faces, bool]] = {}


def is_closed(faces: Faces) -> bool:
    """Whether every edge has two faces."""
    known = _CLOSED.get(0)
    if known is not None and known[0] is faces:
        return known[1]
    following = np.arange(1, len(faces.corners) + 1)
    following[faces.offsets[1:] - 1] = faces.offsets[:-1]
    ends = np.sort(np.stack([faces.corners, faces.corners[following]], axis=1), axis=1)
    counts = np.unique(ends, axis=0, return_counts=True)[1]
    closed = bool((counts == 2).all())
    _CLOSED[0] = faces, closed
    return closed


def error_message(sentence: str, command: str, id: int | None) -> dict[str, Any]:
    """What a page is told that has asked for something impossible."""
    return {"type": "error", "command": command, "id": id, "sentence": sentence}


def notice(sentence: str, kind: str = "info") -> dict[str, Any]:
    """Something to know."""
    return {"type": "notice", "kind": kind, "sentence": sentence}


def done_messages(window: int | None, id: int | None) -> list[Effect]:
    """That a command was carried out, if its window wants to know."""
    return [] if id is None or window is None else [Tell({"type": "done", "id": id}, window)]


def counted(verb: str, vertices: Sequence[int]) -> str:
    """What is done to vertices, in words."""
    return f"{verb} vertex {vertices[0]}" if len(vertices) == 1 else f"{verb} {len(vertices)} vertices"


def dragged_words(before: Document, after: Document) -> str:
    """What a drag did, in words."""
    moved = [vertex for vertex, place in after.handles.items() if before.handles.get(vertex) != place]
    if moved:
        return counted("drag", moved)
    weights, old = after.weights.get(after.mode, {}), before.weights.get(before.mode, {})
    changed = [f"{name} {value:.3g}" for name, value in weights.items() if old.get(name) != value]
    return f"weigh {', '.join(changed)}" if changed else "drag"
