"""The page opens in a real browser under its policy, says what is wrong, and fits a phone."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from browser_tools import Served, Window

pytestmark = pytest.mark.browser

OpenWindow = Callable[..., Window]
ROOT = Path(__file__).resolve().parents[3]


def test_it_draws_the_mesh_and_rests(window: Window) -> None:
    assert window("[design.scene.mesh.numVertices, design.store.topology.vertices]") == [108, 108]
    assert window.page.inner_text("#size") == "108 vertices · 128 faces"
    assert "torchfair design" not in window.page.title()
    assert window.picture().std() > 10  # not one colour
    window.wait("design.store.numbers.rest")
    window.drawn()
    frames = window("design.scene.frames")
    time.sleep(0.5)
    assert window("design.scene.frames") <= frames + 1  # nothing is drawn while nothing moves


def test_every_look_draws_something_else(window: Window) -> None:
    seen: list[bytes] = []
    for look in window("[...document.querySelectorAll('#looks button')].map((button) => button.dataset.look)"):
        window.page.click(f"#looks [data-look={look}]")
        window.wait(f"design.store.look === '{look}'")
        watch = {"stars": "stars", "deviation": "deviation", "planarity": "planarity"}.get(look)
        if watch:
            window.wait(f"design.store.views.{watch}")
        window.drawn()
        seen.append(window.picture().tobytes())
    assert len(set(seen)) == len(seen) == 8


def test_legends_have_numbers(window: Window) -> None:
    window.page.click("#looks [data-look=edges]")
    window.wait("document.querySelector('#legend .ends')")
    ends = [float(text) for text in window.page.locator("#legend .ends span").all_inner_texts()]
    assert ends[0] == 0
    assert ends[1] == pytest.approx(ends[2] / 2, rel=0.01)
    assert 0.2 < ends[2] / window("design.store.numbers.worst[0].value") < 1.1
    window.page.click("#looks [data-look=stars]")
    window.wait("document.querySelector('#legend .class')")
    counts = window.page.locator("#legend .class output").all_inner_texts()
    boundary = window("design.store.boundary.reduce((sum, b) => sum + b, 0)")
    assert str(boundary) in counts


def test_it_runs_under_a_policy_that_forbids_inline_scripts(window: Window) -> None:
    assert window.page.evaluate(
        "() => { const script = document.createElement('script'); script.textContent = 'window.inline = 1';"
        " document.body.append(script); return window.inline === undefined; }"
    )
    assert any("inline" in fault for fault in window.faults)
    window.faults.clear()


def test_a_wrong_token_is_a_sentence(open_window: OpenWindow, served: Served) -> None:
    window = open_window(served.url.split("#")[0] + "#token=wrong", ready=False)
    window.wait("!document.getElementById('failure').hidden")
    assert "token" in window.page.inner_text("#failure")
    window.faults.clear()


def test_a_browser_without_webgl_is_told_so(browser: object, served: Served, open_window: OpenWindow) -> None:
    window = open_window(ready=False)
    window.page.add_init_script(
        "const make = HTMLCanvasElement.prototype.getContext; HTMLCanvasElement.prototype.getContext ="
        " function (kind, ...more) { return kind.startsWith('webgl') ? null : make.call(this, kind, ...more); };"
    )
    window.page.reload()
    window.page.wait_for_selector("#failure:not([hidden])")
    assert "WebGL 2" in window.page.inner_text("#failure")


def test_a_lost_context_is_a_sentence_and_comes_back(window: Window) -> None:
    before = window.picture()
    window("window.loss = design.scene.renderer.getContext().getExtension('WEBGL_lose_context'), loss.loseContext()")
    window.wait("!document.getElementById('banner').hidden")
    assert "graphics" in window.page.inner_text("#banner")
    window("loss.restoreContext()")
    window.wait("document.getElementById('banner').hidden")
    window.drawn()
    assert abs(window.picture() - before).mean() < 1
    window.faults.clear()  # three.js reports the loss


def test_a_file_that_cannot_be_read_is_a_sentence(window: Window, tmp_path: Path) -> None:
    bad = tmp_path / "bad.obj"
    bad.write_text("v 1 2 nonsense\n")
    before = window.positions()
    window.page.set_input_files("#file", bad)
    window.wait("document.querySelector('.notice.error')")
    assert "bad.obj" in window.notices()[-1]
    window.ready()
    assert (window.positions() == before).all()


def test_the_list_of_keys_is_that_of_the_documentation(window: Window) -> None:
    window.page.keyboard.press("?")
    window.wait("document.getElementById('help').open")
    rows = window.page.locator("#keys tr")
    shown = {(row.locator("th").inner_text(), row.locator("td").inner_text()) for row in rows.all()}
    text = (ROOT / "docs" / "design.md").read_text(encoding="utf-8")
    lines = [re.split(r"(?<!\\)\|", line)[1:3] for line in text.splitlines() if line.startswith("| `")]
    assert {(key.strip().strip("`"), words.strip().replace("\\|", "|")) for key, words in lines} == shown
    window.page.keyboard.press("Escape")


def test_it_fits_a_phone(open_window: OpenWindow) -> None:
    window = open_window(viewport={"width": 390, "height": 780}, has_touch=True, is_mobile=True)
    root = "document.documentElement"
    assert window(f"{root}.scrollWidth <= innerWidth && {root}.scrollHeight <= innerHeight")
    assert window("design.scene.canvas.clientHeight > innerHeight / 2")  # the panel is away at first
    window.page.tap("[data-action=panel]")
    window.wait("document.getElementById('panel').offsetHeight > 100")
    assert window("design.scene.canvas.clientHeight > innerHeight / 4")
    vertex = window.inner_vertex()
    window.page.touchscreen.tap(*window.place(vertex))
    window.wait(f"design.store.selection.has({vertex})")


def test_colours_follow_the_system_and_the_button(open_window: OpenWindow) -> None:
    window = open_window(color_scheme="dark")
    assert window("document.documentElement.dataset.scheme") == "dark"
    corner = window.picture()[2, -2]
    assert corner.max() < 60
    window.page.keyboard.press("d")
    window.wait("document.documentElement.dataset.scheme === 'light'")
    window.drawn()
    assert window.picture()[2, -2].min() > 200


def test_two_fingers_pinch_and_a_long_press_opens_the_menu(open_window: OpenWindow) -> None:
    window = open_window(viewport={"width": 600, "height": 700}, has_touch=True, is_mobile=True)
    fingers = window.page.context.new_cdp_session(window.page)
    box = window.page.locator("#canvas").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + 60

    def touch(kind: str, *places: tuple[float, float]) -> None:
        points = [{"x": px, "y": py, "id": k} for k, (px, py) in enumerate(places)]
        fingers.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    start = window("[design.scene.view.distance, design.scene.view.around]")
    touch("touchStart", (x - 40, y), (x + 40, y))
    touch("touchMove", (x - 80, y), (x + 80, y))
    touch("touchEnd")
    window.wait(f"design.scene.view.distance < 0.7 * {start[0]}")
    assert window("design.scene.view.around") == start[1]
    assert window("design.handles.pull === null && design.store.handles.size === 0")

    vertex = window.inner_vertex()
    touch("touchStart", window.place(vertex))
    window.wait("!document.getElementById('menu').hidden")
    touch("touchEnd")
    assert window.page.inner_text("#menu b") == f"Vertex {vertex}"
