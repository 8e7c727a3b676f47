"""Several windows of one design: who is told what, and who may drag."""

from __future__ import annotations

from typing import Any

from design_steps import HANDLE, OTHER, S, drag, pulled
from design_tools import Bench
from hostile_messages import texts

from torchfair.design.commands import CommandRefused, read_command
from torchfair.design.effects import Tell, Wake


def test_a_second_window_is_told_everything_and_the_first_that_it_is_there(bench: Bench) -> None:
    drag(bench)
    bench.session.command(1, read_command('{"type": "watch", "views": ["planarity"]}'))
    effects = bench.session.window_opened(2)
    to_second = [e for e in effects if isinstance(e, Tell) and e.window == 2]
    kinds = [e.message["type"] if isinstance(e.message, dict) else "container" for e in to_second]
    assert kinds == ["state", "settings", "container", "handles", "numbers"]
    assert [e.message["windows"] for e in effects if isinstance(e, Tell) and e.window == 1] == [2]  # type: ignore[call-overload]


def test_only_one_window_drags_and_what_it_leaves_behind_is_let_go(bench: Bench) -> None:
    bench.session.window_opened(2)
    place = [HANDLE, *pulled(bench)]
    bench.say(type="move", places=[place])
    bench.say(2, type="move", places=[place])
    bench.say(2, type="release")
    assert bench.errors == ["another window drags"] * 2
    (wake,) = [e for e in bench.session.window_closed(1) if isinstance(e, Wake)]
    assert wake.seconds == 2.0
    bench.carry_out(bench.session.awoken(wake.why))
    bench.run()
    assert bench.session.state is S.READY
    assert bench.session.history.position == 1
    assert bench.session.awoken(wake.why) == []


def test_a_move_while_the_mesh_settles_is_another_edit(bench: Bench) -> None:
    bench.say(type="move", places=[[HANDLE, *pulled(bench)]])
    for text in ('{"type": "release"}', '{"type": "move", "places": [[18, 1.2, 0, 0]]}'):
        bench.carry_out(bench.session.command(1, read_command(text)))
    bench.run()
    assert bench.session.state is S.DRAGGING
    bench.say(type="release")
    history = bench.session.history
    assert [state.words for state in history.states] == ["open", f"drag vertex {HANDLE}", "drag vertex 18"]
    assert set(history.now.handles) == {HANDLE, OTHER}


def state_of(bench: Bench) -> Any:
    core = bench.session._core
    dragged = None if core.drag is None else core.drag.document
    return (core.state, core.pending, dragged, core.serial, core.paused, core.history.states, core.history.position)


def test_ten_thousand_hostile_messages_change_nothing_unless_they_are_allowed(bench: Bench) -> None:
    """Those that would change something are real commands; all others leave the design as it was."""
    drag(bench)
    refused = 0
    for text in texts(10_000, seed=1):
        try:
            command = read_command(text)
        except CommandRefused:
            refused += 1
            continue
        if command.type in ("hello", "ack"):
            continue
        was = state_of(bench)
        effects = bench.session.command(1, command)
        if any(isinstance(e, Tell) and isinstance(e.message, dict) and e.message["type"] == "error" for e in effects):
            assert state_of(bench) == was
            refused += 1
    assert refused > 3_000
