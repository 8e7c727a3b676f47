"""The commands of ``torchfair`` that lead to what is on the screen."""

from __future__ import annotations

import math
import shlex
from collections.abc import Mapping
from typing import Any

import numpy as np

from .document import Document

_NOT_WORDS = {  # options that are not named like their weights, as of torchfair.cli
    "handle": "handle-weight",
}


def command_line(document: Document) -> tuple[str, bool, str]:
    """The commands, one a line; whether they lead to the same minimum for sure; and a sentence about them."""
    first, *others = document.history
    source, repair = str(first["source"]), [f"--{word.replace('_', '-')}" for word in first.get("repair", ())]
    steps = list(others)
    levels = 0
    while steps and steps[-1]["do"] == "subdivide" and steps[-1].get("mode", document.mode) == document.mode:
        steps.pop()
        levels += 1
    lines: list[str] = []
    for number, step in enumerate(steps, 1):
        target = f"step{number}.obj"
        lines.append(_line([*_words(step), source, *repair, "-o", target]))
        source, repair = target, []
    if lines == [] and levels == 0 and np.array_equal(document.start, document.vertices):
        return _line(["torchfair", "measure", source, *repair]), True, "nothing has moved yet"
    job = {
        "do": document.mode,
        "handles": {str(vertex): list(place) for vertex, place in document.handles.items()},
        "held": list(document.held),
        "weights": document.weights.get(document.mode, {}),
        "choices": document.choices.get(document.mode, {}),
    }
    more = ["--levels", str(levels)] if levels else []
    words = _words(job, held=document.mode != "form")
    lines.append(_line([*words[:2], source, *words[2:], *repair, *more, "-o", "result.obj"]))
    exact = not lines[:-1] and not levels and not (document.held and document.mode == "form")
    sentence = (
        "does the same from the start; a mesh that was dragged may rest in another minimum near by"
        if exact
        else "leads there step by step; save the mesh where it has to be this one to the last digit"
    )
    return "\n".join(lines), exact, sentence


def _words(step: Mapping[str, Any], *, held: bool = True) -> list[str]:
    kind = step["do"]
    if kind == "subdivide":
        return ["torchfair", "subdivide"]
    if kind == "mesh":
        return ["torchfair", "mesh", f"--{step['kind']}", str(step["count"])]
    words = ["torchfair", kind]
    for vertex, place in step["handles"].items():
        words += ["--handle", str(vertex), *(_number(value) for value in place)]
    if step["held"] and held:
        words += ["--fix", *map(str, step["held"])]
    for name, value in step["weights"].items():
        words += [f"--{_NOT_WORDS.get(name, name.replace('_', '-'))}", _number(value)]
    for name, value in step["choices"].items():
        words += [f"--{name.replace('_', '-')}", value]
    return words


def _number(value: float) -> str:
    return repr(float(value)) if math.isfinite(value) else "0"


def _line(words: list[str]) -> str:
    return " ".join(shlex.quote(word) for word in words)
