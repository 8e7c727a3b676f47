"""Commands that change the mesh, or how it is computed."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace

from .commands import Command, CommandRefused
from .core import Core
from .effects import Ask, Effect, Tell
from .engine import requests as r
from .refusals import check_choices, check_places, check_vertices, check_weights
from .states import DesignState
from .telling import counted, handles_message

S = DesignState
Handler = Callable[[Core, int, Command], list[Effect]]
_CUTTABLE = ("drag", "settle", "solve", "edit")
"""What ends with the best so far; anything else is given up with the engine."""


def _move(core: Core, window: int, command: Command) -> list[Effect]:
    places = command["places"]
    check_places(places, core.now)
    drag, effects = core.dragging(window)
    pulled = set(drag.document.handles)
    drag.document = drag.document.moved(places)
    effects.append(Ask(r.Drag(drag.serial, places, {}, command["count"])))
    if not set(places) <= pulled:
        effects.append(Tell(handles_message(drag.document)))
    return [*effects, *core.let_go(window, command.id)] if command["release"] else effects


def _weigh(core: Core, window: int, command: Command) -> list[Effect]:
    weights = check_weights(command["weights"], core.kept.get("settings"))
    if core.state is S.RUNNING:
        return _weigh_running(core, weights)
    drag, effects = core.dragging(window)
    drag.document = drag.document.weighing(weights)
    effects.append(Ask(r.Drag(drag.serial, {}, weights)))
    return [*effects, *core.let_go(window, command.id)] if command["release"] else effects


def _weigh_running(core: Core, weights: Mapping[str, float]) -> list[Effect]:
    pending = core.pending
    if pending is None or pending.what != "solve" or pending.document is None:
        raise CommandRefused(f"weigh is not possible now: {core.doing}")
    core.pending = replace(pending, document=pending.document.weighing(weights))
    return [Ask(r.Drag(pending.serial, {}, weights))]


def _release(core: Core, window: int, command: Command) -> list[Effect]:
    drag = core.drag
    if drag is None or drag.window != window:
        raise CommandRefused("another window drags")
    if not command["back"]:
        return core.let_go(window, command.id)
    core.drag = None
    return core.take("back", drag.began, window, command.id, busy="goes back")


def _hold(core: Core, window: int, command: Command) -> list[Effect]:
    vertices = check_vertices(command["vertices"], core.now)
    document = replace(core.now.holding(vertices), words=counted("fix", vertices))
    return core.take("edit", document, window, command.id)


def _free(core: Core, window: int, command: Command) -> list[Effect]:
    vertices = check_vertices(command["vertices"], core.now)
    document = replace(core.now.freeing(vertices), words=counted("free", vertices))
    return core.take("edit", document, window, command.id, then="settle")


def _choose(core: Core, window: int, command: Command) -> list[Effect]:
    choices = check_choices(command["choices"], core.kept.get("settings"))
    words = ", ".join(f"{name} {value}" for name, value in choices.items())
    document = replace(core.now.choosing(choices), words=words)
    return core.take("edit", document, window, command.id, then="settle")


def _mode(core: Core, window: int, command: Command) -> list[Effect]:
    mode: str = command["mode"]
    if mode == core.now.mode:
        return core.done(window, command)
    return core.remake("mode", {"mode": mode}, window, command.id, f"goes to the mode {mode}")


def _settle(core: Core, window: int, command: Command) -> list[Effect]:
    return core.take("settle", replace(core.now, words="settle"), window, command.id, then="settle")


def _solve(core: Core, window: int, command: Command) -> list[Effect]:
    document = replace(core.now, words="solve")
    busy = f"does the whole job {document.mode}"
    return core.take("solve", document, window, command.id, then="solve", busy=busy)


def _subdivide(core: Core, window: int, command: Command) -> list[Effect]:
    return core.remake("subdivide", {}, window, command.id, "subdivides")


def _mesh(core: Core, window: int, command: Command) -> list[Effect]:
    options = dict(command.fields)
    busy = f"meshes the surface with about {options['count']} {options['kind']}"
    return core.remake("mesh", options, window, command.id, busy)


def _label(core: Core, window: int, command: Command) -> list[Effect]:
    if not command["edges"] and not command["principal"]:
        raise CommandRefused("label: no edges to unmark")
    return core.remake("label", dict(command.fields), window, command.id, "marks principal edges")


def _undo(core: Core, window: int, command: Command) -> list[Effect]:
    position = core.history.position
    if position <= 0:
        raise CommandRefused("there is nothing to undo")
    busy = f"undoes: {core.now.words}"
    return core.take("undo", core.history.states[position - 1], window, command.id, busy=busy)


def _redo(core: Core, window: int, command: Command) -> list[Effect]:
    following = core.history.next
    if following is None:
        raise CommandRefused("there is nothing to redo")
    return core.take("redo", following, window, command.id, busy=f"redoes: {following.words}")


def _pause(core: Core, window: int, command: Command) -> list[Effect]:
    core.paused = command["on"]
    return [Ask(r.Pause(core.serial, core.paused)), *core.tell_state(), *core.done(window, command)]


def _stop(core: Core, window: int, command: Command) -> list[Effect]:
    pending = core.pending
    if pending is None:
        raise CommandRefused("there is nothing to stop")
    done = core.done(window, command)
    if core.question is not None:
        return [*core.rest(), *done]
    if pending.what in _CUTTABLE:
        return [Ask(r.Stop(pending.serial)), *done]
    return [*done, *core.restart(f"{pending.busy}: stopped, nothing has changed")]


EDITS: Mapping[str, Handler] = {
    "move": _move,
    "weigh": _weigh,
    "release": _release,
    "hold": _hold,
    "free": _free,
    "choose": _choose,
    "mode": _mode,
    "settle": _settle,
    "solve": _solve,
    "subdivide": _subdivide,
    "mesh": _mesh,
    "label": _label,
    "undo": _undo,
    "redo": _redo,
    "pause": _pause,
    "stop": _stop,
}
"""What is done with each command."""
