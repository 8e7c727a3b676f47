"""Options and settings are one: every option is a field, every field an option or hidden for a reason."""

from __future__ import annotations

import dataclasses
import json
import math
from pathlib import Path
from typing import Any

import pytest

from torchfair.cli import denoise, fair, form, symmetric
from torchfair.cli.errors import CommandError
from torchfair.cli.job_command import JobCommand
from torchfair.cli.options import HIDDEN, SHORTER
from torchfair.cli.parser import CommandParser
from torchfair.settings import SettingField, fields_of

COMMANDS = (fair.COMMAND, form.COMMAND, symmetric.COMMAND, denoise.COMMAND)
JOBS = [pytest.param(command, id=command.job) for command in COMMANDS]
PAGE = Path(__file__).resolve().parents[2] / "docs" / "command_line.md"


def parse(command: JobCommand, *words: str) -> Any:
    """The settings that words ask for."""
    parser = CommandParser(prog="x")
    options = command.options()
    options.add_to(parser)
    return options.settings(parser.parse_args(words))


def values(settings: Any) -> dict[str, Any]:
    """All fields with their values, by names with dots."""
    found = {}
    for name in fields_of(type(settings)):
        value = settings
        for part in name.split("."):
            value = getattr(value, part)
        found[name] = value
    return found


def another(field: SettingField) -> str:
    """A word that gives a field another value, near its default."""
    shown = field.show(field.default)
    for word in (*field.symbol.split("|"), "7", "0.75", "3,2"):
        try:
            if field.parse(word) != field.default and word != "none":
                return word
        except ValueError:
            continue
    raise AssertionError(f"{field.name} has one value only, {shown}")


@pytest.mark.parametrize("command", JOBS)
def test_no_options_are_the_defaults_of_the_library(command: JobCommand) -> None:
    assert parse(command) == command.settings()()


@pytest.mark.parametrize("command", JOBS)
def test_every_field_is_an_option_or_hidden_for_a_reason(command: JobCommand) -> None:
    options, fields = command.options(), fields_of(command.settings())
    assert options.names.keys() | options.hidden.keys() == fields.keys()
    assert not options.names.keys() & options.hidden.keys()
    assert len(set(options.names.values())) == len(options.names)
    assert all(len(reason) > 20 for reason in HIDDEN.values())
    assert HIDDEN.keys() <= fields.keys()
    assert {*SHORTER, *command.option_names} <= options.names.keys()


@pytest.mark.parametrize("command", JOBS)
def test_every_option_changes_its_field_and_no_other(command: JobCommand) -> None:
    names, defaults = command.options().names, values(command.settings()())
    for name, option in names.items():
        field = fields_of(command.settings())[name]
        if field.is_switch:
            word, words = str(not field.default).lower(), [f"--{'no-' if field.default else ''}{option}"]
        else:
            shares = dict.fromkeys(("smallest_area", "smallest_share", "smallest_edge"), "0.4")
            word = ({"smoothing": "0.2", "coarse_smoothing": "0.9"} | shares).get(name) or another(field)
            words = [f"--{option}", word]
        found = values(parse(command, *words))
        assert found.pop(name) == field.parse(word) != defaults[name], option
        assert found == {other: value for other, value in defaults.items() if other != name}


@pytest.mark.parametrize("command", JOBS)
def test_help_says_the_default_in_the_unit_that_is_typed(command: JobCommand) -> None:
    parser = CommandParser(prog="x")
    command.options().add_to(parser)
    text = " ".join(parser.format_help().split())
    assert "radians" not in text.replace("normals, radians", "")
    for name, option in command.options().names.items():
        field = fields_of(command.settings())[name]
        if field.is_switch:
            switched = f"--{option}, --no-{option} {field.help[0]}"
            assert switched in text
            assert f"(default {field.show(field.default)})" in text.partition(switched)[2].partition(" --")[0], option
            continue
        assert f"--{option} {field.symbol}" in text
        shown = f"{math.degrees(field.default):g} degrees" if field.unit == "radians" else field.show(field.default)
        assert f"(default {shown}" in text.partition(f"--{option} {field.symbol} {field.help[0]}")[2][:700], option
    if command is fair.COMMAND:
        assert "(default 0.05 mean edges)" in text


@pytest.mark.parametrize("command", JOBS)
def test_options_win_over_the_file(command: JobCommand, tmp_path: Path) -> None:
    path = tmp_path / "mine.json"
    file = {"boundary": "fixed", "handle_weight": 3.0, "projection": {"patience": 9, "solver": "scipy"}}
    path.write_text(json.dumps(file))
    found = parse(command, "--settings", str(path), "--handle-weight", "4", "--solver", "cg")
    defaults = command.settings()()
    projection = dataclasses.replace(defaults.projection, patience=9, solver="cg")
    assert found == dataclasses.replace(defaults, boundary="fixed", handle_weight=4.0, projection=projection)


