"""``docs/paper.md``: its names exist, rows have verdicts, figures of experiments are those written there."""

from __future__ import annotations

import contextlib
import functools
import importlib
import re
from pathlib import Path
from typing import NamedTuple

import pytest

from torchfair.cli.command import build_parser
from torchfair.cli.errors import CommandError

ROOT = Path(__file__).resolve().parent.parent
COLUMNS = ("says", "library", "reach", "tests", "verdict")
VERDICTS = ("Built", "Holds", "Holds in part", "Does not hold", "Not built")
NUMBER = re.compile(r"(?<![\w.^])\d+(?:\.\d+)?(?:e-?\d+)?(?![\w]|\.\d)")


class Row(NamedTuple):
    """One statement."""

    says: str
    library: str
    reach: str
    tests: str
    verdict: str

    @property
    def word(self) -> str:
        """The verdict without its reasons."""
        return self.verdict.removeprefix("**").partition("**")[0].rstrip(".")


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().removeprefix("|").removesuffix("|").split("|")]


def rows_of(text: str) -> list[Row]:
    lines = [line for line in text.splitlines() if line.startswith("|") and not line.startswith("|---")]
    return [Row(*cells(line)) for line in lines if not line.startswith("| the paper says")]


ROWS = rows_of((ROOT / "docs" / "paper.md").read_text(encoding="utf-8"))
every_row = pytest.mark.parametrize("row", ROWS, ids=lambda row: row.says[:50])


def quoted(cell: str) -> list[str]:
    return re.findall(r"`([^`]+)`", cell)


def public(name: str) -> object:
    """What a dotted name below ``torchfair`` stands for."""
    room, *parts = name.split(".")
    return functools.reduce(getattr, parts, importlib.import_module(f"torchfair.{room}"))


def options_of(command: str) -> set[str]:
    (subparsers,) = (action for action in build_parser()._actions if action.choices and "measure" in action.choices)
    parser = subparsers.choices[command]
    with contextlib.suppress(CommandError):
        parser.parse_known_args([])  # options are added when they are first needed
    return {option for action in parser._actions for option in action.option_strings}


def experiment_lines(scripts: list[str]) -> str:
    text = (ROOT / "experiments" / "README.md").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if line.startswith("|")]
    for script in scripts:
        assert any(script in line for line in lines), f"{script} has no line in experiments/README.md"
    return "\n".join(line for line in lines if any(script in line for script in scripts))


@every_row
def test_there_is_a_verdict(row: Row) -> None:
    assert row.word in VERDICTS
    if row.word != "Not built":
        assert quoted(row.library)
        assert quoted(row.tests)


@every_row
def test_names_of_the_library_exist(row: Row) -> None:
    for name in quoted(row.library):
        assert public(name) is not None


@every_row
def test_commands_experiments_and_tests_exist(row: Row) -> None:
    for name in quoted(row.reach):
        if name.startswith("torchfair "):
            _, command, *options = name.split()
            assert {option for option in options if option.startswith("--")} <= options_of(command)
        else:
            assert (ROOT / "experiments" / name).is_file()
    for name in quoted(row.tests):
        path, _, function = name.partition("::")
        assert (ROOT / path).is_file()
        assert not function or f"def {function}(" in (ROOT / path).read_text(encoding="utf-8")


@every_row
def test_figures_of_experiments_are_those_of_their_page(row: Row) -> None:
    scripts = [name for name in quoted(row.reach) if name.endswith(".py")]
    known = set(NUMBER.findall(experiment_lines(scripts))) if scripts else set()
    unknown = {number for number in NUMBER.findall(row.verdict) if len(number) > 1} - known
    assert not scripts or not unknown, f"not among the results of {scripts}: {sorted(unknown)}"


def test_all_sections_have_statements() -> None:
    assert len(ROWS) >= 50
    assert {"Built", "Holds", "Holds in part"} <= {row.word for row in ROWS}


def test_what_is_wrong_would_be_seen() -> None:
    with pytest.raises(AttributeError):
        public("energies.no_such_energy")
    (row,) = rows_of("| a | `energies.normal_variation` | `fig18_hybrid_roof.py` | | **Holds**: by 99.9 %. |")
    with pytest.raises(AssertionError, match=r"99\.9"):
        test_figures_of_experiments_are_those_of_their_page(row)
    assert "--reference" in options_of("fair")
