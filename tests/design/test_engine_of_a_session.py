"""The engine of a design: lost, late, stopped, and weights that are turned while it solves."""

from __future__ import annotations

import numpy as np
import pytest
from design_steps import HANDLE, OTHER, S, drag, last, pulled
from design_tools import Bench

from torchfair.design.commands import read_command
from torchfair.design.effects import Ask
from torchfair.design.engine import requests as r
from torchfair.design.engine import saying as say


def test_a_lost_engine_comes_back_with_the_last_settled_shape(bench: Bench) -> None:
    drag(bench, OTHER)
    settled = bench.session.history.now
    bench.say(type="move", places=[[HANDLE, *pulled(bench)]])
    bench.pipe.waiting.clear()
    bench.carry_out(bench.session.engine_lost())
    assert bench.session.state is S.LOST
    assert bench.starts == 2
    bench.worker = bench._worker()
    bench.carry_out(bench.session.engine_said(say.Started(0)))
    assert bench.session.state is S.RESTORING
    bench.run()
    assert bench.session.state is S.READY
    assert bench.session.history.now is settled
    assert np.array_equal(bench.frames[-1].vertices, settled.vertices)
    assert "engine has ended" in last(bench, "notice")["sentence"]
    drag(bench, HANDLE)
    assert set(bench.session.history.now.handles) == {OTHER, HANDLE}


def test_what_an_engine_says_late_is_not_heard(bench: Bench) -> None:
    drag(bench)
    now = bench.session.history.now
    for event in (say.Done(1, now.start), say.Failed(2, "old"), say.Made(1, (now,)), say.Answered(1, b"")):
        assert bench.session.engine_said(event) == []
    assert bench.session.history.now is now


def test_stopping_what_cannot_be_cut_short_gives_the_engine_up(bench: Bench) -> None:
    effects = bench.session.command(1, read_command('{"type": "mesh", "kind": "quads", "count": 50, "id": 8}'))
    assert [type(e.request) for e in effects if isinstance(e, Ask)] == [r.Remake]
    bench.carry_out(bench.session.command(1, read_command('{"type": "stop"}')))
    assert bench.session.state is S.LOST
    assert bench.starts == 2
    assert "nothing has changed" in last(bench, "error")["sentence"]


def test_a_solve_is_stopped_with_the_best_so_far(bench: Bench) -> None:
    drag(bench)
    for text in ('{"type": "solve", "id": 1}', '{"type": "stop"}'):
        bench.carry_out(bench.session.command(1, read_command(text)))
    bench.run()
    assert bench.session.state is S.READY
    assert bench.session.history.now.words == "solve"


@pytest.mark.slow
def test_weights_that_are_turned_during_a_solve_count(bench: Bench) -> None:
    drag(bench, outwards=0.3)
    fresh = bench.session.history.now
    bench.say(type="solve")
    without = bench.vertices
    bench.say(type="undo")
    assert bench.session.history.now is fresh
    for text in ('{"type": "solve"}', '{"type": "weigh", "weights": {"fairness": 20.0}}'):
        bench.carry_out(bench.session.command(1, read_command(text)))
    bench.run()
    assert bench.session.history.now.weights == {"fair": {"fairness": 20.0}}
    assert np.abs(bench.vertices - without).max() > 1e-4
