"""Pause, settle, stop, labels by clicks, strips, and a page that does not move by itself."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from browser_tools import Window

from torchfair.io import save_mesh
from torchfair.principal import principal_edges_of_lattice
from torchfair.shapes import Catenoid, principal_triangles

pytestmark = pytest.mark.browser


@pytest.fixture
def tube_window(window: Window, folder: Path) -> Window:
    """A tube of principal-symmetric triangles with its principal edges."""
    mesh = principal_triangles(Catenoid(1.0, (-1.0, 1.0)), 6, 12)
    lines = principal_edges_of_lattice(mesh).polylines()
    save_mesh(folder / "tube.obj", mesh.vertices, mesh.topology, polylines=lines, overwrite=True)
    window.open("tube.obj")
    window("document.querySelectorAll('#panel details').forEach((details) => { details.open = true; })")
    return window


@pytest.fixture
def hall_window(window: Window) -> Window:
    window.open("hall.obj")
    window("document.querySelectorAll('#panel details').forEach((details) => { details.open = true; })")
    return window


def test_nothing_moves_while_it_is_paused(hall_window: Window) -> None:
    window = hall_window
    before = window.positions()
    window.page.keyboard.press("p")
    window.wait("design.store.state.paused")
    assert window.page.get_attribute("[data-action=pause]", "aria-pressed") == "true"
    window.begin_drag(window.inner_vertex(), 30, -40)
    window.page.wait_for_timeout(400)
    assert (window.positions() == before).all()
    frame = window("design.store.frame.number")
    window.page.keyboard.press("p")
    window.wait(f"!design.store.state.paused && design.store.frame.number > {frame}")
    window.end_drag()
    assert np.abs(window.positions() - before).max() > 0.05


def test_a_whole_job_is_stopped_and_can_be_undone(hall_window: Window) -> None:
    window = hall_window
    before = window.positions()
    window("window.before = Array.from(design.scene.mesh.positions)")
    window.page.click("[data-action=solve]")
    window.wait(  # the first frame of a job has not moved
        "design.store.state.state === 'RUNNING' && window.before.some((x, k) => x !== design.scene.mesh.positions[k])"
    )
    window.page.click("[data-action=stop]")
    window.at_rest()
    assert window("design.store.numbers.status") == "stopped"
    assert window("design.store.state.undo") == 1
    assert (window.positions() != before).any()
    window.page.click("[data-action=undo]")
    window.wait("design.store.state.undo === 0")
    window.at_rest()
    assert (window.positions() == before).all()


def test_enter_settles(hall_window: Window) -> None:
    window = hall_window
    energy = window("design.store.numbers.E")
    window.page.keyboard.press("Enter")
    window.wait("design.store.state.undo === 1")
    window.at_rest()
    assert window("design.store.numbers.E") < energy


def test_a_click_on_an_edge_marks_it_as_principal(tube_window: Window) -> None:
    window = tube_window
    window("design.store.put({ look: 'principal' })")
    window.drawn()
    vertex = window.inner_vertex()
    edge, other = window(
        f"((e) => [e, [0, 1].map((k) => design.scene.mesh.edges[2 * e + k]).find((v) => v !== {vertex})])"
        f"([...design.scene.mesh.starEdges({vertex})].find((e) => !(design.store.labels[e] & 1)))"
    )
    (x, y), (u, v) = window.place(vertex), window.place(other)
    marked = f"(design.store.labels[{edge}] & 1)"
    for wanted in (1, 0):
        window.page.mouse.click(0.5 * (x + u), 0.5 * (y + v))
        window.wait(f"{marked} === {wanted}")
        window.at_rest()
        assert window(marked) == wanted


def test_strips_are_laid_flat_and_saved(tube_window: Window, tmp_path: Path) -> None:
    window = tube_window
    window.page.click("[data-action=strips]")
    window.wait("document.getElementById('unrolled').open")
    drawn = window.page.locator("#unrolled svg polygon").count()
    sentence = window.page.inner_text("#unrolled p")
    assert sentence.startswith(f"{drawn} strips")
    assert drawn > 5
    box = window("document.querySelector('#unrolled svg').getBoundingClientRect().width")
    assert box > 100
    with window.page.expect_download() as download:
        window.page.click("#unrolled [data-action=saveStrips]")
    download.value.save_as(tmp_path / "strips.svg")
    shapes = [
        e for e in ElementTree.parse(tmp_path / "strips.svg").iter() if e.tag.rpartition("}")[2] in ("path", "polygon")
    ]
    assert len(shapes) >= drawn
    window.page.keyboard.press("Escape")
    window.wait("!document.getElementById('unrolled').open")


@pytest.mark.parametrize("motion", ["reduce", "no-preference"])
def test_flights_arrive_at_once_where_less_motion_is_wished(open_window: Callable[..., Window], motion: str) -> None:
    window = open_window(reduced_motion=motion)
    window.open("hall.obj")
    at_once = window(
        "(() => { const goal = design.flights.whole(); design.flights.arrive({ ...goal, target: [9, 9, 9] });"
        " design.flights.to(goal);"
        " return design.scene.view.state.target.every((x, i) => Math.abs(x - goal.target[i]) < 1e-9); })()"
    )
    assert at_once is (motion == "reduce")
    window.wait("Math.abs(design.scene.view.state.target[0] - 9) > 1e-3")
