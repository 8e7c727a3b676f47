"""Server and mesh of all tests of the page, browser and window of a module of them."""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from browser_tools import Served, Window, chromium, hall, opened_browser

from torchfair.io import save_mesh


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    if chromium() is None:
        pytest.skip("no Chromium on this machine: apt-get install chromium")
    if importlib.util.find_spec("playwright") is None:
        pytest.skip('playwright is not installed: pip install "torchfair[browser]"')
    with opened_browser() as browser:
        yield browser


@pytest.fixture(scope="session")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with a mesh, ``hall.obj``."""
    folder = tmp_path_factory.mktemp("design")
    save_mesh(folder / "hall.obj", *hall())
    return folder


@pytest.fixture(scope="session")
def served(folder: Path) -> Iterator[Served]:
    served = Served(folder, "hall.obj")
    yield served
    served.stop()


@pytest.fixture
def open_window(browser: Any, served: Served) -> Iterator[Callable[..., Window]]:
    """Opens windows; none of them may complain, nor ask for anything from elsewhere."""
    opened: list[Window] = []

    def make(url: str = "", *, ready: bool = True, **settings: Any) -> Window:
        opened.append(Window(browser, url or served.url, ready=ready, **settings))
        return opened[-1]

    yield make
    for window in opened:
        window.page.context.close()
    for window in opened:
        window.check(served)


@pytest.fixture(scope="module")
def only_window(browser: Any, served: Served) -> Iterator[Window]:
    window = Window(browser, served.url)
    window.open("hall.obj")
    yield window
    window.page.context.close()


@pytest.fixture
def window(only_window: Window, served: Served) -> Iterator[Window]:
    """The window of the module, as it was opened but for the mesh."""
    only_window.ready()
    only_window.reset()
    yield only_window
    only_window.check(served)
