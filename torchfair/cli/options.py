"""Options that are the fields of a settings dataclass."""

from __future__ import annotations

import argparse
import re
from collections.abc import Callable, Collection, Mapping
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from ..errors import SettingsError
from .errors import CommandError

if TYPE_CHECKING:
    from ..settings import SettingField

S = TypeVar("S")

_DEST = "settings."

SHORTER = {
    "projection.max_iterations": "iterations",
    "projection.time_limit": "time-limit",
    "projection.solver": "solver",
    "projection.merit_tolerance": "merit-tolerance",
    "handle_weight": "handle-weight",  # --handle is the handle itself
}
_TUNED = "tuned together with the job; a settings file can change it"
HIDDEN = {
    f"projection.{name}": _TUNED
    for name in (
        "step_policy",
        "initial_damping",
        "damping_scale",
        "gradient_tolerance",
        "step_tolerance",
        "patience",
        "patience_when_damped",
        "when_settled",
        "least_extrapolation",
        "least_uncorrected_gain",
        "accuracy",
    )
}


class SettingOptions(Generic[S]):
    """One option for every field of a settings dataclass, ``--settings FILE`` for all, and the settings they give.

    Dataclasses with presets have ``--preset`` too, for all fields at once.

    Defaults are those of the dataclass, help is its docstring. An option has the name of its field, without
    ``_weight`` unless another field has that name; angles are in degrees.

    Args:
        kind: The settings dataclass.
        job: The job that it is for.
        names: Options with other names, by field.

    Attributes:
        names: Option by field, without its dashes.
        hidden: Why a field has no option, by field.
    """

    def __init__(self, kind: type[S], job: str, names: Mapping[str, str]) -> None:
        from ..settings import fields_of, presets_of

        self._presets = presets_of(kind)
        self._kind, self._job, self._fields = kind, job, fields_of(kind)
        chosen = {**SHORTER, **names}
        self.hidden = {name: reason for name, reason in HIDDEN.items() if name in self._fields}
        self.names = {name: chosen.get(name, self._name(name)) for name in self._fields if name not in self.hidden}

    def _name(self, field: str) -> str:
        short = field.removesuffix("_weight")
        return (field if short in self._fields and short != field else short).replace("_", "-")

    def add_to(self, parser: argparse.ArgumentParser) -> None:
        """Adds the options."""
        group = parser.add_argument_group("settings", "also as fields of a file; options win over it")
        group.add_argument(
            "--settings",
            metavar="FILE",
            help=f"TOML or JSON file of settings, such as NAME.report.json of an earlier 'torchfair {self._job}', "
            "whose result is found again",
        )
        if self._presets:
            group.add_argument(
                "--preset",
                metavar="PRESET",
                help=f"instead of a file: {', '.join(self._presets)}, for guided projection as printed there, to be "
                "compared with; its own numbers after commas, as in paper,w_fair=0.3",
            )
        for name, option in self.names.items():
            field = self._fields[name]
            if field.is_switch:
                action: Any = {"action": argparse.BooleanOptionalAction}
            else:
                action = {"type": _read(field), "metavar": field.symbol}
            group.add_argument(
                f"--{option}", dest=_DEST + name, default=argparse.SUPPRESS, help=option_help(field), **action
            )

    def settings(self, arguments: argparse.Namespace) -> S:
        """The settings that arguments ask for.

        Raises:
            CommandError: a value is out of its range, the settings file is at fault, or there is a preset beside it.
        """
        from ..settings.files import with_fields

        try:
            basis = self._basis(arguments.settings, getattr(arguments, "preset", None))
        except SettingsError as error:
            raise CommandError(str(error)) from None
        try:
            return with_fields(basis, _given(arguments))
        except SettingsError as error:
            raise CommandError(self.in_options(str(error))) from None

    def asked(self, arguments: argparse.Namespace) -> Collection[str]:
        """Fields that options, the file or the preset name; a preset names all of them."""
        from ..settings.files import read_fields

        if getattr(arguments, "preset", None) is not None:
            return self._fields
        file = arguments.settings
        return {*_given(arguments), *(() if file is None else read_fields(file, self._kind, job=self._job))}

    def in_options(self, words: str) -> str:
        """What the library says of fields, with the options that give them in their place."""
        for name, option in self.names.items():
            field = name.rpartition(".")[2]
            ahead = r"\b" if "_" in field else "(?==| must)"  # others are words of the language, too
            words = re.sub(rf"(?<![\w-]){field}{ahead}", f"--{option}", words)
        return words

    def _basis(self, file: str | None, preset: str | None) -> S:
        """What options change."""
        from ..settings import preset_settings, read_settings

        if file is not None and preset is not None:
            raise CommandError("--preset and --settings both give all settings: a report holds those of its preset")
        if preset is not None:
            return preset_settings(preset, self._kind)
        return self._kind() if file is None else read_settings(file, self._kind, job=self._job)


def _given(arguments: argparse.Namespace) -> dict[str, Any]:
    """Values of the options that stand on the command line, by field."""
    return {name.removeprefix(_DEST): value for name, value in vars(arguments).items() if name.startswith(_DEST)}


def option_help(field: SettingField) -> str:
    """What an option means, in words, with its default in the unit that people give."""
    text = field.help.replace(", radians", "")
    unit = {"radians": " degrees", "": ""}.get(field.unit, f" {field.unit}")
    shown = field.show(field.default)
    default = f" (default {shown}{'' if shown == 'none' else unit})"
    return (text.rstrip(".") + default).replace("%", "%%")


def _read(field: SettingField) -> Callable[[str], Any]:
    def read(text: str) -> Any:
        try:
            return field.parse(text)
        except ValueError as error:
            raise argparse.ArgumentTypeError(str(error)) from None

    return read
