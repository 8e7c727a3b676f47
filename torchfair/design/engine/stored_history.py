"""Histories of session files: anybody may have written what command lines are made of."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..._reading_words import options_of
from ...errors import MeshFileError, TorchfairError
from ..document import MODES, Document
from .sliders import settings_of


def check_histories(path: Path, documents: Iterable[Document]) -> None:
    """Refuses what no design leads to, such as options that would write files where a command line is copied.

    Raises:
        MeshFileError: a step of a history, a weight or a choice is none, with the reason.
    """
    try:
        for document in documents:
            first, *steps = document.history
            _check_opening(first)
            for step in steps:
                _check_step(document, step)
            for mode in {*document.weights, *document.choices}:
                _check_settings(document, mode, document.weights.get(mode, {}), document.choices.get(mode, {}))
    except (TorchfairError, ValueError, KeyError, TypeError, AttributeError, OverflowError) as error:
        raise MeshFileError(path, f"is no session file of torchfair ({error})") from None


def _check_opening(step: Mapping[str, Any]) -> None:
    """How a file was opened."""
    _check(step["do"] == "open", step["do"])
    _check(isinstance(step["source"], str), step["source"])
    options_of(step.get("repair", ()))


def _check_step(document: Document, step: Mapping[str, Any]) -> None:
    """A mesh along principal directions, or a job."""
    if step["do"] == "mesh":
        _check(step["kind"] in ("quads", "triangles"), step["kind"])
        _check_numbers(step["count"])
        return
    for vertex, *place in step["handles"]:
        _check_numbers(vertex)
        _check(len(place) == 3 and all(isinstance(x, (int, float)) and math.isfinite(x) for x in place), place)
    _check_numbers(*step["held"], step["levels"])
    _check_settings(document, step["do"], step["weights"], step["choices"])


def _check_settings(document: Document, mode: str, weights: Mapping[str, float], choices: Mapping[str, str]) -> None:
    _check(mode in MODES, mode)
    settings_of(replace(document, mode=mode, weights={mode: weights}, choices={mode: choices}))


def _check_numbers(*values: Any) -> None:
    for value in values:
        _check(isinstance(value, int) and not isinstance(value, bool), value)


def _check(good: bool, value: Any) -> None:
    if not good:
        raise ValueError(f"{str(value)[:40]!r} is no part of a history")
