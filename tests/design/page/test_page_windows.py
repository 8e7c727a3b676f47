"""More than one window, reloads, engines that die, servers that are away."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from browser_tools import Served, Window

pytestmark = pytest.mark.browser


def test_two_windows_see_the_same(window: Window, open_window: Callable[..., Window]) -> None:
    other = open_window()
    vertex = window.inner_vertex()
    window.begin_drag(vertex, 0, -30)
    other.wait("design.store.state.state === 'DRAGGING' && design.store.frame.number > 0")
    window.end_drag()
    other.at_rest()
    other.wait(f"design.store.handles.has({vertex})")
    assert (other.positions() == window.positions()).all()
    other.do("design.send('undo')")
    window.wait(f"!design.store.handles.has({vertex})")
    window.at_rest()
    assert (other.positions() == window.positions()).all()


def test_a_reload_shows_the_same_mesh_handles_and_mesh_before(window: Window) -> None:
    start, vertex = window.positions(), window.inner_vertex()
    window.begin_drag(vertex, 0, -30)
    window.end_drag()
    shape = window.positions()
    window.page.reload()
    window.wait("design.store.frame")
    window.ready()
    assert (window.positions() == shape).all()
    assert window(f"design.store.handles.has({vertex})")
    assert np.abs(np.array(window("Array.from(design.scene.startPositions)")).reshape(-1, 3) - start).max() < 1e-6
    window.do("design.send('undo')")


def test_an_engine_killed_while_a_vertex_is_pulled_comes_back(window: Window, served: Served) -> None:
    start, vertex = window.positions(), window.inner_vertex()
    window.begin_drag(vertex, 0, -40)
    window.wait("design.store.frame.count > 0")
    served.kill_engine()
    window.wait("['LOST', 'RESTORING'].includes(design.store.state.state)")
    assert "engine" in window.page.inner_text("#banner")
    window.page.mouse.up()
    window.ready()
    assert window.page.is_hidden("#banner")
    assert (window.positions() == start).all()  # the last settled shape
    window.reset()
    window.begin_drag(vertex, 0, -30)  # and it works again
    window.end_drag()
    assert np.abs(window.positions() - start).max() > 0.1
    window.do("design.send('undo')")


def test_a_lost_connection_is_a_sentence_and_comes_back(window: Window) -> None:
    window("design.connection.socket.close()")
    window.wait("!document.getElementById('banner').hidden")
    assert "connect" in window.page.inner_text("#banner").lower()
    window.wait("design.store.connection.kind === 'open'")
    window.ready()
    assert window.page.is_hidden("#banner")


def test_it_works_behind_a_path(open_window: Callable[..., Window], served: Served) -> None:
    window = open_window(served.url.replace("/#", "/proxy/8888/#"))
    assert window("design.scene.mesh.numVertices") == 108