def test_faults_of_options_and_files_are_command_errors(tmp_path: Path) -> None:
    for words, message in (
        (["--boundary", "loose"], "--boundary: expected one of glide, fixed, free, got 'loose'"),
        (["--corner-angle", "200"], "--corner-angle: expected degrees from 0 to 180"),
        (["--distance", "-1"], "^--distance must be a number above 0, or none, got -1.0"),
        (["--time-limit", "-1"], "^--time-limit must be a number of at least 0, or none, got -1.0"),
        (["--fairness", "-1"], ": --fairness=-1.0"),
        (["--continuation", "3,1"], "^--continuation must hold finite factors above 1"),
        (["--iterations", "-1"], "^--iterations must be a whole number"),
    ):
        with pytest.raises(CommandError, match=message):
            parse(fair.COMMAND, *words)
    with pytest.raises(CommandError, match=r"^--smoothing .* at most --coarse-smoothing, got"):
        parse(form.COMMAND, "--smoothing", "0.9", "--coarse-smoothing", "0.1")
    (tmp_path / "mine.json").write_text('{"boundary": "loose"}')
    with pytest.raises(CommandError, match=r"mine\.json: boundary: expected one of glide"):
        parse(fair.COMMAND, "--settings", str(tmp_path / "mine.json"))
    (tmp_path / "mine.json").write_text('{"fairness_weight": -1.0}')
    with pytest.raises(CommandError, match=r"mine\.json: .*: fairness_weight=-1.0"):
        parse(fair.COMMAND, "--settings", str(tmp_path / "mine.json"), "--fairness", "2")


def test_what_is_asked_for_by_options_files_and_presets(tmp_path: Path) -> None:
    path = tmp_path / "mine.json"
    path.write_text('{"evenness_weight": 0.0, "smallest_angle_degrees": 5, "projection": {"patience": 9}}')
    parser, options = CommandParser(prog="x"), symmetric.COMMAND.options()
    options.add_to(parser)
    for words, names in (
        ([], set()),
        (["--free"], {"free"}),
        (["--settings", str(path)], {"evenness_weight", "smallest_angle", "projection.patience"}),
        (["--settings", str(path), "--iterations", "3"], {"evenness_weight", "smallest_angle", "projection.patience",
            "projection.max_iterations"}),
        (["--preset", "paper"], set(fields_of(symmetric.COMMAND.settings()))),
    ):  # fmt: skip
        assert set(options.asked(parser.parse_args(words))) == names


@pytest.mark.parametrize("command", JOBS[:3])
def test_a_preset_gives_all_settings_and_options_win_over_it(command: JobCommand) -> None:
    found = parse(command, "--preset", "paper,w_fair=0.5", "--handle-weight", "4")
    assert found == dataclasses.replace(command.settings().paper(w_fair=0.5), handle_weight=4.0)


def test_faults_of_presets_are_command_errors(tmp_path: Path) -> None:
    with pytest.raises(CommandError, match="presets are paper, got 'ours'"):
        parse(fair.COMMAND, "--preset", "ours")
    with pytest.raises(CommandError, match="--preset and --settings both give all settings"):
        parse(fair.COMMAND, "--preset", "paper", "--settings", str(tmp_path / "mine.json"))
    with pytest.raises(CommandError, match="unrecognized arguments: --preset paper"):
        parse(denoise.COMMAND, "--preset", "paper")


def test_switches_are_flags_that_can_be_taken_back() -> None:
    @dataclasses.dataclass(frozen=True)
    class Settings:
        """One switch.

        Attributes:
            curved: Whether it bends.
        """

        curved: bool = True

    class Command(JobCommand):
        job = "toy"
        settings = lambda self: Settings  # noqa: E731
        function = add_inputs = read = None

    assert parse(Command()).curved is True
    assert parse(Command(), "--no-curved").curved is False
    assert parse(Command(), "--no-curved", "--curved").curved is True


def table(command: JobCommand) -> str:
    """What the page of the command line says of the settings of a job."""
    lines = ["| option | field | default |", "|---|---|---|"]
    for name, option in command.options().names.items():
        field = fields_of(command.settings())[name]
        shown, symbol = field.show(field.default), field.symbol.replace("|", r"\|")
        unit = {"": "", "radians": " degrees"}.get(field.unit, f" {field.unit}") if shown != "none" else ""
        words = f"`--{option}`, `--no-{option}`" if field.is_switch else f"`--{option} {symbol}`"
        lines.append(f"| {words} | `{name}` | {shown}{unit} |")
    return "\n".join(lines)


@pytest.mark.parametrize("command", JOBS)
def test_the_page_of_the_command_line_has_every_option_and_its_default(command: JobCommand) -> None:
    page = PAGE.read_text()
    section, shared = (
        page.partition(f"## {name}\n")[2].partition("\n## ")[0]
        for name in (f"torchfair {command.job}", "Jobs: fair, form, symmetric, denoise")
    )
    assert table(command) in section, f"the table of settings should be\n{table(command)}"
    parser = CommandParser(prog="x", fill=command._fill)
    parser.parse_known_args(["x.obj", "-o", "y.obj"])
    for action in parser._actions[1:]:
        for option in action.option_strings:
            assert f"`{option}" in section + shared, option


if __name__ == "__main__":
    for job in COMMANDS:
        print(table(job), end="\n\n")
