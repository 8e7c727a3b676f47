"""Vertices pulled with a real mouse: the mesh answers, and what is chosen is what was meant."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from browser_tools import Window

pytestmark = pytest.mark.browser


def gone(window: Window, vertex: int, start: np.ndarray) -> np.ndarray:
    """How far a vertex has gone from where it was, in mean edges, (3,)."""
    return (window.positions()[vertex] - start[vertex]) / window("design.store.topology.mean_edge")


def test_a_hovered_vertex_is_marked_with_its_number_and_its_pyramid(window: Window) -> None:
    vertex = window.inner_vertex()
    window.page.mouse.move(*window.place(vertex))
    window.wait(f"design.store.hover === {vertex}")
    assert window.page.inner_text("#tag") == f"vertex {vertex} ({vertex + 1} in the file)"  # OBJ counts from 1
    marks = window(
        "design.scene.gauss.lines.object.geometry.getAttribute('mark').array.filter((mark) => mark > 0).length"
    )
    assert marks == window(f"design.scene.mesh.starEdges({vertex}).length")
    window.page.mouse.move(*window.place(vertex)[:1], 60)
    window.wait("design.store.hover === null")
    assert window.page.is_hidden("#tag")


def test_a_drag_moves_the_handle_and_settles_where_it_was_put(window: Window) -> None:
    vertex, start, energy = window.inner_vertex(), window.positions(), window("design.store.numbers.E")
    x, y = window.place(vertex)
    window.begin_drag(vertex, 12, -40)
    window.wait("design.store.frame.count > 0")
    window.end_drag()
    edge, target = window("design.store.topology.mean_edge"), np.array(window(f"design.store.handles.get({vertex})"))
    assert np.abs(np.array(window.place(vertex)) - [x + 12, y - 40]).max() < 2  # under the mouse
    assert np.linalg.norm(target - start[vertex]) > 0.3 * edge
    assert np.linalg.norm(window.positions()[vertex] - target) < 0.05 * edge
    assert window("design.store.numbers.E") != pytest.approx(energy, rel=1e-3)
    assert window(f"design.store.handles.has({vertex})")
    plot = window("design.store.plot")
    assert len(plot) > 3
    assert all(a[0] <= b[0] for a, b in pairwise(plot))
    shift = gone(window, vertex, start)  # in the plane of the picture
    assert abs(shift @ np.array(window("design.scene.view.forward"))) < 0.05 * np.linalg.norm(shift)
    window.do("design.send('undo')")
    assert (window.positions() == start).all()


def test_escape_puts_everything_back(window: Window) -> None:
    vertex, start = window.inner_vertex(), window.positions()
    window.begin_drag(vertex, -20, -30)
    window.wait("design.store.frame.count > 0")
    window.page.keyboard.press("Escape")
    window.wait("design.store.state.state === 'READY'")
    window.page.mouse.up()
    window.at_rest()
    assert (window.positions() == start).all()
    assert not window(f"design.store.handles.has({vertex})")


def test_an_axis_key_locks_the_pull(window: Window) -> None:
    vertex, start = window.inner_vertex(), window.positions()
    window.begin_drag(vertex, 15, -30)
    window.page.keyboard.press("z")
    x, y = window.place(vertex)
    window.page.mouse.move(x + 4, y - 25, steps=3)
    window.end_drag()
    shift = gone(window, vertex, start)
    assert abs(shift[2]) > 0.1
    assert np.abs(shift[:2]).max() < 0.05
    window.do("design.send('undo')")


def test_an_arrow_pulls_several_vertices_together(window: Window) -> None:
    first = window.inner_vertex()
    second = first + 2
    start = window.positions()
    for vertex, keys in ((first, []), (second, ["Shift"])):
        window.page.mouse.move(*window.place(vertex))
        for key in keys:
            window.page.keyboard.down(key)
        window.page.mouse.click(*window.place(vertex))
        for key in keys:
            window.page.keyboard.up(key)
        window.wait(f"design.store.selection.has({vertex})")
    assert window("design.store.selection.size") == 2
    window.drawn()
    tip = window(
        "(() => { const m = design.handles.middle(); m[2] += 50 * design.gizmo.unit(m);"
        " const p = design.scene.view.project(m), b = design.scene.canvas.getBoundingClientRect();"
        " return [b.left + p[0], b.top + p[1]]; })()"
    )
    window.page.mouse.move(*tip)
    window.wait("design.scene.canvas.dataset.over === 'axis'")
    window.page.mouse.down()
    window.page.mouse.move(tip[0] + 20, tip[1] - 35, steps=5)
    window.wait("design.store.state.state === 'DRAGGING'")
    window.end_drag()
    one, other = gone(window, first, start), gone(window, second, start)
    assert one[2] > 0.1
    assert np.abs(one - other).max() < 0.1
    assert np.abs(one[:2]).max() < 0.05
    window.do("design.send('undo')")


def test_typed_coordinates_are_those_of_the_file(window: Window) -> None:
    vertex, start = window.inner_vertex(), window.positions()
    window.page.mouse.click(*window.place(vertex))
    window.wait(f"design.store.selection.has({vertex})")
    shown = [float(window.page.input_value(f"#place [name={axis}]")) for axis in "xyz"]
    origin = np.array(window("design.store.topology.origin"))
    assert np.allclose(shown, start[vertex] + origin, atol=1e-3)
    window.page.fill("#place [name=z]", f"{shown[2] + 0.5:.4f}")
    before = window("design.store.frame.number")
    window.page.click("#place button")
    window.wait(f"design.store.frame.number > {before}")
    window.at_rest()
    assert np.abs(window.positions()[vertex] + origin - [*shown[:2], shown[2] + 0.5]).max() < 0.05
    window.page.fill("#place [name=x]", "far")
    window.page.click("#place button")
    assert "not a number" in window.notices()[-1]
    window.do("design.send('undo')")


def test_fixed_vertices_stay_and_freed_ones_do_not(window: Window) -> None:
    vertex = window.inner_vertex()
    window.page.mouse.click(*window.place(vertex))
    window.wait(f"design.store.selection.has({vertex})")
    window.page.keyboard.press("f")
    window.wait(f"design.store.held.has({vertex})")
    start = window.positions()
    window.page.keyboard.press("Escape")  # without arrows in the way
    window.begin_drag(vertex + 1, 0, -30)
    window.end_drag()
    assert np.linalg.norm(gone(window, vertex, start)) < 0.05
    window.wait("design.can('free')")
    window.page.click("[data-action=freeAll]")
    window.wait("design.store.held.size === 0 && design.store.handles.size === 0")
    window.at_rest()


def test_a_box_and_a_loop_choose_what_is_seen_inside(window: Window) -> None:
    places = {v: window.place(v) for v in range(108)}
    box = window.page.locator("#canvas").bounding_box()
    left, top, right, low = box["x"] + 240, box["y"] + 140, box["x"] + 420, box["y"] + 330
    expected = {v for v, (x, y) in places.items() if left < x < right and top < y < low}
    window.page.click("#through")
    for tool, corners in (("b", [(right, low)]), ("l", [(right, top), (right, low), (left, low), (left, top)])):
        window.page.focus("#canvas")
        window.page.keyboard.press(tool)
        window.page.mouse.move(left, top)
        window.page.mouse.down()
        for corner in corners:
            window.page.mouse.move(*corner, steps=4)
        window.page.mouse.up()
        window.wait("design.store.selection.size > 0")
        assert set(window("[...design.store.selection]")) == expected
        window.page.keyboard.press("Escape")
        window.wait("design.store.selection.size === 0")
    window.page.click("#through")


def test_hidden_vertices_are_not_chosen_unless_it_reaches_through(window: Window) -> None:
    window("design.flights.arrive({ up: 0.05 }), design.flights.arrive(design.flights.whole())")
    window.drawn()
    seen, all_of_them = (set(window(f"design.picker.inside(() => true, {through})")) for through in ("false", "true"))
    assert len(all_of_them) == 108
    assert 0 < len(seen) < 108


def test_the_menu_of_a_vertex_opens_by_the_right_button(window: Window) -> None:
    vertex = window.inner_vertex()
    window.page.mouse.move(*window.place(vertex))
    window.page.mouse.click(*window.place(vertex), button="right")
    window.wait("!document.getElementById('menu').hidden")
    assert window.page.inner_text("#menu b") == f"Vertex {vertex}"
    window.page.click("#menu button >> nth=0")
    window.wait(f"design.store.held.has({vertex})")
    window.do("design.send('undo')", until=f"!design.store.held.has({vertex})")


def test_dragging_elsewhere_turns_and_the_wheel_comes_closer(window: Window) -> None:
    box = window.page.locator("#canvas").bounding_box()
    x, y = box["x"] + box["width"] - 12, box["y"] + 30
    before = window("[design.scene.view.around, design.scene.view.distance]")
    window.page.mouse.move(x, y)
    window.page.mouse.down()
    window.page.mouse.move(x - 60, y + 20, steps=3)
    window.page.mouse.up()
    window.page.mouse.wheel(0, -200)
    window.wait(f"design.scene.view.distance < {before[1]}")
    assert window("design.scene.view.around") == pytest.approx(before[0] + 60 * 0.006)
