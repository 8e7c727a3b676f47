"""The page of `torchfair design`: script of a frame and of a look under the pointer, in Chromium with software GL.

Run ``python benchmarks/bench_design_page.py [--vertices 500 2000 8000 50000] [--json FILE]`` (extras ``design`` and
``browser``, and a Chromium).

A wavy grid of quads is opened, and the last frame that the engine sent is given to the page again and again, its
positions moved by a thousandth each time, as a drag would. Printed are milliseconds of script: to take a frame in
(``receive``), to draw it (``draw``, without the time of the GPU, which is none here), and to find what is under the
pointer after the view has changed (``pick``). ``least`` is what the script takes, ``median`` what it took on this
machine, ``first`` the cold one after opening. Targets: receive and draw together below 5 ms up to 8000 vertices, a pick
below 5 ms up to 50 000.
"""

from __future__ import annotations

import argparse
import json
import shutil
import tempfile
from pathlib import Path
from typing import Any

import torch
from playwright.sync_api import Page, sync_playwright

from torchfair import Topology, save_mesh
from torchfair.design.engine.requests import Open
from torchfair.design.running import BackgroundServer
from torchfair.design.server import ServerSettings

_FLAGS = ["--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
_BROWSERS = ("chromium", "chromium-browser", "google-chrome")
_KEEP = """() => {
  const connection = window.design.connection, receive = connection.receive.bind(connection);
  connection.receive = (data) => {
    if (data instanceof ArrayBuffer && new DataView(data).getUint8(0) === 1) window.lastFrame = data.slice(0);
    receive(data);
  };
}"""
_FRAMES = """async (rounds) => {
  const { design, lastFrame } = window, { scene, connection } = design, receives = [], draws = [];
  const draw = scene.frame.bind(scene);
  let drawn;
  scene.frame = () => { const start = performance.now(); draw(); draws.push(performance.now() - start); drawn?.(); };
  const count = new DataView(lastFrame).getUint32(12, true);
  for (let i = 0; i < rounds; i++) {
    const data = lastFrame.slice(0), places = new Float32Array(data, 24, 3 * count);
    for (let k = 0; k < places.length; k++) places[k] *= 1 + 1e-3 * (i % 2);
    const shown = new Promise((resolve) => { drawn = resolve; });
    const start = performance.now();
    connection.receive(data);
    design.store.tell(); // else a microtask does it
    receives.push(performance.now() - start);
    await shown;
    await new Promise((resolve) => setTimeout(resolve, 5));
  }
  scene.frame = draw;
  return { receives, draws };
}"""
_PICKS = """async (rounds) => {
  const { scene, picker } = window.design, times = [];
  for (let i = 0; i < rounds; i++) {
    scene.view.orbit(3, 1);
    const x = scene.view.width * (0.3 + 0.4 * Math.random()), y = scene.view.height * (0.3 + 0.4 * Math.random());
    const start = performance.now();
    const found = picker.later(x, y); // what the page asks for while the pointer moves
    times.push(performance.now() - start);
    await found;
  }
  return times;
}"""


def wavy_grid(count: int) -> tuple[torch.Tensor, Topology]:
    """About so many vertices."""
    columns = round(count**0.5)
    rows = round(count / columns)
    x, y = torch.meshgrid(torch.arange(columns).double(), torch.arange(rows).double(), indexing="ij")
    size = 24.0 / columns
    height = 1.5 * torch.sin(0.5 * size * x) * torch.cos(0.4 * size * y)
    vertices = torch.stack([size * x, size * y, height], dim=-1).reshape(-1, 3)
    corner = (torch.arange(columns - 1)[:, None] * rows + torch.arange(rows - 1)).reshape(-1)
    faces = torch.stack([corner, corner + rows, corner + rows + 1, corner + 1], dim=1)
    return vertices, Topology.from_faces(faces)


def measured(page: Page, count: int, folder: Path, rounds: int) -> dict[str, Any]:
    """Times in the page with a mesh of about so many vertices."""
    vertices, topology = wavy_grid(count)
    save_mesh(folder / "grid.obj", vertices, topology, overwrite=True)
    opening = Open(0, str(folder / "grid.obj"), None, "grid.obj", fresh=True)
    with BackgroundServer(ServerSettings(folder=folder), opening) as server:
        page.goto("about:blank")
        page.goto(server.url)
        page.wait_for_function("() => window.design?.connection")
        page.evaluate(_KEEP)
        ready = "() => window.lastFrame && window.design.store.state.state === 'READY'"
        page.wait_for_function(ready, timeout=120_000)
        times = page.evaluate(_FRAMES, rounds)
        picks = page.evaluate(_PICKS, rounds)
    frames = [a + b for a, b in zip(times["receives"], times["draws"], strict=False)]
    row: dict[str, Any] = {"vertices": topology.num_vertices}
    for name, values in (("receive", times["receives"]), ("draw", times["draws"]), ("frame", frames), ("pick", picks)):
        row[name] = {"first": values[0], "least": min(values), "median": sorted(values)[len(values) // 2]}
    return row


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("--vertices", nargs="+", type=int, default=[500, 2000, 8000, 50_000])
    parser.add_argument("--rounds", type=int, default=60)
    parser.add_argument("--json", type=Path)
    arguments = parser.parse_args()
    browser_path = next((path for path in map(shutil.which, _BROWSERS) if path), None)
    rows = []
    print("ms of script, least / median / first")
    with tempfile.TemporaryDirectory() as folder, sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=browser_path, args=_FLAGS)
        page = browser.new_context(viewport={"width": 1200, "height": 800}).new_page()
        for count in arguments.vertices:
            rows.append(row := measured(page, count, Path(folder), arguments.rounds))
            shown = (
                f"{name} {row[name]['least']:.1f} / {row[name]['median']:.1f} / {row[name]['first']:.1f}"
                for name in ("receive", "draw", "frame", "pick")
            )
            print(f"{row['vertices']:7} vertices   {'   '.join(shown)}", flush=True)
        browser.close()
    if arguments.json:
        arguments.json.write_text(json.dumps(rows, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
