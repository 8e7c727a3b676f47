"""The built pages in Chromium without a network: formulas are set, listings copied, nothing is wider than a phone, nor
a table than a laptop."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from browser_tools import FLAGS, chromium

PAGES = Path(__file__).parents[2] / "docs" / "_build"
PHONE = {"width": 390, "height": 844}
LAPTOP = {"width": 1440, "height": 900}

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    api = pytest.importorskip("playwright.sync_api")
    assert (PAGES / "index.html").exists(), "build the pages first: python -m sphinx -q -W -b html docs docs/_build"
    with api.sync_playwright() as playwright:
        yield playwright.chromium.launch(executable_path=chromium(), args=[*FLAGS, "--allow-file-access-from-files"])


def opened(context: Any, path: Path, asked: list[str]) -> Any:
    page = context.new_page()
    page.on("request", lambda request: asked.append(request.url))
    page.on("requestfailed", lambda request: asked.append(f"failed {request.url}"))
    page.on("pageerror", lambda error: asked.append(f"error {error}"))
    page.goto(path.as_uri())
    return page


def test_formulas_are_set_without_a_network(browser: Any) -> None:
    context, seen = browser.new_context(offline=True), 0
    for path in sorted(PAGES.rglob("*.html")):
        if 'class="math' not in path.read_text(encoding="utf-8"):
            continue
        asked: list[str] = []
        page = opened(context, path, asked)
        page.wait_for_function("window.MathJax?.startup?.promise")
        page.evaluate("MathJax.startup.promise")
        written, made = (len(page.query_selector_all(f".math{inner}")) for inner in ("", " mjx-container"))
        assert written == made > 0, path.name
        assert page.query_selector_all("mjx-merror, mjx-utext") == [], path.name  # wrong TeX; a glyph without a font
        assert [url for url in asked if not url.startswith("file:")] == [], path.name
        fonts = page.evaluate("document.fonts.ready.then(() => [...document.fonts].map((font) => font.status))")
        assert "loaded" in fonts, path.name
        assert "error" not in fonts, path.name
        page.close()
        seen += made
    assert seen > 300


def test_listings_are_copied_without_prompts(browser: Any) -> None:
    page = opened(browser.new_context(offline=True), PAGES / "api" / "energies.html", [])
    listing = page.locator("div.highlight", has_text=">>> ").first
    assert listing.locator("button").count() == 1
    copied = page.evaluate("(pre) => listingText(pre)", listing.locator("pre").element_handle())
    assert copied
    assert ">>>" not in copied
    listing.hover()
    listing.locator("button").click()
    page.wait_for_function("document.querySelector('button.copy-listing:focus')?.textContent === 'Copied'")


@pytest.mark.parametrize("path", sorted(PAGES.rglob("*.html")), ids=lambda path: path.stem)
def test_nothing_is_wider_than_a_phone(browser: Any, path: Path) -> None:
    page = opened(browser.new_context(offline=True, viewport=PHONE), path, [])
    assert page.evaluate("document.documentElement.scrollWidth") <= PHONE["width"]
    assert page.locator("meta[name=description]").count() == 1 or path.stem in ("genindex", "search", "py-modindex")


@pytest.mark.parametrize("path", sorted(PAGES.glob("*.html")), ids=lambda path: path.stem)
def test_tables_fit_on_a_laptop(browser: Any, path: Path) -> None:
    """Nothing in them scrolls sideways, and the page does not either; nor where the fonts of a machine are wider."""
    page = opened(browser.new_context(offline=True, viewport=LAPTOP), path, [])
    wide = "(boxes) => boxes.filter((box) => box.scrollWidth > box.clientWidth + 1).map((box) => box.innerText)"
    for spacing in ("normal", "0.03em"):
        page.add_style_tag(content=f"article table {{ letter-spacing: {spacing}; }}")
        assert page.evaluate("document.documentElement.scrollWidth") <= LAPTOP["width"]
        assert page.locator(".table-wrapper").evaluate_all(wide) == []
