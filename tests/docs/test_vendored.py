"""MathJax in the docs is what its authors published, and no page asks for anything from elsewhere."""

from __future__ import annotations

import hashlib
from pathlib import Path

FOLDER = Path(__file__).parents[2] / "docs" / "_static" / "mathjax"


def test_mathjax_is_unchanged_and_has_its_licence() -> None:
    sums = dict(reversed(line.split()) for line in (FOLDER / "SHA256SUMS").read_text().splitlines())
    files = {path.relative_to(FOLDER).as_posix(): path for path in FOLDER.rglob("*") if path.is_file()}
    assert sums.keys() == files.keys() - {"SHA256SUMS"} >= {"LICENSE", "startup.js", "output/chtml/fonts/tex.js"}
    for name, expected in sums.items():
        assert hashlib.sha256(files[name].read_bytes()).hexdigest() == expected
    assert "Apache License" in (FOLDER / "LICENSE").read_text()
    assert sum(path.stat().st_size for path in files.values()) < 1_000_000  # lean: the whole package has 15 MB
