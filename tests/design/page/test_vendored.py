"""three.js in the page is what its authors published, and no file of the page asks for anything from elsewhere."""

from __future__ import annotations

import hashlib
import re
import shutil
import subprocess
from pathlib import Path

import pytest

PAGE = Path(__file__).resolve().parents[3] / "torchfair" / "design" / "page"
OWN = sorted(path for path in PAGE.iterdir() if path.suffix in (".js", ".html", ".css", ".svg"))


def test_three_is_unchanged_and_has_its_licence() -> None:
    folder = PAGE / "vendor" / "three"
    sums = dict(reversed(line.split()) for line in (folder / "SHA256SUMS").read_text().splitlines())
    assert sums.keys() == {path.name for path in folder.iterdir()} - {"SHA256SUMS"} >= {"LICENSE"}
    for name, expected in sums.items():
        assert hashlib.sha256((folder / name).read_bytes()).hexdigest() == expected
    assert "MIT License" in (folder / "LICENSE").read_text()


@pytest.mark.parametrize("path", OWN, ids=lambda path: path.name)
def test_addresses_are_relative(path: Path) -> None:
    text = path.read_text(encoding="utf-8").replace("http://www.w3.org/", "")
    assert not re.search(r"""https?://|["'(]/[a-z]|@import""", text)
    assert not re.search(
        r"""\bstyle=|\son[a-z]+=["']|<script>|\beval\(|new Function""", text
    )  # forbidden by the policy


@pytest.mark.parametrize("path", [path for path in OWN if path.suffix == ".js"], ids=lambda path: path.name)
def test_modules_are_short_and_import_what_there_is(path: Path) -> None:
    lines = path.read_text(encoding="utf-8").splitlines()
    assert len(lines) <= 240
    assert lines[0].startswith("//")  # says what it is for
    for name in re.findall(r"""from "(\./[^"]+)";""", "\n".join(lines)):
        assert (PAGE / name).is_file(), name


def test_functions_of_the_page_alone(tmp_path: Path) -> None:
    """What needs no browser: containers, frames, sliders, polygons, geometry; by node, where there is one."""
    node = shutil.which("node")
    if node is None:
        pytest.skip("node is not installed")
    for path in PAGE.rglob("*.js"):
        copy = tmp_path / path.relative_to(PAGE)
        copy.parent.mkdir(parents=True, exist_ok=True)
        copy.write_bytes(path.read_bytes())
    (tmp_path / "package.json").write_text('{"type": "module"}')
    (tmp_path / "check.js").write_bytes(Path(__file__).with_name("check.js").read_bytes())
    ran = subprocess.run([node, "check.js"], cwd=tmp_path, capture_output=True, text=True, timeout=60)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.strip().endswith("checks")
