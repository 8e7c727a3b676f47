"""The commands of ``torchfair`` that lead to what is on the screen."""

from __future__ import annotations

import shlex
from collections.abc import Mapping
from typing import Any

import numpy as np

from .document import Document

_OPTIONS = {"handle": "handle-weight"}
"""Options that are not called like their weights."""
_EXACT = "does the whole job from the start; what was dragged may rest in another minimum near by"
_ROUGHLY = "leads there step by step, to another minimum near by; save the mesh where its last digits count"


def command_line(document: Document) -> tuple[str, bool, str]:
    """The commands, one a line; whether one command on the file itself is all; and a sentence about them.

    Intermediate meshes are ``step1.obj`` and so on. Refinements in the end are levels of the job.
    """
    first, *steps = document.history
    source, repair = str(first["source"]), [f"--{word.replace('_', '-')}" for word in first.get("repair", ())]
    if source.startswith("-"):
        source = f"./{source}"  # no option
    lines: list[str] = []
    for number, step in enumerate(steps, 1):
        target = f"step{number}.obj"
        command, *options = _words(step)
        lines.append(_line(["torchfair", command, source, *options, *repair, "-o", target]))
        source, repair = target, []
    job = job_step(document)
    if not job["levels"] and np.array_equal(document.start, document.vertices):
        if not lines:
            return _line(["torchfair", "measure", source, *repair]), True, "nothing has moved yet"
        return "\n".join(lines), False, _ROUGHLY
    command, *options = _words(job)
    lines.append(_line(["torchfair", command, source, *options, *repair, "-o", "result.obj"]))
    exact = len(lines) == 1 and not job["levels"]
    return "\n".join(lines), exact, _EXACT if exact else _ROUGHLY


def job_step(document: Document) -> dict[str, Any]:
    """The job that makes a document what it is, with vertices as they are called in the mesh that it starts from."""
    *_, root = document.levels()
    own = len(root.history) == 1  # a file, not an intermediate mesh, which would be an OBJ file
    names = root.names if own else np.arange(1, root.count + 1)

    def called(vertex: int) -> int:
        return vertex if names is None else int(names[vertex])

    handles = {called(v): list(place) for v, place in document.handles.items() if v < root.count}
    return {
        "do": document.mode,
        "handles": [[vertex, *place] for vertex, place in handles.items()],
        "held": [called(vertex) for vertex in document.held if vertex < root.count],
        "weights": dict(document.weights.get(document.mode, {})),
        "choices": dict(document.choices.get(document.mode, {})),
        "levels": sum(1 for _ in document.levels()) - 1,
    }


def _words(step: Mapping[str, Any]) -> list[str]:
    """A command and its options."""
    kind = step["do"]
    if kind == "mesh":
        return ["mesh", f"--{step['kind']}", str(step["count"])]
    words = [kind]
    for vertex, *place in step["handles"]:
        words += ["--handle", str(vertex), *map(repr, place)]
    if step["held"]:
        words += ["--fix", *map(str, step["held"])]
    for name, value in step["weights"].items():
        words += [f"--{_OPTIONS.get(name, name.replace('_', '-'))}", repr(float(value))]
    for name, value in step["choices"].items():
        words += [f"--{name.replace('_', '-')}", value]
    return [*words, "--levels", str(step["levels"])] if step["levels"] else words


def _line(words: list[str]) -> str:
    return " ".join(shlex.quote(word) for word in words)
