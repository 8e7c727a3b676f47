"""Takes what the pages need of MathJax out of its package on npm: ``python docs/vendor_mathjax.py``.

Formulas are TeX, set with MathJax's own fonts; menus, speech, MathML, SVG and rare TeX packages stay away. The files in
docs/_static/mathjax are those of the package, byte for byte, with its licence.
"""

from __future__ import annotations

import hashlib
import json
import shutil
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path

VERSION = "3.2.2"
FOLDER = Path(__file__).resolve().parent / "_static" / "mathjax"
FONTS = (
    *("AMS-Regular", "Calligraphic-Regular", "Main-Bold", "Main-Italic", "Main-Regular", "Math-BoldItalic"),
    *("Math-Italic", "Size1-Regular", "Size2-Regular", "Size3-Regular", "Size4-Regular", "Typewriter-Regular", "Zero"),
)
FILES = (
    *("startup.js", "core.js", "input/tex.js", "output/chtml.js", "output/chtml/fonts/tex.js"),
    *(f"output/chtml/fonts/woff-v2/MathJax_{font}.woff" for font in FONTS),
)


def download(folder: Path) -> Path:
    """The package, unpacked."""
    npm = shutil.which("npm")
    if npm is None:
        raise SystemExit("npm is needed to download MathJax, and is not installed")
    command = [npm, "pack", "--json", f"mathjax@{VERSION}"]
    told = json.loads(subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout)
    with tarfile.open(folder / told[0]["filename"]) as package:
        package.extractall(folder, filter="data")
    return folder / "package"


def main() -> None:
    """Replaces the folder."""
    with tempfile.TemporaryDirectory() as folder:
        package = download(Path(folder))
        shutil.rmtree(FOLDER, ignore_errors=True)
        for name in FILES:
            (FOLDER / name).parent.mkdir(parents=True, exist_ok=True)
            shutil.copyfile(package / "es5" / name, FOLDER / name)
        shutil.copyfile(package / "LICENSE", FOLDER / "LICENSE")
    files = sorted(path for path in FOLDER.rglob("*") if path.is_file())
    sums = (f"{hashlib.sha256(path.read_bytes()).hexdigest()}  {path.relative_to(FOLDER).as_posix()}" for path in files)
    (FOLDER / "SHA256SUMS").write_text("\n".join(sums) + "\n")
    print(f"MathJax {VERSION}: {len(files)} files, {sum(path.stat().st_size for path in files)} bytes", file=sys.stderr)


if __name__ == "__main__":
    main()
