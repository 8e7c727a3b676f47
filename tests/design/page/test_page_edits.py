"""Modes, weights, choices, subdivision, meshing, undo, files: each by the control that a designer uses."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from browser_tools import Window

from torchfair.io import load_mesh

pytestmark = pytest.mark.browser


@pytest.fixture
def hall_window(window: Window) -> Window:
    """The mesh as it was opened, whatever tests before did."""
    if window("design.store.state.undo > 0 || design.store.topology.vertices !== 108"):
        window.open("hall.obj")
    window("document.querySelectorAll('#panel details').forEach((details) => { details.open = true; })")
    return window


def lift(window: Window, height: float = 0.6) -> int:
    vertex = window.inner_vertex()
    x, y, z = window(f"design.scene.mesh.point({vertex}).map((x, i) => x + design.store.topology.origin[i])")
    window.do(f"design.send('move', {{ places: [[{vertex}, {x}, {y}, {z + height}]], release: true }})")
    return vertex


def test_undo_and_redo_are_equal_to_the_bit(hall_window: Window) -> None:
    window, shapes = hall_window, []
    for _ in range(3):
        shapes.append(window.positions())
        lift(window)
    last = window.positions()
    assert window.page.is_disabled("[data-action=redo]")
    for shape in reversed(shapes):
        before = window("design.store.frame.number")
        window.page.click("[data-action=undo]")
        window.wait(f"design.store.frame.number > {before}")
        window.at_rest()
        assert (window.positions() == shape).all()
    assert window.page.is_disabled("[data-action=undo]")
    for _ in range(3):
        before = window("design.store.frame.number")
        window.page.keyboard.press("Control+Shift+Z")
        window.wait(f"design.store.frame.number > {before}")
        window.at_rest()
    assert (window.positions() == last).all()


def test_a_slider_of_a_weight_acts_on_the_running_solve(hall_window: Window) -> None:
    window = hall_window
    lift(window)
    slider, before = window.page.locator("[data-weight=fairness]"), window.positions()
    number = "Number(document.querySelector('[data-weight=fairness]').nextElementSibling.value)"
    weight, frame = window(number), window("design.store.frame.number")
    slider.focus()
    for _ in range(4):
        window.page.keyboard.press("PageUp")
    window.wait(f"design.store.frame.number > {frame}")
    window.at_rest()
    assert window(number) > 2 * weight
    assert np.abs(window.positions() - before).max() > 1e-3
    while (window.positions() != before).any():  # each step of the slider is an edit
        steps = window("design.store.state.undo")
        assert steps > 1
        window.page.click("[data-action=undo]")
        window.wait(f"design.store.state.undo < {steps}")
        window.at_rest()


def test_choices_and_modes_are_those_of_the_engine(hall_window: Window) -> None:
    window = hall_window
    select = window.page.locator("[data-choice=boundary]")
    values = select.locator("option").evaluate_all("(options) => options.map((option) => option.value)")
    now = select.input_value()
    other = next(value for value in values if value != now)
    select.select_option(other)
    window.wait(f"design.store.settings.choices.find(({{ name }}) => name === 'boundary').value === {other!r}")
    window.ready()
    modes = window("design.store.state.modes")
    assert {mode["mode"] for mode in modes} == {"fair", "form", "symmetric"}
    for mode in modes:
        button = window.page.locator("#modes button", has_text=mode["mode"])
        assert button.is_disabled() == bool(mode["refused"])
    window.page.click("#modes button:has-text('form')")
    window.wait("design.store.state.mode === 'form' && design.store.settings.mode === 'form'")
    assert window.page.get_attribute("#modes button:has-text('form')", "aria-checked") == "true"


def test_subdividing_keeps_handles_and_can_be_undone(hall_window: Window) -> None:
    window = hall_window
    lift(window)
    before, handles = window.positions(), window("design.store.handles.size")
    window.page.click("[data-action=subdivide]")
    window.wait("design.store.topology.vertices > 108")
    window.at_rest()
    assert window("design.store.topology.faces") > 4 * 128 * 0.9
    assert window("design.store.handles.size") == handles
    assert window("design.scene.mesh.numVertices") == window("design.store.topology.vertices")
    window.page.click("[data-action=undo]")
    window.wait("design.store.topology.vertices === 108")
    window.at_rest()
    assert (window.positions() == before).all()


def test_the_surface_becomes_quads(hall_window: Window) -> None:
    window = hall_window
    window.page.fill("#remesh [name=count]", "90")
    window.page.click("#remesh [value=quads]")
    window.wait("design.store.topology.vertices !== 108 || document.querySelector('.notice.error')")
    window.at_rest()
    sizes = window("[...design.scene.mesh.starts].slice(1).map((end, i) => end - design.scene.mesh.starts[i])")
    assert window.page.locator(".notice.error").count() == 0, window.notices()
    assert sizes.count(4) > 0.6 * len(sizes)  # the rest are along the boundary
    assert 45 < len(sizes) < 180


def test_what_is_saved_is_what_is_seen(hall_window: Window, folder: Path) -> None:
    window = hall_window
    lift(window)
    window.page.select_option("#download [name=format]", "obj")
    window.page.fill("#download [name=name]", "lifted.obj")
    window.page.click("#download [value=folder]")
    window.wait("document.getElementById('notices').textContent.includes('lifted.obj')")
    mesh = load_mesh(folder / "lifted.obj")
    seen = window.positions() + np.array(window("design.store.topology.origin"))
    assert np.abs(mesh.vertices.numpy() - seen).max() < 1e-4
    assert mesh.topology.num_faces == 128
    window.page.click("#download [value=folder]")  # there is one now
    window.wait("document.getElementById('asking').open")
    window.page.click("#asking button >> nth=0")
    window.wait("document.getElementById('notices').lastChild.textContent.includes('is saved')")
    assert not window("document.getElementById('asking').open")


def test_a_session_is_saved_and_opened_again(hall_window: Window, tmp_path: Path) -> None:
    window = hall_window
    vertex = lift(window)
    shape, handles = window.positions(), window(f"design.store.handles.get({vertex})")
    window("design.flights.arrive({ around: 0.4, up: 0.3 })")
    eye = window("design.scene.view.eye")
    with window.page.expect_download() as saved:
        window.page.keyboard.press("Control+s")
    path = tmp_path / saved.value.suggested_filename
    saved.value.save_as(path)
    window.open("hall.obj")
    assert np.abs(window.positions() - shape).max() > 0.1
    before = window("design.store.frame.number")
    window.page.set_input_files("#file", path)
    window.wait(f"design.store.frame.number > {before}")
    window.ready()
    assert (window.positions() == shape).all()
    assert np.allclose(window(f"design.store.handles.get({vertex})"), handles)
    assert np.allclose(window("design.scene.view.eye"), eye, atol=1e-3)
    assert window("design.store.state.undo") >= 1  # with its history
    window.page.click("[data-action=undo]")
    window.wait("design.store.handles.size === 0")


def test_the_command_line_is_shown(hall_window: Window) -> None:
    lift(hall_window)
    hall_window.page.click("[data-action=commandLine]")
    hall_window.wait("!document.getElementById('command').hidden")
    assert hall_window.page.inner_text("#command").startswith("torchfair ")
    assert "--handle" in hall_window.page.inner_text("#command")


def test_a_screenshot_has_twice_the_size(hall_window: Window, tmp_path: Path) -> None:
    from PIL import Image

    with hall_window.page.expect_download() as saved:
        hall_window.page.keyboard.press("Shift+S")
    saved.value.save_as(tmp_path / "shot.png")
    picture = Image.open(tmp_path / "shot.png")
    width, height = hall_window("[design.scene.view.width, design.scene.view.height]")
    assert picture.size == (2 * width, 2 * height)
    assert np.asarray(picture.convert("RGB")).std() > 10
    hall_window.drawn()
    assert hall_window("design.scene.canvas.width") == width


def test_worst_edges_are_flown_to(hall_window: Window) -> None:
    window = hall_window
    worst = window("design.store.numbers.worst")
    assert [edge["value"] for edge in worst] == sorted((edge["value"] for edge in worst), reverse=True)
    assert window.page.locator("#worst li").count() == len(worst) > 0
    window.page.click("#worst button >> nth=0")
    a, b = (np.array(window(f"design.scene.mesh.point({vertex})")) for vertex in worst[0]["vertices"])
    target = ((a + b) / 2).tolist()
    window.wait(f"Math.hypot(...design.scene.view.target.map((x, i) => x - {target}[i])) < 1e-3")
