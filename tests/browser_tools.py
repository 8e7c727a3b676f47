"""A served design and a page of it in a real browser, for the tests of the page."""

from __future__ import annotations

import io
import math
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from torchfair import Topology

FLAGS = [
    "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-background-networking",
    "--disable-component-update", "--disable-sync", "--no-first-run",
]  # fmt: skip
PATIENCE = 60.0  # seconds until a wait is given up


def chromium() -> str | None:
    """The browser of the machine; None if there is none."""
    found = (shutil.which(name) for name in ("chromium", "chromium-browser", "google-chrome"))
    return next((path for path in found if path), None)


def hall(columns: int = 12, rows: int = 9) -> tuple[torch.Tensor, Topology]:
    """A wavy roof, quads on its one half and triangles on the other, far from the origin."""
    x, y = torch.meshgrid(torch.arange(columns).double(), torch.arange(rows).double(), indexing="ij")
    height = 1.2 * torch.sin(0.5 * x) * torch.cos(0.35 * y) + 0.03 * torch.sin(9 * x + 5 * y)
    vertices = torch.stack([x, y, height], dim=-1).reshape(-1, 3) + torch.tensor([2500.0, -1200.0, 40.0])
    faces: list[list[int]] = []
    for i in range(columns - 1):
        for j in range(rows - 1):
            quad = [i * rows + j, (i + 1) * rows + j, (i + 1) * rows + j + 1, i * rows + j + 1]
            faces += [quad] if i < columns // 2 else [quad[:3], [quad[0], *quad[2:]]]
    return vertices, Topology.from_faces(faces)


