"""Settings in files: TOML, JSON, and the reports of jobs."""

from __future__ import annotations

import dataclasses
import difflib
import json
import math
import os
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from ..errors import SettingsError
from .fields import SettingField, fields_of

S = TypeVar("S")

_DEGREES = "_degrees"


def read_settings(path: str | os.PathLike[str], kind: type[S], *, job: str | None = None) -> S:
    """Settings from a TOML file, a JSON file, or the report of a job; what they do not name has its default.

    Fields have the names of the dataclass, those inside another field stand in a table of its name. None is null, in
    TOML ``"none"``; angles are radians, or degrees under a name that ends in ``_degrees``.

    Args:
        path: A file that ends in ``.toml`` or ``.json``.
        kind: The settings dataclass.
        job: The job that they are for; reports of others are refused.

    Raises:
        SettingsError: the file is no TOML or JSON, or has a field or a value that does not belong there; names file,
            field and what is allowed.
        OSError: the file cannot be read.

    Example::

        settings = read_settings("smooth/roof.report.json", FairSettings)
    """
    return _made(read_fields(path, kind, job=job), kind, os.fspath(path))


def read_fields(path: str | os.PathLike[str], kind: type[Any], *, job: str | None = None) -> dict[str, Any]:
    """What a file of settings names: values by field, with dots; see :func:`read_settings`."""
    document = _document(Path(path))
    if isinstance(document.get("settings"), Mapping):  # a report
        if job is not None and document.get("job", job) != job:
            raise SettingsError(f"{path}: the report of the job '{document['job']}', not of '{job}'")
        document = document["settings"]
    return _fields_from(document, kind, os.fspath(path))


def settings_from(values: Mapping[str, Any], kind: type[S], *, where: str = "settings") -> S:
    """Settings from a mapping of plain values, as files hold them; see :func:`read_settings`.

    Args:
        values: By field.
        kind: The settings dataclass.
        where: What errors name.

    Raises:
        SettingsError: see :func:`read_settings`.
    """
    return _made(_fields_from(values, kind, where), kind, where)


def _fields_from(values: Mapping[str, Any], kind: type[Any], where: str) -> dict[str, Any]:
    """Values by field, with dots, in the unit of the library."""
    fields = fields_of(kind)
    given = {}
    for name, value in _flat(values, fields, where).items():
        field, in_degrees = _field(name, fields, where)
        try:
            found = field.read(value)
        except ValueError as error:
            raise SettingsError(f"{where}: {field.name}: {error}") from None
        given[field.name] = math.radians(found) if in_degrees else found
    return given


def _made(given: Mapping[str, Any], kind: type[S], where: str) -> S:
    try:
        return with_fields(kind(), given)
    except SettingsError as error:
        raise SettingsError(f"{where}: {error}") from None


def with_fields(settings: S, given: Mapping[str, Any]) -> S:
    """Settings with some fields changed, by names with dots.

    Raises:
        SettingsError: a value is out of its range.
    """
    own = {name: value for name, value in given.items() if "." not in name}
    for outer in {name.partition(".")[0] for name in given if "." in name}:
        inner = {name.removeprefix(f"{outer}."): value for name, value in given.items() if name.startswith(f"{outer}.")}
        own[outer] = with_fields(getattr(settings, outer), inner)
    changed: S = dataclasses.replace(settings, **own)  # type: ignore[type-var]
    return changed


def plain_settings(settings: Any) -> dict[str, Any]:
    """Settings as :func:`read_settings` reads them, exact to the last digit; infinity is ``"inf"``."""
    return {field.name: _plain(getattr(settings, field.name)) for field in dataclasses.fields(settings)}


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value):
        return plain_settings(value)
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, float) and math.isinf(value):
        return str(value)
    if value is None or isinstance(value, bool | int | float | str):
        return value
    return getattr(value, "name", type(value).__name__)  # an object, such as a linear solver of one's own


def _document(path: Path) -> dict[str, Any]:
    text = path.read_text(encoding="utf-8")
    try:
        document = tomllib.loads(text) if path.suffix.lower() == ".toml" else json.loads(text)
    except ValueError as error:  # of both parsers
        raise SettingsError(f"{path}: neither TOML nor JSON as its name promises: {error}") from None
    if not isinstance(document, dict):
        raise SettingsError(f"{path}: expected fields with their values, got {type(document).__name__}")
    return document


def _flat(values: Mapping[str, Any], fields: Mapping[str, SettingField], where: str) -> dict[str, Any]:
    """Values by names with dots."""
    outer = {name.partition(".")[0] for name in fields if "." in name}
    flat: dict[str, Any] = {}
    for name, value in values.items():
        if name not in outer:
            flat[name] = value
        elif isinstance(value, Mapping):
            flat |= {f"{name}.{inner}": item for inner, item in value.items()}
        else:
            raise SettingsError(f"{where}: {name}: expected a table of fields, got {value!r}")
    return flat


def _field(name: str, fields: Mapping[str, SettingField], where: str) -> tuple[SettingField, bool]:
    """The field of a name in a file, and whether its value is in degrees."""
    if name in fields:
        return fields[name], False
    angle = fields.get(name.removesuffix(_DEGREES))
    if name.endswith(_DEGREES) and angle is not None and angle.unit == "radians":
        return angle, True
    near = difflib.get_close_matches(name, fields, 1)
    hint = f", did you mean {near[0]}?" if near else ""
    raise SettingsError(f"{where}: unknown field '{name}'{hint} Fields are {', '.join(fields)}")
