"""Python examples in the README and the docs run as they stand; shell lines of the README name real options."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from torchfair.cli.command import build_parser

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
EXAMPLES = [
    pytest.param(code, id=f"{page.name}-{number}")
    for page in PAGES
    for number, code in enumerate(re.findall(r"^```python\n(.*?)^```", page.read_text(), re.S | re.M))
]
COMMANDS = [
    pytest.param(line, id=f"{page.name}: {line}"[:60])
    for page in PAGES
    for block in re.findall(r"^```sh\n(.*?)^```", page.read_text(), re.S | re.M)
    for line in re.findall(r"(?:\.venv/bin/)?(torchfair [^#\n&|]+)", block)
]


@pytest.mark.parametrize("code", EXAMPLES)
def test_python_example_runs(code: str) -> None:
    exec(compile(code, "example", "exec", dont_inherit=True), {"__name__": "example"})


@pytest.mark.parametrize("line", COMMANDS)
def test_command_line_is_understood(line: str) -> None:
    arguments = build_parser().parse_args(shlex.split(line)[1:])
    assert callable(arguments.run)


@pytest.mark.parametrize("path", sorted((ROOT / "experiments").glob("[!_]*.py")), ids=lambda path: path.stem)
def test_the_changelog_and_the_index_of_experiments_name_every_experiment(path: Path) -> None:
    for page in (ROOT / "CHANGELOG.md", ROOT / "experiments" / "README.md"):
        assert re.search(rf"\b{path.stem}\b", page.read_text()), f"{page.name} does not name {path.stem}"


def test_there_are_examples() -> None:
    assert len(EXAMPLES) >= 3
    assert len(COMMANDS) >= 5