class Served:
    """``torchfair design`` in a process of its own, in a folder."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.folder = folder
        command = [sys.executable, "-m", "torchfair", "design", *arguments, "--no-browser"]
        self.log = (folder / "log.txt").open("w")
        self.process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=self.log, text=True)
        assert self.process.stdout is not None
        found = re.search(r"http://\S+", self.process.stdout.readline())
        assert found, (folder / "log.txt").read_text()
        self.url = found.group()

    def engine(self) -> int:
        """Process of the engine."""
        pid = self.process.pid
        for child in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
            words = Path(f"/proc/{child}/cmdline").read_bytes()
            if b"spawn_main" in words:
                return int(child)
        raise AssertionError("the server has no engine")

    def kill_engine(self) -> None:
        os.kill(self.engine(), signal.SIGKILL)

    def stop(self) -> None:
        self.process.send_signal(signal.SIGINT)
        with suppress(subprocess.TimeoutExpired):
            self.process.wait(10)
        self.process.kill()
        self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()
        self.log.close()


class Window:
    """A page of a served design. What went wrong in it is kept in ``faults``, what it asked for in ``requests``."""

    def __init__(self, browser: Any, url: str, *, ready: bool = True, **settings: Any) -> None:
        self.page = browser.new_context(**{"viewport": {"width": 900, "height": 640}, **settings}).new_page()
        self.faults: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", self._said)
        self.page.on("pageerror", lambda error: self.faults.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(url)
        if ready:
            self.ready()

    def _said(self, message: Any) -> None:
        if message.type in ("error", "warning"):
            self.faults.append(message.text)

    def check(self, served: Served) -> None:
        """Nothing has gone wrong in it, and nothing came from elsewhere."""
        assert self.faults == []
        assert [url for url in self.requests if not url.startswith(served.url.split("#")[0])] == []

    def reset(self) -> None:
        """Everything as in a new window, but for the mesh."""
        self.page.keyboard.press("Escape")
        for script in (
            "design.store.put({ look: 'mirror', tool: 'pull', lines: true, sphere: true, hover: null })",
            "design.selection.clear()",
            "document.getElementById('notices').replaceChildren()",
            "design.flights.arrive({ around: -1, up: 0.6 })",
            "design.flights.arrive(design.flights.whole())",
            "design.scene.view.orthographic && design.flights.parallel()",
        ):
            self(script)
        self.drawn()

    def ready(self) -> None:
        self.wait("design.store.frame && design.store.state.state === 'READY' && design.scene.frames > 0")

    def __call__(self, script: str) -> Any:
        """What a script says; ``design`` is the page."""
        return self.page.evaluate(f"(() => {{ const design = window.design; return {script}; }})()")

    def wait(self, script: str) -> Any:
        """Until a script says something true."""
        end = time.monotonic() + PATIENCE
        while not (said := self(f"design && ({script})")):
            if time.monotonic() > end:
                state = self("JSON.stringify([design.store.state.state, design.store.connection])")
                raise AssertionError(f"never came true: {script}; the page: {state} {self.faults} {self.notices()}")
            self.page.wait_for_timeout(20)
        return said

    def open(self, source: str) -> None:
        """Opens a mesh or session of the folder as it is there, without edits of before that were not saved."""
        before, asking = self("design.store.frame.number"), "document.getElementById('asking').open"
        self(f"design.send('open', {{ source: {source!r} }})")
        self.wait(f"design.store.frame.number > {before} || {asking}")
        if self(asking):
            self.page.click("#asking button[value=file]")
            self.wait(f"design.store.frame.number > {before}")
        self.ready()

    def drawn(self) -> None:
        """Until what was changed is in the picture."""
        before = self("(design.scene.invalidate(), design.scene.frames)")
        self.wait(f"design.scene.frames > {before}")

    def at_rest(self) -> None:
        self.wait("design.store.state.state === 'READY' && design.store.frame.rest && design.store.numbers.rest")

    def do(self, script: str, *, until: str = "true") -> None:
        """Runs a script that makes the mesh change, and waits until it rests again."""
        before = self("design.store.frame.number")
        self(script)
        self.wait(f"design.store.frame.number > {before} && ({until})")
        self.at_rest()

    def notices(self) -> list[str]:
        return [notice.inner_text() for notice in self.page.locator(".notice span").all()]

    def positions(self) -> NDArray[np.float32]:
        """(V, 3) positions on the screen, from the origin of the topology."""
        return np.array(self("Array.from(design.scene.mesh.positions)"), dtype=np.float32).reshape(-1, 3)

    def place(self, vertex: int) -> tuple[float, float]:
        """Where a vertex is seen in the window."""
        x, y, _ = self(f"design.scene.view.project(design.scene.mesh.point({vertex}))")
        left, top = self("[design.scene.canvas.getBoundingClientRect()].flatMap((box) => [box.left, box.top])")
        return left + x, top + y

    def inner_vertex(self) -> int:
        """A vertex that is seen, near the middle of the picture and off the boundary."""
        width, height = self("[design.scene.view.width, design.scene.view.height]")
        seen = self(
            "[...design.store.boundary.keys()].filter((v) => !design.store.boundary[v])"
            ".map((v) => [v, ...design.scene.view.project(design.scene.mesh.point(v))])"
            ".filter(([v, x, y]) => design.picker.at(x, y).vertex === v)"
        )
        return int(min(seen, key=lambda row: math.hypot(row[1] - width / 2, row[2] - height / 2))[0])

    def begin_drag(self, vertex: int, across: float, down: float, steps: int = 6) -> None:
        """Presses the mouse on a vertex and moves it by some pixels; it stays pressed."""
        x, y = self.place(vertex)
        self.page.mouse.move(x, y)
        self.page.mouse.down()
        self.page.mouse.move(x + across, y + down, steps=steps)
        self.wait("design.store.state.state === 'DRAGGING'")

    def end_drag(self) -> None:
        self.page.mouse.up()
        self.at_rest()

    def picture(self) -> NDArray[np.float64]:
        """(H, W, 3) pixels of the mesh alone, 0 to 255."""
        from PIL import Image

        box = self.page.locator("#canvas").bounding_box()
        return np.asarray(Image.open(io.BytesIO(self.page.screenshot(clip=box))).convert("RGB"), dtype=float)


@contextmanager
def opened_browser() -> Iterator[Any]:
    """A browser; it is closed before the next module, since the loop of playwright forbids others in its thread."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=chromium(), args=FLAGS)
        yield browser
        browser.close()
