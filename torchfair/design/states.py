"""Where a design stands, and which commands are allowed there."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum


class DesignState(StrEnum):
    """What a design is doing."""

    EMPTY = "EMPTY"
    OPENING = "OPENING"
    READY = "READY"
    DRAGGING = "DRAGGING"
    SETTLING = "SETTLING"
    RUNNING = "RUNNING"
    LOST = "LOST"
    RESTORING = "RESTORING"
    FAILED = "FAILED"


S = DesignState
_ALWAYS = frozenset(S)
_OPENED = frozenset({S.READY, S.DRAGGING, S.SETTLING, S.RUNNING})
_EDITS = ("hold", "free", "choose", "mode", "settle", "solve", "subdivide", "mesh", "label", "strips", "undo", "redo")

ALLOWED: Mapping[str, frozenset[DesignState]] = {
    **dict.fromkeys(("list", "camera", "watch", "worst"), _ALWAYS),
    **dict.fromkeys(("open", "upload"), frozenset({S.EMPTY, S.READY, S.FAILED})),
    "answer": frozenset({S.OPENING}),
    "stop": frozenset({S.OPENING, S.SETTLING, S.RUNNING}),
    "move": frozenset({S.READY, S.DRAGGING, S.SETTLING}),
    "weigh": _OPENED,
    "release": frozenset({S.DRAGGING}),
    **dict.fromkeys(_EDITS, frozenset({S.READY})),
    "pause": _OPENED,
    "save": _ALWAYS - {S.EMPTY, S.OPENING},
    "command_line": _ALWAYS - {S.EMPTY, S.OPENING},
}
"""In which states each command may come; ``hello`` and ``ack`` are the window's own."""


def allowed(state: DesignState) -> list[str]:
    """Names of the commands that may come in a state, in order."""
    return sorted(name for name, states in ALLOWED.items() if state in states)
