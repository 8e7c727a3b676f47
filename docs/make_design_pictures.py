"""Pictures of the page of ``torchfair design``: a moving one of a drag for the README, still ones for the docs.

Needs Chromium and ``pip install "torchfair[browser]"``::

    python docs/make_design_pictures.py
"""

from __future__ import annotations

import io
import math
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from browser_tools import Served, Window, opened_browser  # noqa: E402

IMAGES = ROOT / "docs" / "images"
MOST = 2_000_000  # bytes of the moving picture
FRAMES = 30
LOOKS = ("mirror", "edges", "stars", "wire")


def main() -> None:
    """Writes ``design_drag.gif``, ``design_page.png`` and ``design_looks.png``."""
    with tempfile.TemporaryDirectory() as folder, opened_browser() as browser:
        served = Served(Path(folder), "example:hybrid_roof")
        try:
            window = Window(browser, served.url, viewport={"width": 1180, "height": 720})
            window("(document.getElementById('frequency').value = 9, design.panel.applyMirror())")
            window("design.flights.arrive({ around: -1.15, up: 0.5 }), design.flights.arrive(design.flights.whole())")
            window("document.getElementById('notices').hidden = true")
            window.drawn()
            save_gif(list(drag(window)), IMAGES / "design_drag.gif")
            page(window).save(IMAGES / "design_page.png", optimize=True)
            looks(window).save(IMAGES / "design_looks.png", optimize=True)
        finally:
            served.stop()


def shot(window: Window, clip: Any = None) -> Image.Image:
    """What the window shows."""
    return Image.open(io.BytesIO(window.page.screenshot(clip=clip))).convert("RGB")


def drag(window: Window) -> Iterator[Image.Image]:
    """A vertex in the middle is pulled up, aside, and let go."""
    vertex = window.inner_vertex()
    x, y = window.place(vertex)
    window.page.mouse.move(x, y)
    window.wait(f"design.store.hover === {vertex}")
    yield pointed(shot(window), x, y)
    window.page.mouse.down()
    for k in range(1, FRAMES + 1):
        share = 0.5 - 0.5 * math.cos(math.pi * k / FRAMES)
        px, py = x + 40 * math.sin(2.2 * share), y - 66 * share
        window.page.mouse.move(px, py)
        count = window("design.handles.count")
        window.wait(f"design.store.frame.count >= {count} && !design.scene.waiting")
        yield pointed(shot(window), px, py)
    window.end_drag()
    window.drawn()
    for _ in range(8):
        yield pointed(shot(window), px, py)


def pointed(picture: Image.Image, x: float, y: float) -> Image.Image:
    """The picture with an arrow where the mouse is: screenshots have none."""
    from PIL import ImageDraw

    outline = [(0, 0), (0, 17), (4, 13), (7, 20), (10, 19), (7, 12), (13, 12)]
    ImageDraw.Draw(picture).polygon([(x + dx, y + dy) for dx, dy in outline], fill="white", outline="black")
    return picture


def save_gif(frames: list[Image.Image], path: Path) -> None:
    """Writes frames in one palette, smaller until the file is small enough."""
    for width in (860, 760, 660, 560):
        sizes = [(width, round(frame.height * width / frame.width)) for frame in frames]
        small = [frame.resize(size, Image.Resampling.LANCZOS) for frame, size in zip(frames, sizes, strict=True)]
        palette = small[-1].quantize(96, method=Image.Quantize.MAXCOVERAGE)
        fixed = [frame.quantize(palette=palette, dither=Image.Dither.NONE) for frame in small]
        times = [600, *[70] * (len(fixed) - 2), 1500]  # ms
        fixed[0].save(path, save_all=True, append_images=fixed[1:], duration=times, loop=0)
        if path.stat().st_size < MOST:
            return
    raise SystemExit(f"{path} has {path.stat().st_size} bytes: take fewer frames")


def page(window: Window) -> Image.Image:
    """The whole page with a selected handle."""
    window.page.mouse.move(30, 690)
    window.drawn()
    return shot(window).quantize(256, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)


def looks(window: Window) -> Image.Image:
    """Four looks beside each other."""
    window.page.keyboard.press("Escape")
    sheet = Image.new("RGB", (1240, 978), "white")
    for k, look in enumerate(LOOKS):
        window(f"design.store.put({{ look: {look!r} }})")
        if look == "stars":
            window.wait("design.store.views.stars")
        window.drawn()
        box = window.page.locator("#canvas").bounding_box()
        picture = shot(window, {**box, "x": box["x"] + 58, "width": box["width"] - 58})
        size = (616, round(picture.height * 616 / picture.width))
        sheet.paste(picture.resize(size, Image.Resampling.LANCZOS), (k % 2 * 624, k // 2 * 493))
    return sheet.quantize(256, method=Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE)


if __name__ == "__main__":
    main()
